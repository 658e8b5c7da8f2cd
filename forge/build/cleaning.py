"""Find and remove the files that builds of a package created, and nothing else.

In a prefix, lists, records and install manifests determine which files belong to a package; without them,
files in an isolated prefix belong to it if they are not newer than its own scripts, which builds write last.
All other files are kept, including mounts and files behind links.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path

from forge.base.ament_index import INDEX
from forge.base.files import mounts_below, remove_folder
from forge.base.frozen import frozen
from forge.base.layout import INSTALLED_STATES_DIR, SCRATCH_DIR, Layout
from forge.base.text import counted
from forge.build.build_dir import set_aside_path
from forge.build.copies import foreign_entries
from forge.build.folder_marks import (
    is_own_build_base,
    is_own_build_dir,
    is_own_install_base,
    is_source_of,
    is_usable_prefix,
)
from forge.build.installed_lists import (
    list_file,
    listed_files,
    package_markers,
    read_installed_list,
    write_installed_list,
)
from forge.build.model import BuildRecord
from forge.build.prefix import PrefixExchange, leftover_backups, remove_empty_folders, tidy
from forge.environment.prefixes import PACKAGES
from forge.environment.shells import SHELLS

_EXTENSIONS = (*SHELLS, "ps1")
PACKAGE_SCRIPTS = tuple(f"package.{extension}" for extension in (*_EXTENSIONS, "dsv", "xml"))


@frozen
class Removable:
    """Files, links and folders below `base` to remove together, with forge's `records` about them.

    `prefix` is the isolated prefix that contains the files, in `layout`.
    """

    label: str
    base: Path
    paths: tuple[Path, ...]
    records: tuple[Path, ...] = ()
    prefix: Path | None = None
    layout: Layout | None = None


def package_removables(name: str, layout: Layout, records: Mapping[str, BuildRecord]) -> Iterator[Removable]:
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
    own = (
        *(share / script for script in PACKAGE_SCRIPTS),
        *(() if listed else hooks),
        prefix / PACKAGES / name,
    )
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
