"""Find and remove the files that forge and colcon created in a workspace, and nothing else.

Build folders, and prefixes of an isolated install, are removed as a whole. In a merged install, the records
and install manifests determine which files belong to a package.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.ament_index import INDEX
from forge.base.errors import Problem
from forge.base.files import delete_tree, listed_paths
from forge.base.frozen import frozen
from forge.base.layout import (
    BACKUP_DIR,
    BUILD_RESULT,
    COMPILE_COMMANDS,
    IGNORE_MARK,
    INSTALL_STATE_FILE,
    INSTALLED_LISTS_DIR,
    INSTALLED_STATES_DIR,
    LAYOUT_MARKER,
    SCRATCH_DIR,
    TEST_RESULT,
    TEST_SCRATCH_DIR,
)
from forge.base.text import listed
from forge.build.build_dir import set_aside_path
from forge.build.install_manifests import MANIFESTS
from forge.build.markers import remove_file
from forge.build.prefix import leftover_backups
from forge.environment.prefixes import PACKAGES

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping

    from forge.base.layout import Layout
    from forge.build.model import BuildRecord

BASES = ("build", "install", "log")

_BUILD_MARKS = (
    "CMakeCache.txt",
    "cmake_args.last",
    BUILD_RESULT,
    TEST_RESULT,
    "colcon_command_prefix_build.sh",
    SCRATCH_DIR,
    TEST_SCRATCH_DIR,
    "install_manifest.txt",
)
_BUILD_FILES = (".built_by", IGNORE_MARK, COMPILE_COMMANDS, "forge_*", ".forge_*")
_INSTALL_FILES = (
    *(LAYOUT_MARKER, IGNORE_MARK, INSTALL_STATE_FILE, "_local_setup_util_*.py"),
    *("setup.*", "local_setup.*", BACKUP_DIR, INSTALLED_LISTS_DIR),
)
_LOG_FILES = (IGNORE_MARK, "latest", "latest_*")
_RUN = re.compile(r"[a-z][a-z_-]*_\d{4}-\d\d-\d\d_\d\d-\d\d-\d\d(_\d+)?")


@frozen
class Removable:
    """Files, links and folders below `base` to remove together; `label` describes them.

    `records` are folders with forge's own data about them, which is removed with them.
    """

    label: str
    base: Path
    paths: tuple[Path, ...]
    records: tuple[Path, ...] = ()


def built_packages(layout: Layout, records: Mapping[str, BuildRecord]) -> frozenset[str]:
    """Return the packages with files in the build or install folder."""
    built = {entry.name for entry in _folders(layout.build) if _is_build(entry)}
    if layout.merged:
        installed = {entry.name for entry in _entries(layout.install / PACKAGES) if entry.is_file()}
    else:
        installed = {entry.name for entry in _folders(layout.install) if _is_prefix(entry)}
    return frozenset(records) | built | installed


def package_removables(name: str, layout: Layout, records: Mapping[str, BuildRecord]) -> Iterator[Removable]:
    """Yield the build folder of a package and its installed files."""
    build = layout.build_dir(name)
    files = _installed(name, layout, records) if layout.merged else ()
    if os.path.lexists(build) and (name in records or _is_build(build)):
        beside = (layout.build / INSTALLED_STATES_DIR / name, set_aside_path(build))
        yield Removable(
            f"build folder of '{name}'", layout.build, (build,), tuple(filter(Path.exists, beside))
        )
    prefix = layout.prefix(name)
    lists = tuple(filter(Path.exists, (layout.install / INSTALLED_LISTS_DIR / f"{name}.json",)))
    if layout.merged and files:
        count = len(files)
        label = f"{count} installed file{'' if count == 1 else 's'} of '{name}'"
        yield Removable(label, layout.install, (*files, *lists))
    elif not layout.merged and os.path.lexists(prefix):
        yield Removable(f"prefix of '{name}'", layout.install, (prefix,), lists)
    if aside := leftover_backups(name, layout):
        yield Removable(f"backup of '{name}' from a killed build", layout.install, tuple(aside))


def workspace_removables(
    layout: Layout, records: Mapping[str, BuildRecord], bases: Iterable[str]
) -> Iterator[Removable]:
    """Yield everything that was created below the chosen bases, packages first."""
    names = sorted(built_packages(layout, records))
    for base, chosen, files in (
        ("build", layout.build, _BUILD_FILES),
        ("install", layout.install, _INSTALL_FILES),
    ):
        if base in bases:
            found = [removable for name in names for removable in package_removables(name, layout, records)]
            yield from (removable for removable in found if removable.base == chosen)
            yield from _of_targets(base, chosen)
            yield from _own_files(base, chosen, files)
    if "log" in bases and layout.logs is not None and (layout.logs / IGNORE_MARK).exists():
        runs = tuple(entry for entry in _folders(layout.logs) if _RUN.fullmatch(entry.name))
        if runs:
            yield Removable(f"logs of {len(runs)} run{'' if len(runs) == 1 else 's'}", layout.logs, runs)
        yield from _own_files("log", layout.logs, _LOG_FILES)


def remove(removables: Iterable[Removable]) -> None:
    """Remove everything, and folders that become empty; links are removed, not followed."""
    bases = []
    for removable in removables:
        bases.append(removable.base)
        for path in (*removable.paths, *removable.records):
            if path.is_dir() and not path.is_symlink():
                delete_tree(path)
            else:
                remove_file(path, removable.base)
    for base in dict.fromkeys(bases):
        if base.is_dir() and not base.is_symlink() and not any(base.iterdir()):
            base.rmdir()


def remaining_entries(layout: Layout, bases: Iterable[str]) -> tuple[Path, ...]:
    """Return the remaining entries of the bases, which neither forge nor colcon created."""
    folders = {"build": layout.build, "install": layout.install, "log": layout.logs}
    chosen = (folder for base in bases if (folder := folders[base]) is not None)
    return tuple(entry for folder in chosen for entry in _entries(folder))


def _own_files(base_name: str, base: Path, patterns: Iterable[str]) -> Iterator[Removable]:
    """Yield the files that belong to no package: markers, scripts, journals."""
    found = tuple(path for pattern in patterns for path in sorted(base.glob(pattern)))
    if found:
        yield Removable(f"forge's own files in '{base_name}'", base, found)


def _of_targets(base_name: str, base: Path) -> Iterator[Removable]:
    """Yield the folders of other platforms, of which each has the markers of a build or install folder."""
    marker = ".built_by" if base_name == "build" else LAYOUT_MARKER
    for folder in _folders(base):
        if (folder / marker).is_file():
            yield Removable(f"{base_name} folder for '{folder.name}'", base, (folder,))


def _installed(name: str, layout: Layout, records: Mapping[str, BuildRecord]) -> tuple[Path, ...]:
    """Return the files in a merged install that belong to this package only."""
    found = set(records[name].files) if name in records else set()
    for manifest in MANIFESTS:
        found.update(listed_paths(layout.build_dir(name) / manifest))
    share = layout.install / "share" / name
    own = [*share.glob("package.*"), *share.glob("hook/*"), layout.install / PACKAGES / name]
    found.update(map(str, (*own, *(layout.install / INDEX).glob(f"*/{name}"))))
    for record in (record for other, record in records.items() if other != name):
        found.difference_update(record.files)
    inside = [Path(path) for path in found if Path(path).is_relative_to(layout.install)]
    compiled = [cached for path in inside if path.suffix == ".py" for cached in _bytecode(path)]
    return tuple(sorted({path for path in (*inside, *compiled) if os.path.lexists(path)}))


def _bytecode(path: Path) -> Iterator[Path]:
    return (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc")


def _is_build(folder: Path) -> bool:
    return any((folder / mark).exists() for mark in _BUILD_MARKS)


def _is_prefix(folder: Path) -> bool:
    name = folder.name
    marks = (PACKAGES / name, INDEX / "packages" / name, Path("share") / name / "package.xml")
    return any((folder / mark).exists() for mark in marks)


def _folders(base: Path) -> Iterator[Path]:
    return (entry for entry in _entries(base) if entry.is_dir() and not entry.name.startswith("."))


def _entries(base: Path) -> list[Path]:
    return sorted(base.iterdir()) if base.is_dir() else []


def stale_package_warnings(
    records: Mapping[str, BuildRecord], names: Collection[str], layout: Layout
) -> Iterator[Problem]:
    """Yield a problem for packages removed from the workspace whose installed files may still be found.

    `names` are the discovered packages. A package that was merely not discovered, for example because of
    '--base-paths', is not removed: its folder exists and is not ignored.
    """
    gone = sorted(
        name
        for name, record in records.items()
        if name not in names and record.complete and is_removed_package(Path(record.inputs.options[0]))
    )
    if gone:
        verb, possessive = ("is", "its") if len(gone) == 1 else ("are", "their")
        message = f"{listed(gone)} {verb} no longer in the workspace, but {possessive} files are still in"
        hint = "remove them: forge clean stale"
        yield Problem(f"{message} '{layout.install}', where other packages may find them", hint=hint)


def is_removed_package(source: Path) -> bool:
    """Return True if a folder no longer contains a package, or is ignored."""
    if not (source / "package.xml").is_file():
        return not (source / "CMakeLists.txt").is_file() and not (source / "setup.py").is_file()
    return any(
        (folder / marker).exists()
        for folder in (source, *source.parents)
        for marker in (IGNORE_MARK, "AMENT_IGNORE")
    )
