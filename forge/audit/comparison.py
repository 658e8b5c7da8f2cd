"""What a package's build read, held against what forge tracks of the package; pure."""

from __future__ import annotations

import re
from dataclasses import replace
from posixpath import basename, dirname
from typing import TYPE_CHECKING

from forge.audit.accesses import Access, Kind
from forge.audit.untracked import COMPILER, LITTER, untracked
from forge.frozen import frozen
from forge.model import CONFIGURE

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Container, Iterable, Iterator, Mapping

    from forge.audit.accesses import Accesses
    from forge.audit.untracked import Machine

_IN_FULL = 3
"""Files of one folder that are named; of more, their number is told."""


@frozen
class Tracked:
    """What forge tracks of a package, in absolute paths.

    Below `folders`, by what they are, everything counts: names and contents. Below `prefixes` new names are
    noticed, and contents of `files` alone. Of the folders in `names` the names count. `ways` are folders
    that lead to any of these. `owners` says which package installed a file.
    """

    folders: Mapping[str, str]
    files: Container[str]
    names: frozenset[str]
    prefixes: Mapping[str, str]
    ways: frozenset[str]
    owners: Mapping[str, str]
    is_source: Callable[[str, str], bool]
    """Tell if a path below a folder of sources, which comes first, counts as a source."""


@frozen
class Disk:
    """What is to be asked of the file system.

    Where a path really is, the first part of it that is missing, and whether it is a folder.
    """

    real: Callable[[str], str]
    first_missing: Callable[[str], str]
    is_folder: Callable[[str], bool]


@frozen
class Finding:
    """An access that nothing explains."""

    package: str
    step: str
    path: str
    kind: Kind
    program: str
    owner: str = ""


SOURCES = "sources"


def findings(
    package: str, step: str, accesses: Accesses, tracked: Tracked, around: tuple[Machine, Disk]
) -> tuple[Finding, ...]:
    """Return the accesses of a step that forge neither tracks nor leaves out on purpose, sorted by path."""
    found: dict[str, Finding] = {}
    for (path, kind), program in accesses.found.items():
        access = Access(path, _what_counts(kind, program, step), program)
        if _is_made(path, accesses.made) or explain(access, tracked, *around):
            continue
        # One line for each path, the weightiest kind.
        if path not in found or _WEIGHT[access.kind] < _WEIGHT[found[path].kind]:
            found[path] = Finding(package, step, path, access.kind, program, tracked.owners.get(path, ""))
    return tuple(found[path] for path in sorted(found))


_WEIGHT = {kind: weight for weight, kind in enumerate(Kind)}


def _what_counts(kind: Kind, program: str, step: str) -> Kind:
    """Return what an access comes to, by who it is.

    A compiler reports all headers that it used; others it opened for a __has_include, which is about names.
    Nobody reports what CMake compiles to find something out.
    """
    if kind is Kind.READ and step != CONFIGURE and COMPILER.match(program):
        return Kind.SEEN
    return kind


def explain(access: Access, tracked: Tracked, machine: Machine, disk: Disk) -> str:
    """Return why an access needs no further thought; '' when nothing says so."""
    path, kind = access.path, access.kind
    if kind is Kind.SEEN and disk.is_folder(path):
        access = Access(path, Kind.FOLDER, access.program)
    said = _explain(access, tracked, machine)
    if not said and kind is Kind.MISSED:
        missing = disk.first_missing(path)
        if not missing or dirname(missing) in tracked.names:
            return NAMES
        said = _explain(Access(missing, kind, access.program), tracked, machine)
    if not said:
        real = disk.real(path)
        said = _explain(Access(real, access.kind, access.program), tracked, machine) if real != path else ""
    return said


NAMES = "names in a folder"


def _explain(access: Access, tracked: Tracked, machine: Machine) -> str:
    path, kind = access.path, access.kind
    if path in tracked.files:
        return "recorded"
    said = _by_folder(access, tracked)
    if said:
        return said
    if kind is not Kind.READ and path in tracked.ways:
        return NAMES
    if kind in _ABOUT_NAMES and (path in tracked.names or dirname(path) in tracked.names):
        return NAMES
    row = untracked(access, machine)
    if row is not None:
        return row.what
    return LITTER.what if _BYTECODE.search(path) or _source_folder(path, tracked) else ""


_BYTECODE = re.compile(r"/__pycache__(/|$)|\.pyc$")


def _by_folder(access: Access, tracked: Tracked) -> str:
    """Return why everything in one of the folders above a path counts, or its names; else ''."""
    for folder in _upwards(access.path):
        if folder in tracked.folders:
            what = tracked.folders[folder]
            return what if what != SOURCES or tracked.is_source(folder, access.path) else ""
        if folder in tracked.prefixes and access.kind in _ABOUT_NAMES:
            return tracked.prefixes[folder]
    return ""


def _source_folder(path: str, tracked: Tracked) -> bool:
    """Tell if a path lies in the package, whether or not it counts as a source."""
    return any(tracked.folders.get(folder) == SOURCES for folder in _upwards(path))


_ABOUT_NAMES = frozenset({Kind.MISSED, Kind.LISTED, Kind.FOLDER})


def _upwards(path: str) -> Iterator[str]:
    while True:
        yield path
        if path == "/":
            return
        path = dirname(path)


def _is_made(path: str, made: Collection[str]) -> bool:
    return any(folder in made for folder in _upwards(path))


def report(found: Iterable[Finding], packages: int) -> tuple[str, ...]:
    """Return the lines of a report: findings by package, step and folder, with advice; last a summary."""
    groups: dict[tuple[Finding, str], list[str]] = {}
    for one in found:
        groups.setdefault((replace(one, path=""), dirname(one.path)), []).append(one.path)
    lines = [line for (one, folder), paths in groups.items() for line in _group(one, folder, paths)]
    number = sum(map(len, groups.values()))
    concerned = len({one.package for one, _ in groups})
    if not number:
        lines.append(f"audit: {_counted(packages, 'package')}, nothing unexplained")
    else:
        uses = "uses" if concerned == 1 else "use"
        of_them = f"of {_counted(packages, 'package')}, {concerned} {uses} {_counted(number, 'path')}"
        lines.append(f"audit: {of_them} that forge does not track")
    return tuple(lines)


def _group(one: Finding, folder: str, paths: list[str]) -> Iterator[str]:
    """Yield the lines about paths of one folder."""
    by = f"{one.step} step, by {one.program}" if one.program else f"{one.step} step"
    if len(paths) > _IN_FULL:
        paths = [f"{len(paths)} names in {folder}, such as {basename(paths[0])}"]
    yield from (f"{one.package}: {one.kind.value} {path} ({by})" for path in paths)
    yield f"  hint: {_advice(one.step, one.kind, one.owner)}"


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _advice(step: str, kind: Kind, owner: str) -> str:
    """Return what the author of a package can do about an access."""
    if owner:
        return f"add <depend>{owner}</depend> to package.xml"
    if kind in _ABOUT_NAMES:
        return "forge does not notice when something appears there; build with --force then"
    if kind is Kind.RAN:
        return "find the program with find_program(), and forge notices when it changes"
    return _ADVICE.get(step, "keep the file in the package, or build with --force when it changes")


_ADVICE = {
    "cmake": "set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS FILE) lets forge track it",
    "build": "add_custom_command(... DEPENDS FILE) lets forge track it",
    "install": "install(FILES FILE ...) lets forge track it",
}
