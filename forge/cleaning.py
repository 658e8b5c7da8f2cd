"""What forge and colcon made in a workspace, and nothing else: to be shown, then removed.

Whole folders are a package's build folder and, where each has its own, its prefix. In a merged install the
records and lists of what each package installed tell its files from those of others.
"""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from forge.ament_index import INDEX
from forge.build.build_dir import set_aside
from forge.build.installed_states import INSTALLED
from forge.fallback import put_aside
from forge.files import listed_paths
from forge.folders import MANIFESTS
from forge.frozen import frozen
from forge.prefixes import LAYOUT_MARKER, PACKAGES
from forge.results import BEFORE, remove_file

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from forge.layout import Layout
    from forge.model import Record

BASES = ("build", "install", "log")

_BUILD_MARKS = (
    "CMakeCache.txt",
    "cmake_args.last",
    "colcon_build.rc",
    "colcon_test.rc",
    "colcon_command_prefix_build.sh",
    "handover",
    "handover_test",
    "install_manifest.txt",
)
_BUILD_FILES = (".built_by", "COLCON_IGNORE", "compile_commands.json", "forge_*", ".forge_*")
_INSTALL_FILES = (
    *(LAYOUT_MARKER, "COLCON_IGNORE", ".forge.json", "_local_setup_util_*.py"),
    *("setup.*", "local_setup.*", BEFORE),
)
_LOG_FILES = ("COLCON_IGNORE", "latest", "latest_*")
_RUN = re.compile(r"[a-z][a-z_-]*_\d{4}-\d\d-\d\d_\d\d-\d\d-\d\d(_\d+)?")


@frozen
class Litter:
    """What goes together: `label` says what it is, `paths` are files, links and folders below `base`.

    `records` are folders of forge's own that say something of these, and are of no use without them.
    """

    label: str
    base: Path
    paths: tuple[Path, ...]
    records: tuple[Path, ...] = ()


def made_packages(layout: Layout, records: Mapping[str, Record]) -> frozenset[str]:
    """Return the packages of which anything was built or installed here."""
    built = {entry.name for entry in _folders(layout.build) if _is_build(entry)}
    if layout.merged:
        installed = {entry.name for entry in _entries(layout.install / PACKAGES) if entry.is_file()}
    else:
        installed = {entry.name for entry in _folders(layout.install) if _is_prefix(entry)}
    return frozenset(records) | built | installed


def litter_of_package(name: str, layout: Layout, records: Mapping[str, Record]) -> Iterator[Litter]:
    """Yield the build folder of a package and what it installed."""
    build = layout.build_dir(name)
    files = _installed(name, layout, records) if layout.merged else ()
    if os.path.lexists(build) and (name in records or _is_build(build)):
        beside = (layout.build / INSTALLED / name, set_aside(build))
        yield Litter(f"build folder of '{name}'", layout.build, (build,), tuple(filter(Path.exists, beside)))
    prefix = layout.prefix(name)
    if layout.merged and files:
        count = len(files)
        label = f"{count} installed file{'' if count == 1 else 's'} of '{name}'"
        yield Litter(label, layout.install, files)
    elif not layout.merged and os.path.lexists(prefix):
        yield Litter(f"prefix of '{name}'", layout.install, (prefix,))
    if aside := put_aside(name, layout):
        yield Litter(f"what a killed build had put aside of '{name}'", layout.install, tuple(aside))


def litter_of_workspace(
    layout: Layout, records: Mapping[str, Record], bases: Iterable[str]
) -> Iterator[Litter]:
    """Yield all that was made below the chosen bases, packages first."""
    names = sorted(made_packages(layout, records))
    for base, chosen, files in (
        ("build", layout.build, _BUILD_FILES),
        ("install", layout.install, _INSTALL_FILES),
    ):
        if base in bases:
            found = [litter for name in names for litter in litter_of_package(name, layout, records)]
            yield from (litter for litter in found if litter.base == chosen)
            yield from _own_files(base, chosen, files)
    if "log" in bases and layout.logs is not None and (layout.logs / "COLCON_IGNORE").exists():
        runs = tuple(entry for entry in _folders(layout.logs) if _RUN.fullmatch(entry.name))
        if runs:
            yield Litter(f"logs of {len(runs)} run{'' if len(runs) == 1 else 's'}", layout.logs, runs)
        yield from _own_files("log", layout.logs, _LOG_FILES)


def remove(litters: Iterable[Litter]) -> None:
    """Remove everything, and the folders that this leaves empty; links are removed, not followed."""
    bases = []
    for litter in litters:
        bases.append(litter.base)
        for path in (*litter.paths, *litter.records):
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            else:
                remove_file(path, litter.base)
    for base in dict.fromkeys(bases):
        if base.is_dir() and not base.is_symlink() and not any(base.iterdir()):
            base.rmdir()


def left_over(layout: Layout, bases: Iterable[str]) -> tuple[Path, ...]:
    """Return what is still in the bases: things that forge and colcon did not make."""
    folders = {"build": layout.build, "install": layout.install, "log": layout.logs}
    chosen = (folder for base in bases if (folder := folders[base]) is not None)
    return tuple(entry for folder in chosen for entry in _entries(folder))


def _own_files(word: str, base: Path, patterns: Iterable[str]) -> Iterator[Litter]:
    """Yield what belongs to no package: marks, scripts, journals."""
    found = tuple(path for pattern in patterns for path in sorted(base.glob(pattern)))
    if found:
        yield Litter(f"forge's own files in '{word}'", base, found)


def _installed(name: str, layout: Layout, records: Mapping[str, Record]) -> tuple[Path, ...]:
    """Return the files that this package alone put into a merged install."""
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
