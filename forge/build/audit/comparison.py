"""Compare the files that a package's build read with the tracked inputs of the package; pure."""

from __future__ import annotations

import re
from dataclasses import replace
from posixpath import basename, dirname
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.base.text import counted
from forge.build.audit.accesses import Access, AccessKind
from forge.build.audit.ignored_inputs import COMPILER, LITTER, untracked
from forge.build.tasks import StepKind

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Container, Iterable, Iterator, Mapping

    from forge.build.audit.accesses import Accesses
    from forge.build.audit.ignored_inputs import Machine

_MAX_LISTED = 3
"""The number of files of one folder that are listed; of more, only the count is reported."""


@frozen
class Tracked:
    """The tracked inputs of a package, as absolute paths.

    `folders` maps folders that are tracked completely, names and contents, to their descriptions. In
    `prefixes`, new names are tracked, and contents of `files` only. In the folders in `names`, names are
    tracked. `parents` are the parent folders of all these. `owners` maps a file to the package that installed
    it.
    """

    folders: Mapping[str, str]
    files: Container[str]
    names: frozenset[str]
    prefixes: Mapping[str, str]
    parents: frozenset[str]
    owners: Mapping[str, str]
    is_source: Callable[[str, str], bool]
    """Returns True if a path (second) below a source folder (first) is a source."""


@frozen
class Disk:
    """Queries to the file system: the resolved path, the first missing parent, whether it is a folder."""

    real: Callable[[str], str]
    first_missing: Callable[[str], str]
    is_folder: Callable[[str], bool]


@frozen
class Finding:
    """An access to an untracked path."""

    package: str
    step: StepKind
    path: str
    kind: AccessKind
    program: str
    owner: str = ""


SOURCES = "sources"


def findings(
    package: str, step: StepKind, accesses: Accesses, tracked: Tracked, environment: tuple[Machine, Disk]
) -> tuple[Finding, ...]:
    """Return the accesses of a step that forge neither tracks nor ignores on purpose, sorted by path."""
    found: dict[str, Finding] = {}
    for (path, kind), program in accesses.found.items():
        access = Access(path, _effective_kind(kind, program, step), program)
        if _is_made(path, accesses.made) or explain(access, tracked, *environment):
            continue
        # Report each path once, with the most significant kind.
        if path not in found or _WEIGHT[access.kind] < _WEIGHT[found[path].kind]:
            found[path] = Finding(package, step, path, access.kind, program, tracked.owners.get(path, ""))
    return tuple(found[path] for path in sorted(found))


_WEIGHT = {kind: weight for weight, kind in enumerate(AccessKind)}


def _effective_kind(kind: AccessKind, program: str, step: StepKind) -> AccessKind:
    """Return the effective kind of an access.

    A compiler reports all headers that it used; it opens others only for __has_include, which depends on
    names. This does not apply to CMake's compile checks, whose headers are not reported.
    """
    if kind is AccessKind.READ and step is not StepKind.CONFIGURE and COMPILER.match(program):
        return AccessKind.SEEN
    return kind


def explain(access: Access, tracked: Tracked, machine: Machine, disk: Disk) -> str:
    """Return why an access is not a finding, or '' if it is one."""
    path, kind = access.path, access.kind
    if kind in _OF_FOLDERS and disk.is_folder(path):
        access = Access(path, _OF_FOLDERS[kind], access.program)
    reason = _explain(access, tracked, machine)
    if not reason and kind is AccessKind.MISSED:
        missing = disk.first_missing(path)
        if not missing or dirname(missing) in tracked.names:
            return NAMES
        reason = _explain(Access(missing, kind, access.program), tracked, machine)
    if not reason:
        real = disk.real(path)
        reason = _explain(Access(real, access.kind, access.program), tracked, machine) if real != path else ""
    return reason


_OF_FOLDERS = {AccessKind.SEEN: AccessKind.FOLDER, AccessKind.READ: AccessKind.LISTED}
"""The meaning of these if the path is a folder; CMake 4.4 opens folders to list without O_DIRECTORY."""

NAMES = "names in a folder"


def _explain(access: Access, tracked: Tracked, machine: Machine) -> str:
    path, kind = access.path, access.kind
    if path in tracked.files:
        return "recorded"
    reason = _by_folder(access, tracked)
    if reason:
        return reason
    if kind is not AccessKind.READ and path in tracked.parents:
        return NAMES
    if kind in _ABOUT_NAMES and (path in tracked.names or dirname(path) in tracked.names):
        return NAMES
    row = untracked(access, machine)
    if row is not None:
        return row.what
    return LITTER.what if _BYTECODE.search(path) or _source_folder(path, tracked) else ""


_BYTECODE = re.compile(r"/__pycache__(/|$)|\.pyc$")


def _by_folder(access: Access, tracked: Tracked) -> str:
    """Return the description of a parent folder whose contents or names are tracked, or ''."""
    for folder in _upwards(access.path):
        if folder in tracked.folders:
            what = tracked.folders[folder]
            return what if what != SOURCES or tracked.is_source(folder, access.path) else ""
        if folder in tracked.prefixes and access.kind in _ABOUT_NAMES:
            return tracked.prefixes[folder]
    return ""


def _source_folder(path: str, tracked: Tracked) -> bool:
    """Return True if a path is in the package, whether or not it is a source."""
    return any(tracked.folders.get(folder) == SOURCES for folder in _upwards(path))


_ABOUT_NAMES = frozenset({AccessKind.MISSED, AccessKind.LISTED, AccessKind.FOLDER})


def _upwards(path: str) -> Iterator[str]:
    while True:
        yield path
        if path == "/":
            return
        path = dirname(path)


def _is_made(path: str, made: Collection[str]) -> bool:
    return any(folder in made for folder in _upwards(path))


def report(found: Iterable[Finding], packages: int) -> tuple[str, ...]:
    """Return the lines of a report: findings by package, step and folder with hints, and a summary."""
    groups: dict[tuple[Finding, str], list[str]] = {}
    for finding in found:
        groups.setdefault((replace(finding, path=""), dirname(finding.path)), []).append(finding.path)
    lines = [line for (finding, folder), paths in groups.items() for line in _group(finding, folder, paths)]
    number = sum(map(len, groups.values()))
    affected = len({finding.package for finding, _ in groups})
    if not number:
        lines.append(f"audit: {counted(packages, 'package')}, no unexpected inputs")
    else:
        uses = "uses" if affected == 1 else "use"
        of_them = f"{affected} of {counted(packages, 'package')} {uses} {counted(number, 'path')}"
        lines.append(f"audit: {of_them} that forge does not track")
    return tuple(lines)


def _group(finding: Finding, folder: str, paths: list[str]) -> Iterator[str]:
    """Yield the lines for the paths of one folder."""
    step = f"{finding.step.value} step"
    by = f"{step}, by {finding.program}" if finding.program else step
    if len(paths) > _MAX_LISTED:
        paths = [f"{len(paths)} names in {folder}, such as {basename(paths[0])}"]
    yield from (f"{finding.package}: {finding.kind.value} {path} ({by})" for path in paths)
    yield f"  hint: {_advice(finding.step, finding.kind, finding.owner)}"


def _advice(step: StepKind, kind: AccessKind, owner: str) -> str:
    """Return a hint for the author of the package."""
    if owner:
        return f"add <depend>{owner}</depend> to package.xml"
    if kind in _ABOUT_NAMES:
        return "forge cannot detect new files there; after adding one, rebuild with --force"
    if kind is AccessKind.RAN:
        return "find the program with find_program(), and forge notices when it changes"
    return _ADVICE.get(step, "keep the file in the package, or build with --force when it changes")


_ADVICE = {
    StepKind.CONFIGURE: "set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS FILE) lets forge "
    "track it",
    StepKind.BUILD: "add_custom_command(... DEPENDS FILE) lets forge track it",
    StepKind.INSTALL: "install(FILES FILE ...) lets forge track it",
}
