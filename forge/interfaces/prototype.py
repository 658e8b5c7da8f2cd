"""Default values of a message as YAML, as `ros2 interface proto` prints them."""

from __future__ import annotations

import struct
import sys
from collections.abc import Mapping

from forge.base.errors import InterfaceError, Problem
from forge.interfaces.model import (
    Action,
    Array,
    Element,
    Field,
    Interface,
    Message,
    Named,
    Primitive,
    Sequence,
    Service,
    String,
    TypeName,
    element_of,
)

LARGEST = 1_000_000
"""The maximum number of values; nested arrays multiply."""

Scalar = bool | int | float | str
Prototype = Scalar | list["Prototype"] | dict[str, "Prototype"]
"""A value in YAML."""


def to_yaml(interface: Interface, known: Mapping[TypeName, Message]) -> str:
    """Return a default message, request or goal as YAML; raises InterfaceError if it is too large."""
    import yaml

    match interface:
        case Message():
            message = interface
        case Service():
            message = interface.request
        case Action():
            message = interface.goal
    if _count(message, known, {}) > LARGEST:
        raise InterfaceError(Problem(f"'{message.name}' has more than {LARGEST} values"))
    default = prototype(message, known)
    text: str = yaml.safe_dump(default, allow_unicode=True, width=sys.maxsize, sort_keys=False)
    return text


def _count(message: Message, known: Mapping[TypeName, Message], counts: dict[TypeName, int]) -> int:
    """Return the number of values in a message, including nested ones; `counts` is a cache."""
    if message.name not in counts:
        total = 0
        for member in message.fields:
            element = element_of(member.type)
            each = _count(known[element.name], known, counts) if isinstance(element, Named) else 1
            total += 1 + each * (member.type.size if isinstance(member.type, Array) else 1)
        counts[message.name] = total
    return counts[message.name]


def prototype(message: Message, known: Mapping[TypeName, Message]) -> dict[str, Prototype]:
    """Return the default values of the fields of a message."""
    return {member.name: _default(member, known) for member in message.fields}


def _default(member: Field, known: Mapping[TypeName, Message]) -> Prototype:
    if isinstance(member.type, Array | Sequence):
        element = member.type.of
        if isinstance(member.default, tuple):
            return [_shown(value, element, in_array=True) for value in member.default]
        size = member.type.size if isinstance(member.type, Array) else 0
        return [_zero(element, known) for _ in range(size)]
    if member.default is not None and not isinstance(member.default, tuple):
        return _shown(member.default, member.type)
    return _zero(member.type, known)


def _zero(element: Element, known: Mapping[TypeName, Message]) -> Prototype:
    match element:
        case Named(name):
            return prototype(known[name], known)
        case String():
            return ""
        case Primitive("boolean"):
            return False
        case Primitive("float" | "double"):
            return 0.0
        case Primitive("octet" | "char" | "wchar"):
            return "\0"
        case Primitive():
            return 0


def _shown(value: bool | float | str, element: Element, *, in_array: bool = False) -> Scalar:
    """Return a value for YAML: an octet is the character with that code; arrays round float32 values."""
    if in_array and element == Primitive("float"):
        rounded: float = struct.unpack("<f", struct.pack("<f", value))[0]
        return rounded
    return chr(int(value)) if element == Primitive("octet") else value
