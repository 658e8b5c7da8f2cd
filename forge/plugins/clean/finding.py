"""What `forge clean` can remove in a workspace, and what remains there."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from forge.base.files import mounts_below
from forge.base.layout import (
    BACKUP_DIR,
    BUILD_BASE_FILES,
    CODE_QUALITY_FILE,
    IGNORE_MARK,
    INSTALL_BASE_FILES,
    INSTALLED_LISTS_DIR,
    Layout,
)
from forge.base.text import counted
from forge.build.cleaning import PACKAGE_SCRIPTS, Removable, package_removables
from forge.build.copies import foreign_entries
from forge.build.folder_marks import (
    RUN_NAME,
    has_package_marks,
    is_own_build_base,
    is_own_build_dir,
    is_own_ignore_mark,
    is_own_install_base,
    is_own_log_link,
    recorded_layout,
    sources_in,
)
from forge.build.installed_lists import list_file, read_installed_list
from forge.build.journal import open_journal
from forge.build.model import BuildRecord
from forge.environment.prefixes import PACKAGES

BASES = ("build", "install", "log")
_RUN_FILES = ("logger_all.log", "events.log", "events.jsonl")


def built_packages(layout: Layout, records: Mapping[str, BuildRecord]) -> frozenset[str]:
    """Return the packages with files in the build or install folder."""
    names = set(records)
    if is_own_build_base(layout.build):
        names |= {entry.name for entry in _folders(layout.build) if is_own_build_dir(entry)}
    if is_own_install_base(layout.install):
        names |= {entry.name.partition(".")[0] for entry in _entries(layout.install / BACKUP_DIR)}
        lists = {path.stem for path in (layout.install / INSTALLED_LISTS_DIR).glob("*.json")}
        installed_lists = ((name, read_installed_list(name, layout)) for name in lists)
        names |= {name for name, one in installed_lists if one and any(map(os.path.lexists, one.files))}
        if layout.merged:
            # Unowned files may be beside the marks.
            marks = (entry.name for entry in _entries(layout.install / PACKAGES) if entry.is_file())
            share = layout.install / "share"
            names |= {
                name for name in marks if any((share / name / each).is_file() for each in PACKAGE_SCRIPTS)
            }
        else:
            names |= {entry.name for entry in _folders(layout.install) if has_package_marks(entry)}
    return frozenset(names)


def is_of_workspace(name: str, root: Path, layout: Layout, records: Mapping[str, BuildRecord]) -> bool:
    """Return whether a package was built from this workspace, which may share folders with others.

    Without a list that names the workspace, the location of its sources decides, or else that of the folders.
    """
    real, listed, record = os.path.realpath(root), read_installed_list(name, layout), records.get(name)
    if listed and listed.workspace:
        return os.path.realpath(layout.install / listed.workspace) == real
    places = (record.source,) if record and record.source else (layout.build, layout.install)
    return all(f"{os.path.realpath(place)}/".startswith(f"{real}/") for place in places)


def packages_of_others(root: Path, layout: Layout, records: Mapping[str, BuildRecord]) -> frozenset[str]:
    """Return the packages that were built from another workspace, which shares a folder and still exists.

    Without a list, it depends on whether the package has a record.
    """
    real, names = os.path.realpath(root), set()
    for name in built_packages(layout, records):
        listed, record = read_installed_list(name, layout), records.get(name)
        home = str(layout.install / listed.workspace) if listed and listed.workspace else ""
        home = home or (record.source if record else "")
        is_below = f"{os.path.realpath(home)}/".startswith(f"{real}/")
        if Path(home).is_dir() and not is_below if home else listed and records and not record:
            names.add(name)
    return frozenset(names)


def workspace_removables(
    root: Path, layout: Layout, records: Mapping[str, BuildRecord], bases: Collection[str]
) -> Iterator[Removable]:
    """Yield everything that was created below the chosen bases, packages first.

    If other workspaces built packages there, only the files of the workspace at `root`.
    """
    of_others = packages_of_others(root, layout, records)
    names = sorted(built_packages(layout, records) - of_others)
    removables = [removable for name in names for removable in package_removables(name, layout, records)]
    for base, chosen, is_own, files in (
        ("build", layout.build, is_own_build_base, BUILD_BASE_FILES),
        ("install", layout.install, is_own_install_base, INSTALL_BASE_FILES),
    ):
        targets = tuple(_targets(layout))
        # An install folder that contains only folders of targets has no other mark.
        if base in bases and (is_own(chosen) or any(target.install.parent == chosen for target in targets)):
            yield from (removable for removable in removables if removable.base == chosen)
            for target in targets:
                below = open_journal(target.build).records
                for removable in workspace_removables(root, target, below, (base,)):
                    yield replace(removable, label=f"{removable.label}, for '{target.target}'")
            yield from _own_files(base, chosen, (chosen / name for name in files if not of_others))
    if "log" in bases and layout.logs is not None and (layout.logs / IGNORE_MARK).is_file():
        runs = tuple(
            folder
            for folder in _folders(layout.logs)
            if not folder.is_symlink() and RUN_NAME.fullmatch(folder.name)
            if not any(folder.iterdir()) or any((folder / name).is_file() for name in _RUN_FILES)
        )
        if runs:
            yield Removable(f"logs of {counted(len(runs), 'run')}", layout.logs, runs)
        links = tuple(filter(is_own_log_link, layout.logs.glob("latest*")))
        links += tuple(filter(Path.is_file, (layout.logs / CODE_QUALITY_FILE,)))
        mark = layout.logs / IGNORE_MARK
        # With unowned files in the folder, the mark may belong to their owner: it hides them from discovery.
        others = {*_entries(layout.logs)} - {*runs, *links, mark}
        yield from _own_files("log", layout.logs, (*links, *(() if others else (mark,))))


def remaining_entries(layout: Layout, bases: Iterable[str]) -> Iterator[tuple[Path, str]]:
    """Yield the entries that remain in bases and prefixes, with the reasons."""
    folders = {"build": layout.build, "install": layout.install, "log": layout.logs}
    for base in bases:
        folder = folders[base]
        if folder and folder.is_dir() and (mount := next(mounts_below(str(folder)), "")) == str(folder):
            yield folder, f"'{mount}' is mounted there"
        for entry in _entries(folder):
            if entry.name == INSTALLED_LISTS_DIR or (entry.name == IGNORE_MARK and is_own_ignore_mark(entry)):
                continue
            if base == "install" and list_file(entry.name, layout).is_file():
                yield from remaining_in_prefix(entry)
            else:
                yield entry, _reason(entry)


def remaining_in_prefix(prefix: Path) -> Iterator[tuple[Path, str]]:
    """Yield the entries that remain in a prefix from which a package was removed, with the reason."""
    files, empty = foreign_entries(str(prefix))
    for path in map(Path, sorted((*files, *empty))):
        yield path, _reason(path)


def _reason(path: Path) -> str:
    if mount := next(mounts_below(str(path)), None):
        return f"'{mount}' is mounted there"
    if path.is_dir() and (source := sources_in(path)):
        return f"it contains '{source}'"
    return "forge did not create it"


def _own_files(base_name: str, base: Path, paths: Iterable[Path]) -> Iterator[Removable]:
    """Yield the files that belong to no package: markers, scripts, journals."""
    existing = tuple(
        path
        for path in paths
        if os.path.lexists(path) and (path.name != IGNORE_MARK or is_own_ignore_mark(path))
    )
    if existing:
        yield Removable(f"forge's own files in '{base_name}'", base, existing)


def _targets(layout: Layout) -> Iterator[Layout]:
    """Yield the layouts of other platforms, whose folders are marked below those of this machine."""
    names = {entry.name for entry in _folders(layout.build) if is_own_build_base(entry)}
    names |= {entry.name for entry in _folders(layout.install) if is_own_install_base(entry)}
    for name in sorted(names if not layout.target else ()):
        build, install = layout.build / name, layout.install / name
        if not is_own_build_dir(build) and not has_package_marks(install):
            merged = recorded_layout(install) == "merged"
            yield replace(layout, build=build, install=install, target=name, merged=merged)


def _folders(base: Path) -> Iterator[Path]:
    return (entry for entry in _entries(base) if entry.is_dir() and not entry.name.startswith("."))


def _entries(base: Path | None) -> list[Path]:
    return sorted(base.iterdir()) if base is not None and base.is_dir() else []
