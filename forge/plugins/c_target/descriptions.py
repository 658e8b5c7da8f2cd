"""Type hashes and descriptions as C tables, as rosidl generates them since Iron (REP 2011, REP 2016)."""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.interfaces.cpp.headers import symbol
from forge.interfaces.cpp.text import quoted
from forge.interfaces.hashing import described_type, structures_of
from forge.interfaces.model import Action, Service

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from forge.interfaces.hashing import Hasher
    from forge.interfaces.model import Interface, Source, TypeName

_BYTES_PER_LINE = 8
_IMPLICIT = "implicit"
"""The encoding of types that no file defines, such as the request of a service."""


@frozen
class FieldView:
    """A row of the table of fields; texts are C literals."""

    name: str
    type_id: int
    capacity: int
    string_capacity: int
    nested: str
    default: str


@frozen
class DescriptionView:
    """A type with its hash, its fields, the types that it refers to, and the text that defines it."""

    name: str
    symbol: str
    kind: str
    hash_lines: tuple[str, ...]
    fields: tuple[FieldView, ...]
    referenced: tuple[tuple[str, str], ...]
    """The names of types and their names in C."""
    encoding: str
    source: tuple[str, ...]
    """The lines of the text, as C literals."""


def description_views(
    interface: Interface, hasher: Hasher, sources: Mapping[TypeName, Source]
) -> Iterator[DescriptionView]:
    """Yield the description of each type of an interface, after those that it refers to."""
    kinds = _kinds(interface)
    for name in dict(structures_of(interface)):
        source = sources.get(name)  # None for derived types
        yield DescriptionView(
            name=str(name),
            symbol=symbol(name),
            kind=kinds.get(name, "message"),
            hash_lines=tuple(_hash_lines(hasher.hash(name))),
            fields=tuple(_fields(hasher, name)),
            referenced=tuple((str(other), symbol(other)) for other in hasher.referenced(name)),
            encoding=PurePosixPath(source.relative).suffix.removeprefix(".") if source else _IMPLICIT,
            source=tuple(quoted(line) for line in _lines(source)),
        )


def _kinds(interface: Interface) -> dict[TypeName, str]:
    """Return the types of an interface that are not messages."""
    match interface:
        case Service():
            return {interface.name: "service"}
        case Action():
            services = (interface.send_goal.name, interface.get_result.name)
            return {interface.name: "action", **dict.fromkeys(services, "service")}
        case _:
            return {}


def _hash_lines(text: str) -> Iterator[str]:
    digits = text.partition("_")[2]
    values = [f"0x{digits[at : at + 2]}" for at in range(0, len(digits), 2)]
    for at in range(0, len(values), _BYTES_PER_LINE):
        yield ", ".join(values[at : at + _BYTES_PER_LINE])


def _fields(hasher: Hasher, name: TypeName) -> Iterator[FieldView]:
    for field in described_type(hasher, name)["fields"]:
        type_ = field["type"]
        yield FieldView(
            quoted(field["name"]),
            type_["type_id"],
            type_["capacity"],
            type_["string_capacity"],
            quoted(type_["nested_type_name"]),
            quoted(field["default_value"]),
        )


def _lines(source: Source | None) -> list[str]:
    """Return the lines of a definition with their ends, at least one."""
    return (source.text.splitlines(keepends=True) if source else []) or [""]
