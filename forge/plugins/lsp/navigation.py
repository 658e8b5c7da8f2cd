"""Finds the name under a cursor, its declaration and its uses."""

from __future__ import annotations

from pathlib import Path

from forge.base.distributions import EMBEDDED
from forge.interfaces.model import TypeName
from forge.plugins.lsp.index import Index
from forge.plugins.lsp.manifests import MANIFEST, PackageMention
from forge.plugins.lsp.occurrences import NameKind, Occurrence, Reading
from forge.plugins.lsp.text import Place, Span

_IN_FILE = frozenset({NameKind.FIELD, NameKind.CONSTANT, NameKind.TYPEDEF, NameKind.ALIAS})
"""The kinds of names that are local to their file."""

_START = Span(0, 0, 0)


def occurrence_at(reading: Reading, line: int, column: int) -> Occurrence | None:
    """Return the name in a definition under a cursor, or None."""
    return next((each for each in reading.occurrences if each.span.contains(line, column)), None)


def mention_at(index: Index, path: Path, line: int, column: int) -> PackageMention | None:
    """Return the package that a manifest names under a cursor, or None."""
    manifest = index.manifests.get(path)
    mentions = manifest.mentions if manifest else ()
    return next((each for each in mentions if each.span.contains(line, column)), None)


def type_of(reading: Reading, occurrence: Occurrence) -> TypeName | None:
    """Return the interface that an occurrence names, None for names that are local to their file."""
    return None if occurrence.kind in _IN_FILE else occurrence.type or reading.name


def declared_in_file(reading: Reading, occurrence: Occurrence) -> Occurrence:
    """Return the declaration of a field, constant or typedef."""
    if occurrence.kind is not NameKind.ALIAS:
        return occurrence
    return next(
        each for each in reading.occurrences if each.kind is NameKind.TYPEDEF and each.name == occurrence.name
    )


def definition(index: Index, path: Path, line: int, column: int) -> Place | None:
    """Return the declaration of the name under a cursor, or None."""
    if mention := mention_at(index, path, line, column):
        manifest_path = package_manifest(index, mention.name)
        manifest = index.manifests.get(manifest_path) if manifest_path else None
        spans = (each.span for each in manifest.mentions if each.tag == "name") if manifest else iter(())
        return Place(manifest_path, next(spans, _START)) if manifest_path else None
    reading = index.readings.get(path)
    occurrence = occurrence_at(reading, line, column) if reading else None
    if reading is None or occurrence is None:
        return None
    name = type_of(reading, occurrence)
    return _type_place(index, name) if name else Place(path, declared_in_file(reading, occurrence).span)


def references(index: Index, path: Path, line: int, column: int, *, declaration: bool) -> list[Place]:
    """Return the uses of the name under a cursor in the workspace, and with `declaration` its declaration.

    A line of a .msg, .srv or .action file without a name stands for the interface of the file.
    """
    if mention := mention_at(index, path, line, column):
        return [
            Place(manifest.path, each.span)
            for manifest in index.manifests.values()
            for each in manifest.mentions
            if each.name == mention.name and (declaration or each.tag != "name")
        ]
    reading = index.readings.get(path)
    if reading is None:
        return []
    occurrence = occurrence_at(reading, line, column)
    if occurrence is None and path.suffix == ".idl":
        return []
    if occurrence and occurrence.kind in _IN_FILE:
        in_file = declared_in_file(reading, occurrence)
        occurrences = [in_file] if declaration else []
        if in_file.kind is NameKind.TYPEDEF:
            aliases = (each for each in reading.occurrences if each.kind is NameKind.ALIAS)
            occurrences += [each for each in aliases if each.name == in_file.name]
        return [Place(path, each.span) for each in occurrences]
    name = (occurrence.type if occurrence else None) or reading.name
    declared = _type_place(index, name) if declaration else None
    places = (Place(user, use.span) for user, use in index.uses(name))
    return [*([declared] if declared else []), *places]


def package_manifest(index: Index, name: str) -> Path | None:
    """Return the package.xml of a package in the workspace, an underlay or forge; None if not found."""
    for manifest in index.manifests.values():
        if manifest.name == name:
            return manifest.path
    folders = (*(prefix / "share" / name for prefix in index.library.prefixes), EMBEDDED / name)
    return next((folder / MANIFEST for folder in folders if (folder / MANIFEST).is_file()), None)


def _type_place(index: Index, name: TypeName) -> Place | None:
    parsed = index.find_or_none(name)
    if parsed is None:
        return None
    reading = index.readings.get(parsed.source.path)
    structs = [each for each in reading.occurrences if each.kind is NameKind.INTERFACE] if reading else []
    return Place(parsed.source.path, structs[0].span if structs else _START)
