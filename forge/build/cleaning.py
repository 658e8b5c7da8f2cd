"""Find and remove the files that forge and colcon created in a workspace, and nothing else.

A build folder is removed as a whole if it is forge's own (see forge.build.folder_marks). In a prefix, merged
or isolated, lists, records and install manifests determine which files belong to a package; without them,
files in an isolated prefix belong to it if they are not newer than its own scripts, which builds write last.
All other files are kept, including mounts and files behind links.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from forge.base.ament_index import INDEX
from forge.base.files import mounts_below, remove_folder
from forge.base.frozen import frozen
from forge.base.layout import (
    BACKUP_DIR,
    BUILD_BASE_FILES,
    CODE_QUALITY_FILE,
    IGNORE_MARK,
    INSTALL_BASE_FILES,
    INSTALLED_LISTS_DIR,
    INSTALLED_STATES_DIR,
    SCRATCH_DIR,
    Layout,
)
from forge.base.text import counted
from forge.build.build_dir import set_aside_path
from forge.build.copies import foreign_entries
from forge.build.folder_marks import (
    has_package_marks,
    is_own_build_base,
    is_own_build_dir,
    is_own_ignore_mark,
    is_own_install_base,
    is_own_log_base,
    is_own_log_link,
    is_run_name,
    is_source_of,
    is_usable_prefix,
    recorded_layout,
    sources_in,
)
from forge.build.installed_lists import (
    list_file,
    listed_files,
    package_markers,
    read_installed_list,
    write_installed_list,
)
from forge.build.journal import open_journal
from forge.build.model import BuildRecord
from forge.build.prefix import PrefixExchange, leftover_backups, remove_empty_folders, tidy
from forge.environment.prefixes import PACKAGES
from forge.environment.shells import SHELLS

BASES = ("build", "install", "log")

_EXTENSIONS = (*SHELLS, "ps1")
_SCRIPTS = tuple(f"package.{extension}" for extension in (*_EXTENSIONS, "dsv", "xml"))
_RUN_FILES = ("logger_all.log", "events.log", "events.jsonl")


@frozen
class Removable:
    """Files, links and folders below `base` to remove together; `label` describes them.

    `records` are files and folders with forge's own data about them, which are removed with them. `prefix` is
    the isolated prefix that contains the files, in `layout`.
    """

    label: str
    base: Path
    paths: tuple[Path, ...]
    records: tuple[Path, ...] = ()
    prefix: Path | None = None
    layout: Layout | None = None


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
            names |= {name for name in marks if any((share / name / each).is_file() for each in _SCRIPTS)}
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


def package_removables(name: str, layout: Layout, records: Mapping[str, BuildRecord]) -> Iterator[Removable]:
    """Yield the build folder of a package and its installed files."""
    build, record = layout.build_dir(name), records.get(name)
    if is_own_build_base(layout.build) and is_own_build_dir(build) and not is_source_of(build, record):
        beside = (layout.build / INSTALLED_STATES_DIR / name, set_aside_path(build))
        yield Removable(
            f"build folder of '{name}'", layout.build, (build,), tuple(filter(Path.exists, beside))
        )
    if not is_own_install_base(layout.install):
        return
    if layout.merged:
        if files := _existing(_installed(name, layout, records), layout.install):
            label = f"{counted(len(files), 'installed file')} of '{name}'"
            yield Removable(label, layout.install, files, (list_file(name, layout),))
    else:
        yield from _of_prefix(name, layout, records)
    if aside := leftover_backups(name, layout):
        yield Removable(f"backup of '{name}' from a killed build", layout.install, tuple(aside))


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
    if "log" in bases and layout.logs is not None and is_own_log_base(layout.logs):
        runs = tuple(
            folder
            for folder in _folders(layout.logs)
            if not folder.is_symlink() and is_run_name(folder.name)
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


def restore_backups(layout: Layout, names: Iterable[str]) -> None:
    """Restore the backups of killed builds, so that files of the user in them return to their prefix."""
    for name in names:
        if is_own_install_base(layout.install) and leftover_backups(name, layout):
            PrefixExchange(name, layout).roll_back()
    tidy(layout)


def remove(removables: Iterable[Removable]) -> None:
    """Remove everything, and folders that become empty; neither links nor mounts are entered."""
    bases = []
    for removable in removables:
        bases.append(removable.base)
        for path in (*removable.paths, *removable.records):
            if not path.is_dir() or path.is_symlink():
                path.unlink(missing_ok=True)
                remove_empty_folders(str(path), str(removable.base))
            elif removable.prefix is None:
                remove_folder(str(path), last=SCRATCH_DIR)
            else:
                remove_empty_folders(f"{path}/x", str(removable.base))
        if removable.prefix is not None and removable.layout is not None:
            remove_empty_folders(f"{removable.prefix}/x", str(removable.base))
            if removable.prefix.is_dir():
                # This tells the next build that it may install here, and that the remaining files must be
                # kept.
                write_installed_list(removable.prefix.name, removable.layout, {}, ())
    for base in sorted(dict.fromkeys(bases), key=lambda base: -len(base.parts)):
        if base.is_dir() and not base.is_symlink() and not any(base.iterdir()):
            with suppress(OSError):  # a mount, or in a folder of another user
                base.rmdir()


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


def _of_prefix(name: str, layout: Layout, records: Mapping[str, BuildRecord]) -> Iterator[Removable]:
    """Yield the files that builds installed into an isolated prefix, or the link that is there instead."""
    prefix, record = layout.prefix(name), records.get(name)
    if not prefix.is_dir() or not is_usable_prefix(prefix, layout, lambda: records):
        return
    if prefix.is_symlink():
        yield Removable(f"link to the prefix of '{name}'", layout.install, (prefix,))
        return
    files, empty = foreign_entries(str(prefix))
    installed, listed = _installed(name, layout, records), read_installed_list(name, layout)
    if listed is not None or (record is not None and record.files):
        folders = {
            *(listed.folders if listed else ()),
            *(path.rstrip("/") for path in (record.folders if record else ())),
        }
        own = [*(path for path in files if path in installed), *(path for path in empty if path in folders)]
    else:
        scripts = (*package_markers(name, layout), *map(str, (prefix / "share" / name).glob("package.*")))
        last = max((os.lstat(path).st_ctime_ns for path in scripts if os.path.lexists(path)), default=0)
        own = [path for path in (*files, *empty) if path in installed or os.lstat(path).st_ctime_ns <= last]
    paths = _existing(own, prefix)
    if paths or not (files or empty):
        count = len(files) + len(empty) - len(own)
        rest = f", except {counted(count, 'file')} that no build installed" if count else ""
        label = f"prefix of '{name}'{rest}"
        lists = (list_file(name, layout),)
        yield Removable(label, layout.install, paths, lists, prefix=prefix, layout=layout)


def _installed(name: str, layout: Layout, records: Mapping[str, BuildRecord]) -> set[str]:
    """Return the files in a prefix that belong to this package only."""
    listed = read_installed_list(name, layout)
    files = {*(listed.files if listed else ()), *(records[name].files if name in records else ())}
    if is_own_build_dir(layout.build_dir(name)):
        files.update(listed_files(layout.build_dir(name)))
    prefix = layout.prefix(name)
    share = prefix / "share" / name
    hooks = [path for path in share.glob("hook/*") if path.suffix[1:] in {*_EXTENSIONS, "dsv"}]
    own = (*(share / script for script in _SCRIPTS), *(() if listed else hooks), prefix / PACKAGES / name)
    files.update(map(str, (*own, *(prefix / INDEX).glob(f"*/{name}"))))
    if layout.merged:
        for record in (record for other, record in records.items() if other != name):
            files.difference_update(record.files)
    return files - (listed.unclaimed if listed else frozenset())


def _existing(paths: Iterable[str], prefix: Path) -> tuple[Path, ...]:
    """Return which of these files exist in a prefix, with their bytecode; none behind a link or mount."""
    real, mounts = os.path.realpath(prefix), tuple(mounts_below(str(prefix)))
    inside: dict[str, bool] = {}
    existing = set[Path]()
    for path in paths:
        folder = os.path.dirname(path)  # noqa: PTH120  (each installed file)
        if folder not in inside:
            expected = real + folder[len(str(prefix)) :]
            inside[folder] = (
                f"{folder}/".startswith(f"{prefix}/")
                and os.path.realpath(folder) == expected
                and not any(f"{folder}/".startswith(f"{mount}/") for mount in mounts if mount != str(prefix))
            )
        if inside[folder] and path not in mounts and os.path.lexists(path):
            existing.add(Path(path))
            if path.endswith(".py"):
                existing.update((Path(folder) / "__pycache__").glob(f"{Path(path).stem}.*.pyc"))
    return tuple(sorted(existing))


def _folders(base: Path) -> Iterator[Path]:
    return (entry for entry in _entries(base) if entry.is_dir() and not entry.name.startswith("."))


def _entries(base: Path | None) -> list[Path]:
    return sorted(base.iterdir()) if base is not None and base.is_dir() else []
