"""print a message, a service's request or an action's goal as YAML, with default values"""

from __future__ import annotations

import struct
import sys
from collections.abc import Mapping

from forge.base.distributions import distribution_option
from forge.base.errors import InterfaceError, Problem
from forge.base.frozen import frozen
from forge.base.options import flag, option
from forge.cli.commands.interface.inputs import definition_path, known_library, non_empty
from forge.cli.options import profile_option
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
from forge.interfaces.resolve.resolution import nested_messages
from forge.interfaces.show import parse_type_name

MAX_VALUES = 1_000_000
"""The maximum number of values; nested arrays multiply."""

Scalar = bool | int | float | str
Prototype = Scalar | list["Prototype"] | dict[str, "Prototype"]
"""A value in YAML."""


@frozen
class Options:
    type: str = option("full name of the interface", positional=True, parse=non_empty, metavar="TYPE")
    no_quotes: bool = flag("print the YAML without surrounding quotes")
    rosdistro: str | None = distribution_option()
    profile: str | None = profile_option()


def run(options: Options) -> int:
    library = known_library(options.rosdistro, profile=options.profile)
    name = parse_type_name(options.type, library.names)
    path = definition_path(name, library, options.profile)
    parsed = library.find(name)
    if not parsed:
        raise InterfaceError(Problem(f"'{path}' does not define the interface '{name}'"))
    text = to_yaml(parsed.interface, nested_messages(parsed, library))
    print(text if options.no_quotes else f'"{text}"')
    return 0


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
    if _count(message, known, {}) > MAX_VALUES:
        raise InterfaceError(Problem(f"'{message.name}' has more than {MAX_VALUES} values"))
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
            return [_shown_value(value, element, in_array=True) for value in member.default]
        size = member.type.size if isinstance(member.type, Array) else 0
        return [_zero(element, known) for _ in range(size)]
    if member.default is not None and not isinstance(member.default, tuple):
        return _shown_value(member.default, member.type)
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


def _shown_value(value: bool | float | str, element: Element, *, in_array: bool = False) -> Scalar:
    """Return a value for YAML: an octet is the character with that code; arrays round float32 values."""
    if in_array and element == Primitive("float"):
        rounded: float = struct.unpack("<f", struct.pack("<f", value))[0]
        return rounded
    return chr(int(value)) if element == Primitive("octet") else value
