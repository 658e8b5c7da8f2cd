"""The output of `ros2 interface show` and `proto`: a definition with nested messages, and default values."""

from __future__ import annotations

import struct
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping

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
from forge.interfaces.read.declarations import read_declaration
from forge.interfaces.read.literals import ParseError

MAX_LINES = 1_000_000
"""The maximum number of lines, which grows exponentially with the nesting of messages."""

_MAX_NESTING = 100


def parse_type_name(text: str, known: Callable[[], Iterable[TypeName]] = tuple) -> TypeName:
    """Parse 'package/kind/Name'; raises InterfaceError with the message of `ros2 interface`.

    `known` returns names for a suggestion.
    """
    parts = text.split("/")
    if len(parts) != 3:
        full = (str(name) for name in known() if f"{name.package}/{name.name}" == text)
        hint = next((f"did you mean '{name}'?" for name in full), None)
        message = f"Invalid name '{text}'. Expected three parts separated by '/'"
        raise InterfaceError(Problem(message, hint=hint))
    if not all(parts):
        raise InterfaceError(Problem(f"Invalid name '{text}'. Must not contain empty parts"))
    if ".." in parts:
        raise InterfaceError(Problem(f"Invalid name '{text}'. Must not contain '..'"))
    return TypeName(*parts)


def show(name: TypeName, comments: int, text_of: Callable[[TypeName], str]) -> Iterator[str]:
    """Yield the lines of an interface and of its nested messages, indented by one tab per level.

    `comments` is the number of levels on which comments and blank lines are shown. `text_of` returns the text
    of a definition. Omitted comments include their '#', unlike in ROS. Raises InterfaceError if a message
    contains itself or is too large; exceptions of `text_of` propagate.
    """
    for number, line in enumerate(_show(name, comments, text_of, ())):
        if number >= MAX_LINES:
            raise InterfaceError(Problem(f"'{name}' expands to more than {MAX_LINES} lines"))
        yield line


def _show(
    name: TypeName, comments: int, text_of: Callable[[TypeName], str], above: tuple[TypeName, ...]
) -> Iterator[str]:
    if name in above:
        path = " -> ".join(f"{each.package}/{each.name}" for each in (*above[above.index(name) :], name))
        raise InterfaceError(Problem(f"a message cannot contain itself: {path}"))
    if len(above) > _MAX_NESTING:
        message = f"messages in '{above[0]}' are nested more than {_MAX_NESTING} levels deep"
        raise InterfaceError(Problem(message))
    keep = len(above) < comments
    for written in text_of(name).removeprefix("\ufeff").splitlines():
        line = written.rstrip() if keep else written.partition("#")[0].rstrip()
        if line or keep:
            yield "\t" * len(above) + line if line else ""
        try:
            code = line.partition("#")[0].replace("\t", " ").rstrip()
            element = element_of(read_declaration(code, name.package).type)
        except ParseError:  # only a comment, a blank line or '---'
            continue
        if isinstance(element, Named):
            yield from _show(element.name, comments, text_of, (*above, name))


MAX_VALUES = 1_000_000
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
