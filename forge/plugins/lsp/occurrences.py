"""Finds the messages, fields and constants that definitions name, for editors; skips invalid text.

Lines and columns count from 0, in characters.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from enum import Enum
from typing import Any

from forge.base.errors import InterfaceError, Location, Problem
from forge.base.frozen import frozen
from forge.interfaces.model import SECTIONS, Interface, Named, Source, TypeName, element_of, sections_of
from forge.interfaces.read.declarations import read_declaration
from forge.interfaces.read.literals import ParseError
from forge.interfaces.read.parsing import lines_of, parse_leniently, read_idl, split_sections, type_name
from forge.plugins.lsp.text import Span

_INCLUDE = re.compile(r'["<](\w+)/(\w+)/(\w+)\.idl[">]')
_TYPE = re.compile(r"[\w/]*")
_CONSTANTS = "_Constants"


class NameKind(Enum):
    """The kind of an occurrence."""

    REFERENCE = "reference"
    """A message as the type of a field."""
    INTERFACE = "interface"
    """The name of a struct in an .idl file."""
    FIELD = "field"
    CONSTANT = "constant"
    TYPEDEF = "typedef"
    """The name of a typedef in its declaration."""
    ALIAS = "alias"
    """The name of a typedef as a type."""
    FILE = "file"
    """The name of an interface in the path of an #include directive."""


@frozen
class Occurrence:
    """A name in a definition; `owner` is the message around it, `type` the one that a reference names."""

    kind: NameKind
    span: Span
    name: str
    owner: TypeName
    type: TypeName | None = None

    @property
    def stem(self) -> Span:
        """The name without its package."""
        return replace(self.span, start=self.span.end - len(self.name))


@frozen
class Reading:
    """The result of reading one file for an editor; `interface` is None if the file has none."""

    source: Source
    interface: Interface | None
    problems: tuple[Problem, ...] = ()
    occurrences: tuple[Occurrence, ...] = ()

    @property
    def name(self) -> TypeName:
        """The name of the interface; of a broken .idl file, the one implied by its path."""
        if self.interface:
            return self.interface.name
        implied_name = type_name(self.source)
        return replace(implied_name, kind=self.source.relative.partition("/")[0])


def read_leniently(source: Source) -> Reading:
    """Read a file that may be incomplete: report all problems, and keep the valid parts."""
    if not source.relative.endswith(".idl"):
        interface, problems = parse_leniently(source)
        return Reading(source, interface, tuple(problems), tuple(_in_lines(source)))
    try:
        reader = read_idl(source)
    except InterfaceError as error:
        return Reading(source, None, error.problems)
    idl_interface = reader.interface() if reader.has_interface() else None
    return Reading(source, idl_interface, tuple(reader.problems), tuple(_in_idl(reader, idl_interface)))


def _in_lines(source: Source) -> Iterator[Occurrence]:
    name = type_name(source)
    for suffix, section in zip(SECTIONS[name.kind], split_sections(lines_of(source)), strict=False):
        owner = replace(name, name=name.name + suffix)
        for line in section:
            code = line.text.partition("#")[0].rstrip()
            try:
                declaration = read_declaration(code, owner.package)
            except ParseError:  # including blank lines
                continue
            number, start = line.number - 1, declaration.name_offset
            element = element_of(declaration.type)
            if isinstance(element, Named):
                stop = _TYPE.match(code).end()  # type: ignore[union-attr]  # matches nothing as well
                span = Span(number, 0, stop)
                yield Occurrence(NameKind.REFERENCE, span, element.name.name, owner, element.name)
            kind = NameKind.CONSTANT if declaration.constant else NameKind.FIELD
            span = Span(number, start, start + len(declaration.name))
            yield Occurrence(kind, span, declaration.name, owner)


def _in_idl(reader: Any, interface: Interface | None) -> Iterator[Occurrence]:
    main = interface.name if interface else type_name(reader.source)
    for word in reader.includes:
        if path := _INCLUDE.fullmatch(word):
            place = reader.place((word.start_pos or 0) + path.start(3))
            yield _at(place, NameKind.FILE, path[3], main, TypeName(*path.groups()))
    for word, name in reader.structs:
        yield _at(reader.place(word.start_pos or 0), NameKind.INTERFACE, str(word), name)
    for word in reader.modules:
        if word.endswith(_CONSTANTS):
            place = reader.place(word.start_pos or 0)
            yield _at(place, NameKind.INTERFACE, word.removesuffix(_CONSTANTS), main)
    for first, last, name in reader.references:
        occurrence = _at(reader.place(last.start_pos or 0), NameKind.REFERENCE, name.name, main, name)
        start = reader.place(first.start_pos or 0)
        if start.line == occurrence.span.line + 1:
            occurrence = replace(occurrence, span=replace(occurrence.span, start=(start.column or 1) - 1))
        yield occurrence
    for kind, words in ((NameKind.TYPEDEF, reader.typedefs), (NameKind.ALIAS, reader.aliases)):
        for word in words:
            yield _at(reader.place(word.start_pos or 0), kind, str(word), main)
    for message in sections_of(interface) if interface else ():
        for kind, members in ((NameKind.FIELD, message.fields), (NameKind.CONSTANT, message.constants)):
            yield from (_at(each.place, kind, each.name, message.name) for each in members if each.place)


def _at(
    place: Location, kind: NameKind, name: str, owner: TypeName, type_: TypeName | None = None
) -> Occurrence:
    start = (place.column or 1) - 1
    return Occurrence(kind, Span((place.line or 1) - 1, start, start + len(name)), name, owner, type_)
