"""Documentation of the name under a cursor, as Markdown: comments, declarations and serialized sizes."""

from __future__ import annotations

import os
from pathlib import Path

from forge.base.errors import ForgeError, InterfaceError
from forge.interfaces.model import Constant, Field, TypeName, sections_of
from forge.interfaces.notation import kind_of, type_text, value_text
from forge.interfaces.read.parsing import Parsed
from forge.interfaces.resolve.resolution import nested_messages
from forge.interfaces.wire.sizes import SizeCalculator
from forge.plugins.lsp.index import Index
from forge.plugins.lsp.manifests import read_manifest
from forge.plugins.lsp.navigation import (
    declared_in_file,
    mention_at,
    occurrence_at,
    package_manifest,
    type_of,
)
from forge.plugins.lsp.occurrences import NameKind, Occurrence, Reading

_MOST_LINES = 40
"""The maximum number of declarations of a type that are shown."""


def hover(index: Index, path: Path, line: int, column: int) -> str | None:
    """Return the documentation of the name under a cursor, or None."""
    if mention := mention_at(index, path, line, column):
        return _package(index, mention.name)
    reading = index.readings.get(path)
    occurrence = occurrence_at(reading, line, column) if reading else None
    if reading is None or occurrence is None:
        return None
    if occurrence.kind in {NameKind.TYPEDEF, NameKind.ALIAS}:
        declared = declared_in_file(reading, occurrence)
        return _code([reading.source.text.splitlines()[declared.span.line].strip()])
    name = type_of(reading, occurrence)
    return _interface(index, name) if name else _member(index, reading, occurrence)


def _interface(index: Index, name: TypeName) -> str | None:
    parsed = index.find_or_none(name)
    if parsed is None:
        return None
    calculator = _calculator(index, parsed)
    parts = [f"**{name}** ({kind_of(name)})"]
    for section in sections_of(parsed.interface):
        lines = [*map(_declared, section.constants), *map(_declared, section.fields)]
        if len(lines) > _MOST_LINES:
            lines[_MOST_LINES:] = ["..."]
        parts += ["\n".join(section.doc)] if section.doc else []
        parts += [_code(lines)] if lines else []
        if calculator:
            size = calculator.of(section)
            what = section.name.name.removeprefix(name.name).strip("_").lower() or "serialized"
            parts.append(f"{what.capitalize()}: {_bytes(size.min_size, size.max_size)}")
    return "\n\n".join(parts)


def _member(index: Index, reading: Reading, occurrence: Occurrence) -> str | None:
    sections = sections_of(reading.interface) if reading.interface else ()
    section = next((each for each in sections if each.name == occurrence.owner), None)
    if reading.interface is None or section is None:
        return None
    members: tuple[Field | Constant, ...] = (*section.fields, *section.constants)
    member = next((each for each in members if each.name == occurrence.name), None)
    if member is None:
        return None
    parts = [_code([_declared(member)])]
    parts += ["\n".join(member.doc)] if member.doc else []
    if isinstance(member, Field):
        parts += [f"Unit: {member.unit}"] if member.unit else []
        if calculator := _calculator(index, Parsed(reading.source, reading.interface)):
            size = calculator.of(section).members[section.fields.index(member)]
            offset = f"at byte {size.offset}" if size.fixed else f"at byte {size.offset} or later"
            parts.append(f"Serialized: {_bytes(size.min_size, size.max_size)}, {offset}")
    return "\n\n".join(parts)


def _calculator(index: Index, parsed: Parsed) -> SizeCalculator | None:
    """Return a calculator with all nested messages; None if one is unknown."""
    try:
        return SizeCalculator(nested_messages(parsed, index))
    except InterfaceError:
        return None


def _bytes(smallest: int, largest: int | None) -> str:
    if largest is None:
        return f"{smallest} bytes or more"
    return f"{smallest} bytes" if smallest == largest else f"{smallest} to {largest} bytes"


def _declared(member: Field | Constant) -> str:
    """Return a declaration in the notation of .msg files."""
    text = type_text(member.type, "")
    declaration = f"{text.word}{text.suffix} {member.name}"
    if isinstance(member, Field):
        return declaration if member.default is None else f"{declaration} {value_text(member.default)}"
    return f"{declaration}={value_text(member.value)}"


def _code(lines: list[str]) -> str:
    return "\n".join(("```", *lines, "```"))


def _package(index: Index, name: str) -> str | None:
    path = package_manifest(index, name)
    if path is None:
        return f"**{name}** is not in the workspace, its underlays or forge: a system dependency, or missing"
    reading = index.manifests.get(path)
    if reading is None:
        try:
            reading = read_manifest(path, path.read_text(encoding="utf-8", errors="replace"), os.environ)
        except (OSError, ForgeError):
            return None
    if reading.manifest is None:
        return f"**{name}**\n\n{path.parent}"
    return f"**{name}** {reading.manifest.version}\n\n{reading.manifest.description}\n\n{path.parent}"
