"""Renames a field, a constant or a type: its declaration, its uses in definitions, and its file."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from forge.base.errors import InterfaceError, Problem
from forge.base.frozen import frozen
from forge.base.names import TYPE_NAME
from forge.interfaces.model import TypeName
from forge.interfaces.read.declarations import read_declaration
from forge.interfaces.read.literals import ParseError
from forge.interfaces.resolve.resolution import same_output
from forge.plugins.lsp.index import Index
from forge.plugins.lsp.navigation import occurrence_at, type_of
from forge.plugins.lsp.occurrences import NameKind, Occurrence, Reading
from forge.plugins.lsp.text import Edit, Span

_CMAKE = "CMakeLists.txt"
_OWN_FOLDER = r"\$\{(?:CMAKE_CURRENT_SOURCE|CMAKE_CURRENT_LIST|PROJECT_SOURCE)_DIR\}"


@frozen
class Renaming:
    """The edits of files, and the files to rename afterwards."""

    edits: tuple[Edit, ...]
    moves: tuple[tuple[Path, Path], ...] = ()
    remark: str = ""
    """Places that the user may have to change manually."""


@frozen
class Renamable:
    """A name that can be replaced, and the part of the line that stands for it."""

    span: Span
    name: str
    file: Path | None = None
    """The file of a type, which is also renamed."""


def renamable(index: Index, path: Path, line: int, column: int) -> Renamable | None:
    """Return the name under a cursor, or None; raises InterfaceError for a type of another workspace.

    A line of a .msg, .srv or .action file without a declaration stands for the interface of the file.
    """
    reading = index.readings.get(path)
    if reading is None:
        return None
    occurrence = occurrence_at(reading, line, column)
    if occurrence and occurrence.kind in {NameKind.TYPEDEF, NameKind.ALIAS}:
        return None
    if occurrence:
        name = type_of(reading, occurrence)
        if name is None:
            return Renamable(occurrence.span, occurrence.name)
        return Renamable(occurrence.stem, name.name, _declaration(index, name).source.path)
    lines = reading.source.text.splitlines()
    if (
        path.suffix == ".idl"
        or line >= len(lines)
        or any(each.span.line == line for each in reading.occurrences)
    ):
        return None
    return Renamable(Span(line, 0, len(lines[line])), reading.name.name, path)


def rename(index: Index, path: Path, line: int, column: int, new: str) -> Renaming:
    """Return the changes that rename the name under a cursor; raises InterfaceError if that is impossible."""
    reading = index.readings.get(path)
    if reading is None or renamable(index, path, line, column) is None:
        raise InterfaceError(Problem("there is no name of a type, field or constant here"))
    occurrence = occurrence_at(reading, line, column)
    name = type_of(reading, occurrence) if occurrence else reading.name
    if name is None and occurrence:
        return _member(reading, occurrence, new)
    return _type(index, name or reading.name, new)


def _declaration(index: Index, name: TypeName) -> Reading:
    """Return the file that declares a type."""
    parsed = index.find_or_none(name)
    declared = index.readings.get(parsed.source.path) if parsed else None
    if declared is None:
        raise InterfaceError(Problem(f"'{name}' is not part of the workspace"))
    return declared


def _member(reading: Reading, occurrence: Occurrence, new: str) -> Renaming:
    constant = occurrence.kind is NameKind.CONSTANT
    try:
        read_declaration(f"int8 {new}=0" if constant else f"int8 {new}", reading.source.package)
    except ParseError as error:
        raise InterfaceError(Problem(error.message, hint=error.hint)) from None
    others = (each for each in reading.occurrences if each.owner == occurrence.owner and each != occurrence)
    if any(each.name == new and each.kind is occurrence.kind for each in others):
        raise InterfaceError(Problem(f"'{new}' is already declared in '{occurrence.owner}'"))
    return Renaming((Edit(reading.source.path, occurrence.span, new),))


def _type(index: Index, old: TypeName, new: str) -> Renaming:
    declared = _declaration(index, old)
    if not TYPE_NAME.fullmatch(new):
        hint = "use CamelCase: letters and digits, the first in upper case"
        raise InterfaceError(Problem(f"invalid interface name '{new}'", hint=hint))
    wanted, path = TypeName(old.package, old.kind, new), declared.source.path
    if index.find_or_none(wanted):
        raise InterfaceError(Problem(f"'{old.package}/{old.kind}/{new}' already exists"))
    for file, other in index.same_outputs(wanted).items():
        if file != path:
            raise InterfaceError(same_output(wanted, other, file))
    in_cmake = tuple(_in_cmake(index, declared, old.name, new))
    edits = [
        *(Edit(user, use.stem, new) for user, use in index.uses(old)),
        *_in_own_file(declared, old.name, new),
        *in_cmake,
    ]
    remark = _remark(index, path, in_cmake)
    return Renaming(tuple(dict.fromkeys(edits)), ((path, path.with_name(f"{new}{path.suffix}")),), remark)


def _in_own_file(reading: Reading, old: str, new: str) -> Iterator[Edit]:
    """Yield the names of the structs of an .idl file, such as X, X_Request and X_Constants."""
    for each in reading.occurrences:
        if each.kind is NameKind.INTERFACE and each.name.partition("_")[0] == old:
            span = replace(each.span, end=each.span.start + len(old))
            yield Edit(reading.source.path, span, new)


def _in_cmake(index: Index, reading: Reading, old: str, new: str) -> Iterator[Edit]:
    """Yield the places where the CMakeLists.txt of the package names the file."""
    manifest = index.manifest_of(reading.source.path)
    if manifest is None:
        return
    path = manifest.path.with_name(_CMAKE)
    folder, _, file = reading.source.relative.rpartition("/")
    start = rf"(?:(?<![\w/])|{_OWN_FOLDER}/){re.escape(folder)}/"
    pattern = re.compile(rf"{start}({re.escape(old)}){re.escape(file[len(old) :])}(?!\w)")
    for number, line in enumerate(index.text(path).splitlines()):
        for match in pattern.finditer(line):
            yield Edit(path, Span(number, *match.span(1)), new)


def _remark(index: Index, path: Path, edits: Sequence[Edit]) -> str:
    """Return the places where CMake files of the package may refer to a file in other ways."""
    manifest = index.manifest_of(path)
    if manifest is None:
        return ""
    folder = manifest.path.parent
    word = re.compile(rf"(?<!\w){re.escape(path.stem)}\b")
    changed = {(edit.path, edit.span.line) for edit in edits}
    places = [
        f"{file.relative_to(folder.parent)}:{number}"
        for file in sorted({*folder.rglob(_CMAKE), *folder.rglob("*.cmake")})
        for number, line in enumerate(index.text(file).splitlines(), 1)
        if word.search(line.partition("#")[0]) and (file, number - 1) not in changed
    ]
    if places:
        return f"not changed: {', '.join(places)} may also mean '{path.name}'"
    text = index.text(folder / _CMAKE)
    if edits or "rosidl_generate_interfaces" not in text or "GLOB" in text:
        return ""
    return f"not changed: '{folder.name}/{_CMAKE}' does not name '{path.name}' literally"
