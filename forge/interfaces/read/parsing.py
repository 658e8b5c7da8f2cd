"""Parse a .msg, .srv, .action or .idl file to an interface with full but unchecked type names."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import zip_longest
from pathlib import PurePosixPath
from typing import Any

from forge.base.errors import InterfaceError, Location, Problem, raise_if_any
from forge.base.extensions import FORMATS, absent, find
from forge.base.frozen import frozen
from forge.base.names import TYPE_NAME, python_attribute
from forge.interfaces.model import (
    HIDDEN_MEMBER,
    SECTIONS,
    Constant,
    Field,
    Interface,
    Message,
    Primitive,
    Source,
    String,
    TypeName,
    interface_of,
    sections_of,
)
from forge.interfaces.read.declarations import Declaration, read_declaration
from forge.interfaces.read.literals import ParseError, read_value

ENDINGS = ("msg", "srv", "action", "idl")
"""The file name extensions of definitions."""

_BRACKET = re.compile(r"\[([^,\]]*)(\]|,|\Z)")
"""A bracket up to ']', ',' or the end of the comment; it is a unit only if it ends with ']'."""

_BYTE_ORDER_MARK = "\ufeff"
_SEPARATOR = "---"
_SEPARATOR_RULES = {
    1: "must not contain '---'",
    2: "must contain exactly one '---'",
    3: "must contain exactly two '---'",
}


@frozen
class Parsed:
    """An interface and the file that it was read from."""

    source: Source
    interface: Interface


def parse_all(sources: Iterable[Source]) -> tuple[Parsed, ...]:
    """Parse several files; raises InterfaceError with the problems of all of them."""
    results: list[Parsed] = []
    problems: list[Problem] = []
    for source in sources:
        try:
            interface = parse(source)
        except InterfaceError as error:
            problems += error.problems
            continue
        results.append(Parsed(source, interface))
    raise_if_any(problems, InterfaceError)
    return tuple(results)


def parse(source: Source) -> Interface:
    """Parse one file; a type name without a package refers to the package of the file.

    Raises InterfaceError with all problems of the file, sorted by line.
    """
    if source.relative.endswith(".idl"):
        reader = read_idl(source)
        raise_if_any(sorted(reader.problems, key=lambda problem: problem.position), InterfaceError)
        interface: Interface = reader.interface()
        return interface
    interface, problems = parse_leniently(source)
    raise_if_any(problems, InterfaceError)
    return interface


def read_idl(source: Source) -> Any:
    """Return what an .idl file contains, a `FileReader` of the plugin 'idl'.

    Raises InterfaceError with the first syntax error, and without the plugin.
    """
    if problem := absent(FORMATS, "idl", "format"):
        raise InterfaceError(replace(problem, location=Location(source.path)))
    return find(FORMATS, "idl", "format").read_idl(source)


def parse_leniently(source: Source) -> tuple[Interface, list[Problem]]:
    """Return the valid parts of a .msg, .srv or .action file, and all problems, sorted by line."""
    name = type_name(source)
    lines = lines_of(source)
    sections = list(split_sections(lines))
    problems = _outline_problems(source, name, lines, len(sections))
    messages = [
        _read_section(replace(name, name=name.name + suffix), source, section or [], problems)
        for suffix, section in zip_longest(SECTIONS[name.kind], sections[: len(SECTIONS[name.kind])])
    ]
    # Problems of the whole file come first.
    problems.sort(key=lambda problem: (problem.location.line or 0) if problem.location else 0)
    return interface_of(name, messages), problems


def type_name(source: Source) -> TypeName:
    """Return the type name of a .msg, .srv or .action file: package, extension, stem."""
    path = PurePosixPath(source.relative)
    return TypeName(source.package, path.suffix.removeprefix("."), path.stem)


@frozen
class Line:
    """A line of a file; `text` has a space instead of each tab, which preserves columns."""

    number: int
    text: str
    source: str

    def place(self, path: object, offset: int = 0) -> Location:
        """Return the position of an offset in the line."""
        return Location(str(path), self.number, offset + 1, self.source)


def lines_of(source: Source) -> list[Line]:
    text = source.text.removeprefix(_BYTE_ORDER_MARK)
    return [Line(n, line.replace("\t", " "), line) for n, line in enumerate(text.splitlines(), 1)]


def split_sections(lines: list[Line]) -> Iterator[list[Line]]:
    """Yield the lines of each section, without the separators."""
    section: list[Line] = []
    for line in lines:
        if line.text == _SEPARATOR:
            yield section
            section = []
        else:
            section.append(line)
    yield section


def _outline_problems(source: Source, name: TypeName, lines: list[Line], count: int) -> list[Problem]:
    problems = []
    if source.text.startswith(_BYTE_ORDER_MARK):
        message = "the file starts with a byte-order mark, which ROS's own generators reject"
        hint = "save it as UTF-8 without a byte-order mark"
        problems.append(Problem(message, Location(source.path, 1), hint))
    if not TYPE_NAME.fullmatch(name.name):
        message = f"invalid interface name '{name.name}'"
        hint = "use CamelCase: letters and digits, the first in upper case"
        problems.append(Problem(message, Location(source.path), hint))
    section_count = len(SECTIONS[name.kind])
    separators = [line for line in lines if line.text.startswith(_SEPARATOR)]
    if count != section_count and all(line.text == _SEPARATOR for line in separators):
        surplus = separators[section_count - 1 :] if count > section_count else []
        place = surplus[0].place(source.path) if surplus else Location(source.path)
        problems.append(Problem(f"a .{name.kind} file {_SEPARATOR_RULES[section_count]}", place))
    return problems


def _read_section(name: TypeName, source: Source, lines: list[Line], problems: list[Problem]) -> Message:
    """Return the message in the lines of a section, and append to `problems`."""

    def report(line: Line, error: ParseError) -> None:
        problems.append(Problem(error.message, line.place(source.path, error.offset), error.hint))

    heading = next((n for n, line in enumerate(lines) if not line.text.startswith("#")), len(lines))
    # Each declaration with the comments before it, after it, and indented below it.
    entries: list[tuple[Line, Declaration, list[str]]] = []
    collected: list[str] = []
    broken = False
    for line in lines[heading:]:
        code, mark, comment = line.text.partition("#")
        if not code.strip():
            if mark and not code:
                collected.append(mark + comment)
            elif mark and entries and not broken:  # comments of an invalid declaration are dropped with it
                entries[-1][2].append(mark + comment)
            continue
        if mark:
            collected.append(mark + comment)
        try:
            entries.append((line, read_declaration(code.rstrip(), name.package), collected))
            broken = False
        except ParseError as error:
            report(line, error)
            broken = True
        collected = []
    fields: dict[str, Field] = {}
    constants: dict[str, Constant] = {}
    for line, declared, comments in entries:
        if earlier := (constants if declared.constant else fields).get(declared.name):
            first = earlier.place.line if earlier.place else None
            kind = "constant" if declared.constant else "field"
            message = f"{kind} '{declared.name}' is already declared on line {first}"
            report(line, ParseError(message, offset=declared.name_offset))
            continue
        try:
            value = None if declared.value is None else read_value(declared.value, declared.type)
        except ParseError as error:
            report(line, error.shifted(declared.value_offset))
            continue
        doc, unit = _read_comments(comments)
        place = line.place(source.path)
        if not declared.constant:
            fields[declared.name] = Field(declared.name, declared.type, value, doc, unit, place)
        elif value is not None and isinstance(declared.type, Primitive | String):
            constants[declared.name] = Constant(declared.name, declared.type, value, doc, place)
    if [(f.name, f.type) for f in fields.values()] == [(HIDDEN_MEMBER, Primitive("uint8"))]:
        fields.clear()
    doc, _ = _read_comments(line.text for line in lines[:heading])
    return Message(name, tuple(fields.values()), tuple(constants.values()), doc)


def _read_comments(lines: Iterable[str]) -> tuple[tuple[str, ...], str | None]:
    """Return the documentation and the unit in comment lines, which include their '#'.

    As in rosidl_adapter: the contents of brackets are the unit and are removed from the text, unless there
    are several pairs of brackets.
    """
    texts = [line.lstrip("#").rstrip() for line in lines]
    block_text, unit = "\n".join(texts), None
    brackets = [bracket for bracket in _BRACKET.finditer(block_text) if bracket[1] and bracket[2] == "]"]
    if len(brackets) == 1:
        unit = brackets[0][1]
        # A bracket after blanks that span several lines is in no single line: the text is kept.
        written = block_text[len(block_text[: brackets[0].start()].rstrip()) : brackets[0].end()]
        texts = [text.replace(written, "").rstrip() for text in texts]
    if len(texts) == 1:
        return ((texts[0].lstrip(),) if texts[0] else ()), unit
    squeezed = [text for number, text in enumerate(texts) if text or (number and texts[number - 1])]
    block = "\n".join(squeezed).strip("\n")
    return tuple(textwrap.dedent(block).split("\n")) if block else (), unit


def python_keywords(interfaces: Iterable[Interface]) -> Iterator[Problem]:
    """Yield a warning for each field that is named like a keyword of Python."""
    for field in (field for each in interfaces for message in sections_of(each) for field in message.fields):
        attribute = python_attribute(field.name)
        if attribute != field.name:
            text = f"field name '{field.name}' is a keyword of Python, where it becomes '{attribute}'"
            place = field.place
            match = re.search(rf"\b{field.name}\b", place.source) if place and place.source else None
            if place and match:
                place = replace(place, column=match.start() + 1)
            yield Problem(text, place, f"rename it, for example to '{field.name}_value'")
