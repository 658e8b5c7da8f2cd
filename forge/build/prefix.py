"""Exchange the files of a package in its prefix: all are of the last successful build, or of the new one.

A package is always installed as if built for the first time. Before its build, the files that forge installed
are moved aside, so that the build does not find them and none remains that is no longer installed. If the
build fails or is interrupted, they are moved back; after a kill, the next build begins from them.

forge owns only what it installed. Each prefix has a list of these files with their contents; files that
several packages installed, and those outside the prefix, are copied instead of moved. Whatever else is there
belongs to somebody else: it stays where it is, and is copied as well, since a step of the package could
overwrite it.
"""

from __future__ import annotations

import contextlib
import errno
import filecmp
import itertools
import json
import os
import shutil
import stat
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forge.base.ament_index import INDEX
from forge.base.errors import Problem
from forge.base.files import BYTECODE, mount_points, remove_tree, replace_file, tree_below
from forge.base.frozen import frozen
from forge.base.layout import BACKUP_DIR, INSTALL_BASE_FILES, INSTALLED_LISTS_DIR, LOCK_FILE
from forge.build.install_manifests import MANIFESTS
from forge.build.observed_writes import ObservedWrites, append, begin_log, read_log
from forge.environment.prefixes import PACKAGES
from forge.environment.shells import SHELLS

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    from forge.base.layout import Layout
    from forge.build.tasks import Task

_LIST = "list.json"
_VERSION = 1
_OF_BASE = frozenset({*INSTALL_BASE_FILES, BACKUP_DIR, INSTALLED_LISTS_DIR, LOCK_FILE})
"""What forge and colcon write at the top of an install folder."""
_SCRIPTS = frozenset({".bash", ".bat", ".dsv", ".fish", ".ps1", ".sh", ".zsh"})
_CHUNK = 1 << 20
_SMALL = 65536
"""The size in bytes up to which an installed file is copied; larger ones are hard-linked in constant time."""


@frozen
class InstalledList:
    """What forge installed for a package: the content of each file by absolute path, and empty folders.

    `links` are the links that lead from the prefix to these files, with their targets: a link that appears
    there later belongs to somebody else. `unclaimed` files appeared during the build, but it is unknown
    whether the package or another program has written them: they count as installed, and are never removed.
    `workspace` is the root of the workspace that built the package, relative to the install folder, which it
    may share with others; '' if an earlier version wrote the list.
    """

    files: Mapping[str, str]
    folders: tuple[str, ...] = ()
    links: tuple[tuple[str, str], ...] = ()
    unclaimed: frozenset[str] = frozenset()
    workspace: str = ""


def read_installed_list(name: str, layout: Layout) -> InstalledList | None:
    """Return the list of a package's files below the install folder; None if there is none."""
    return _read_list(_list_file(name, layout), str(layout.install))


def _read_list(file: Path, base: str) -> InstalledList | None:
    try:
        data = json.loads(file.read_bytes())
        if data["version"] != _VERSION:
            return None
        return InstalledList(
            {f"{base}/{path}": str(content) for path, content in data["files"].items()},
            tuple(f"{base}/{path}" for path in data["folders"]),
            tuple((f"{base}/{path}", str(target)) for path, target in data["links"].items()),
            frozenset(f"{base}/{path}" for path in data["unclaimed"]),
            str(data.get("workspace", "")),
        )
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return None


def write_installed_list(
    name: str,
    layout: Layout,
    contents: Mapping[str, str],
    folders: Iterable[str],
    unclaimed: Collection[str] = (),
    workspace: str = "",
) -> None:
    """Record the installed files of a package, with their contents as by `contents_of`.

    `workspace` is the root of the workspace.
    """
    base = str(layout.install)
    inside = [path for path in contents if path.startswith(f"{base}/") and path not in unclaimed]
    parents = {parent for path in inside for parent in _parents(path, base)}
    data = {
        "version": _VERSION,
        "files": {path[len(base) + 1 :]: _identity(path, contents[path]) for path in inside},
        "folders": [path.rstrip("/")[len(base) + 1 :] for path in folders if path.startswith(f"{base}/")],
        "links": {
            path[len(base) + 1 :]: os.readlink(path) for path in sorted(parents) if os.path.islink(path)
        },
        "unclaimed": [path[len(base) + 1 :] for path in sorted(unclaimed)],
        "workspace": workspace and os.path.relpath(os.path.realpath(workspace), os.path.realpath(base)),
    }
    replace_file(_list_file(name, layout), json.dumps(data).encode())


def package_markers(name: str, layout: Layout) -> tuple[str, ...]:
    """Return the files that mark a package as installed; the one that is read first comes first."""
    prefix = layout.prefix(name)
    scripts_of_it = (f"{prefix}/share/{name}/package.{extension}" for extension in ("dsv", *SHELLS))
    return (*scripts_of_it, f"{prefix}/{PACKAGES}/{name}", f"{prefix}/{INDEX}/packages/{name}")


def forget_installed_list(name: str, layout: Layout) -> None:
    """Remove the list of a package that was removed."""
    _list_file(name, layout).unlink(missing_ok=True)


def _identity(path: str, content: str) -> str:
    """Return what tells a file from another one at its path: the target of a link, else the digest."""
    return f"-> {os.readlink(path)}" if content.startswith("link ") else content.rpartition(" ")[2]


def written_log(name: str, layout: Layout) -> Path:
    """Return the log of what the steps of a package write below its prefix."""
    return _folder(name, layout, "written")


def guarded_links(name: str, layout: Layout) -> Path:
    """Return the list of links in a prefix through which the steps of a package must not write."""
    return _folder(name, layout, "links")


def leftover_backups(name: str, layout: Layout) -> list[Path]:
    """Return what a killed build left of a package in the backup folder."""
    folder = _folder(name, layout)
    return [path for path in (folder, *sorted(folder.parent.glob(f"{name}.*"))) if path.exists()]


def tidy(layout: Layout) -> None:
    """Remove the backup folder if it is empty."""
    with contextlib.suppress(OSError):
        os.rmdir(layout.install / BACKUP_DIR)


class PrefixExchange:
    """The exchange of one package's files; its state is on disk, so that a later build can continue it.

    In the backup folder are, for a package P: `P`, the moved files; `P.part`, the same while they are being
    moved; `P.copies`, the copies of shared files; `P.others`, those of other people's files; `P.state`, the
    folders before the build; `P.list`, the list of files before the build; `P.written`, the log of what the
    steps write; `P.links`, the links through which they must not write.
    """

    def __init__(self, name: str, layout: Layout) -> None:
        """Store the package and the layout."""
        self._name = name
        self._layout = layout
        self._prefix = str(layout.prefix(name))
        self._markers = package_markers(name, layout)
        self._moved, self._part, self._copies, self._state, self._list = (
            _folder(name, layout, kind) for kind in ("", "part", "copies", "state", "list")
        )
        self._others = _shared_others(layout) if layout.merged else _folder(name, layout, "others")

    def begin(self, earlier: Iterable[str], shared: Collection[str] = ()) -> tuple[Problem, ...]:
        """Move the package's files aside, unless a killed build has done so.

        Return a problem for each file of somebody else that the killed build may have changed.

        `earlier` are the files of earlier builds in records and install manifests, as absolute paths; other
        packages also installed the `shared` ones.
        """
        known = read_installed_list(self._name, self._layout)
        listed = known or InstalledList({})
        # After a kill, install manifests may name files that a step had not yet written.
        earlier = self.moved_files() if self._moved.is_dir() else earlier
        # Before its first build, nothing is the package's.
        markers = self._markers if known or earlier or self._is_installed() else ()
        scripts = _scripts(self._layout.prefix(self._name) / "share" / self._name)
        files = dict.fromkeys(
            (*listed.files, *earlier, *(scripts if markers and not known else ()), *markers)
        )
        for path in listed.unclaimed:
            files.pop(path, None)
        folders = listed.folders
        movable = [path for path in files if path.startswith(f"{self._prefix}/") and path not in shared]
        if staying := files.keys() - set(movable):
            _copy_all(self._copies, sorted(staying))
        kept = self._recover()
        if not self._moved.is_dir():
            self._note_state((*movable, *folders))
        self._move_aside(movable, folders)
        begin_log(written_log(self._name, self._layout))
        if not self._layout.merged:
            self._copy_others()
        self._guard_links()
        return kept

    def _is_installed(self) -> bool:
        return os.path.lexists(self._layout.prefix(self._name) / PACKAGES / self._name)

    def moved_files(self) -> dict[str, tuple[str, os.stat_result]]:
        """Return the path of the backup and its stat for each file of the last build, by its path."""
        cut = len(str(self._moved))
        found = {
            f"{self._prefix}{path[cut:]}": (path, status) for path, status in tree_below(str(self._moved))[0]
        }
        for number, path, *_ in _listed(self._copies):
            found[path] = (f"{self._copies}/{number}", os.lstat(self._copies / number))
        return found

    def others(self) -> dict[str, list[int]]:
        """Return the stats of what was in the prefix when the build started without being the package's."""
        return {path: status for _, path, *status in _listed(self._others)}

    def writes(self) -> ObservedWrites:
        """Return what the steps have written below the prefix, as far as it was observed."""
        return read_log(written_log(self._name, self._layout), Path(self._prefix))

    def in_the_way(self, paths: Iterable[str]) -> Iterator[Problem]:
        """Yield a problem for each file of somebody else where the package is about to install one."""
        others = {path: status for path, status in self._known_others()[0].items() if os.path.lexists(path)}
        above = {parent: path for path in others for parent in _parents(path, self._prefix)}
        base = os.path.realpath(self._layout.install)
        found: dict[str, str] = {}
        for path in sorted(paths) if others else ():
            blocking = next(
                (other for other in (path, *_parents(path, self._prefix)) if other in others), None
            )
            passes = blocking and blocking != path and os.path.isdir(blocking)
            if blocking and not (passes and not _leads_out(blocking, base)):
                found.setdefault(blocking, path)
            elif path in above:
                found.setdefault(above[path], path)
        for blocking, path in found.items():
            yield self._problem(path, blocking)

    def announce(self, paths: Iterable[str]) -> None:
        """Log files that forge is about to write, so that they are known after a kill."""
        log = written_log(self._name, self._layout)
        append(str(log), *(b"W" + os.fsencode(path) for path in paths))

    def overwritten(self, installed: Iterable[str]) -> Iterator[Problem]:
        """Give back files of others that lay where the package has installed some; yield a problem for each.

        What the steps were observed to remove without installing something there is given back as well.
        """
        others, unclaimed = self._known_others()
        if not others:
            return
        yield from self.refused()
        copies = {path: self._others / number for number, path, *_ in _listed(self._others)}
        # Earlier versions did not list what code had installed into a merged prefix.
        listed = _read_list(self._list, str(self._layout.install))
        incomplete = self._layout.merged and listed is not None and not listed.workspace
        for path in sorted(set(installed)):
            if path in others and path not in unclaimed and _stats(path) != others[path]:
                if incomplete and _is_same_file(path, copies[path]):
                    continue
                _give_back(path, others[path], copies[path])
                yield self._problem(path, path)
            elif os.path.isdir(path) and not os.path.islink(path):
                below = next((other for other in sorted(others) if other.startswith(f"{path}/")), None)
                if below:
                    yield self._problem(path, below)
        writes = self.writes()
        for path in sorted(others) if writes.removed else ():
            if not os.path.lexists(path) and writes.take_away(path):
                blocking = next((p for p in _parents(path, self._prefix) if _is_no_folder(p)), None)
                _give_back(path, others[path], copies[path])
                if blocking:
                    yield self._problem(blocking, path)

    def refused(self) -> Iterator[Problem]:
        """Yield a problem for each link of somebody else through which a step tried to write."""
        others, found = self.others(), dict[str, str]()
        for path in sorted(self.writes().refused):
            link = next((place for place in (path, *_parents(path, self._prefix)) if place in others), None)
            if link:
                found.setdefault(link, path)
        for link, path in found.items():
            yield self._problem(path, link)

    def commit(self) -> tuple[Problem, ...]:
        """Drop the backup, once the new files are listed.

        Files that the package no longer installs, but that somebody has edited, are given back: return a
        problem for each, and for files of others that it may have changed.
        """
        listed = _read_list(self._list, str(self._layout.install))
        kept = [*self._keep_changed()]
        from forge.build.inputs.fingerprints import content_digest

        cut = len(str(self._moved))
        for path, _ in tree_below(str(self._moved))[0]:
            original = f"{self._prefix}{path[cut:]}"
            if listed is None or os.path.lexists(original) or original not in listed.files:
                continue
            content = "link " if os.path.islink(path) else content_digest(path)
            if _identity(path, content) != listed.files[original]:
                os.makedirs(os.path.dirname(original), exist_ok=True)
                os.rename(path, original)
                message = f"kept '{original}', which '{self._name}' no longer installs, because it was edited"
                kept.append(Problem(message, hint="remove it if you do not need it"))
        self._drop()
        return tuple(kept)

    def roll_back(self) -> tuple[Problem, ...]:
        """Remove what the build has written, and move the package's files back.

        If a copy was overwritten, the package is marked as not installed. Return a problem for each file of
        somebody else that the build may have changed.
        """
        if self._part.is_dir():
            self._move_back(self._part)
        self._remove_written()
        kept = self._keep_changed()
        for manifest in MANIFESTS:
            (self._layout.build_dir(self._name) / manifest).unlink(missing_ok=True)
        if self._moved.is_dir():
            self._move_back(self._moved)
        self._restore_folders()
        if not _restore_copies(self._copies):
            for path in self._markers:
                remove_tree(path)
        if self._list.is_file():
            _list_file(self._name, self._layout).parent.mkdir(exist_ok=True)  # a step may have removed all
            self._list.replace(_list_file(self._name, self._layout))
        elif self._state.is_file():
            forget_installed_list(self._name, self._layout)
        if not self._layout.merged and not self._noted("state").get("existed", True):
            with contextlib.suppress(OSError):
                os.rmdir(self._prefix)
        self._drop()
        return kept

    def _keep_changed(self) -> tuple[Problem, ...]:
        """Keep the earlier contents of files of others that a step may have changed without being observed.

        They may as well be changed by their owner, so that they stay, too. What was appended changes nothing.
        """
        writes = self.writes()
        others, unclaimed = self._known_others()
        kept = []
        for number, path, *status in () if writes.complete or not others else _listed(self._others):
            copy = self._others / number
            if (
                path in unclaimed
                or path in writes.files
                or not stat.S_ISREG(status[_MODE])
                or _stats(path) == status
                or _begins_with(path, copy)
            ):
                continue
            names = (f"{path}.before_build{number or ''}" for number in itertools.count())
            beside = next(name for name in names if not os.path.lexists(name) or _is_same_file(name, copy))
            if not os.path.lexists(beside):
                os.makedirs(os.path.dirname(beside), exist_ok=True)
                _copy(copy, Path(beside), linked=False)
                message = f"'{path}' changed during the build of '{self._name}', which could not be observed"
                kept.append(Problem(message, hint=f"its earlier content is in '{beside}'"))
        return tuple(kept)

    def _restore_folders(self) -> None:
        for path, mode in self._noted("folders").items():
            if not os.path.lexists(path):
                os.makedirs(path, exist_ok=True)
            if os.path.isdir(path) and not os.path.islink(path):
                os.chmod(path, mode)

    def _drop(self) -> None:
        for folder in (self._moved, self._copies, *(() if self._layout.merged else (self._others,))):
            if folder.is_dir():
                trash = Path(f"{folder}.trash")
                remove_tree(str(trash))
                folder.rename(trash)
                remove_tree(str(trash))
        log, links = written_log(self._name, self._layout), guarded_links(self._name, self._layout)
        for file in (self._state, self._list, log, links):
            file.unlink(missing_ok=True)

    def _recover(self) -> tuple[Problem, ...]:
        """Continue after a kill: remove what the killed build has written, or undo a half-done move."""
        kept: tuple[Problem, ...] = ()
        remove_tree(f"{self._moved}.trash")
        if self._part.is_dir():
            # Killed while moving: all files are still those of the last successful build.
            self._move_back(self._part)
        if self._moved.is_dir():
            self._remove_written()
            kept = self._keep_changed()
            if not self.writes().complete:
                # Some files may be of the killed build: which ones is unknown.
                noted = {
                    "state": {**self._noted("state"), "listed": False},
                    "folders": self._noted("folders"),
                }
                replace_file(self._state, json.dumps(noted).encode())
        if not self._layout.merged:
            remove_tree(str(self._others))
        return kept

    def _remove_written(self) -> None:
        """Remove what the steps wrote below the prefix; give back other files that they overwrote."""
        writes = self.writes()
        others = {**self.others(), **(self._of_other_packages() if writes.files else {})}
        for path in sorted(writes.files):
            if path in others or not path.startswith(f"{self._prefix}/"):
                continue
            with contextlib.suppress(FileNotFoundError, NotADirectoryError, IsADirectoryError):
                os.unlink(path)
                _remove_empty(path, self._prefix, others)
        for path in sorted(writes.folders, reverse=True):
            if path not in others and path.startswith(f"{self._prefix}/"):
                _remove_empty(f"{path}/x", self._prefix, others)
        for number, path, *status in _listed(self._others):
            if _stats(path) != status and (
                path in writes.files or (not os.path.lexists(path) and writes.take_away(path))
            ):
                _give_back(path, status, self._others / number)

    def _of_other_packages(self) -> dict[str, list[int]]:
        """Return the files that other packages have installed into the same prefix."""
        if not self._layout.merged:
            return {}
        own = _list_file(self._name, self._layout)
        lists = (_read_list(file, self._prefix) for file in own.parent.glob("*.json") if file != own)
        return {path: [] for found in lists if found for path in found.files}

    def _note_state(self, paths: Iterable[str]) -> None:
        """Record the package's folders, which may become empty and be removed, with their permissions."""
        folders: dict[str, int | None] = {}
        for path in paths:
            for folder in (path.rstrip("/"), *_parents(path, self._prefix)):
                if folder not in folders:
                    status = _status(folder)
                    is_folder = status is not None and stat.S_ISDIR(status.st_mode)
                    folders[folder] = stat.S_IMODE(status.st_mode) if status and is_folder else None
        kept = {path: mode for path, mode in folders.items() if mode is not None}
        state = {
            "existed": os.path.lexists(self._prefix),
            "listed": not self._is_installed() or _list_file(self._name, self._layout).exists(),
        }
        data = {"state": state, "folders": kept}
        with contextlib.suppress(FileNotFoundError):
            replace_file(self._list, _list_file(self._name, self._layout).read_bytes())
        replace_file(self._state, json.dumps(data).encode())

    def _noted(self, key: str) -> Mapping[str, Any]:
        try:
            found = json.loads(self._state.read_bytes())[key]
        except (OSError, ValueError, LookupError, TypeError, RecursionError):
            return {}
        return found if isinstance(found, dict) else {}

    def _move_aside(self, paths: Iterable[str], folders: Iterable[str]) -> None:
        """Move files out of the prefix, and remove folders that become empty."""
        target = self._moved if self._moved.is_dir() else self._part
        target.mkdir(parents=True, exist_ok=True)
        cut, made, emptied = len(self._prefix), {str(target)}, set()
        for path in sorted(paths):
            aside = f"{target}{path[cut:]}"
            parent = os.path.dirname(aside)
            with contextlib.suppress(FileNotFoundError, NotADirectoryError):
                status = os.lstat(path)
                if stat.S_ISDIR(status.st_mode):
                    continue
                if os.path.lexists(aside):
                    os.unlink(path)
                else:
                    if parent not in made:
                        os.makedirs(parent, exist_ok=True)
                        made.add(parent)
                    _rename(path, aside)
                emptied.add(os.path.dirname(path))
        for folder in sorted({*emptied, *folders}, reverse=True):
            _remove_empty(f"{folder}/x", self._prefix)
        if target is self._part:
            self._part.rename(self._moved)

    def _move_back(self, source: Path) -> None:
        """Move files to their original paths, replacing whatever the build created there since."""
        others = self.others()
        for path, _ in tree_below(str(source))[0]:
            destination = f"{self._prefix}{path[len(str(source)) :]}"
            for parent in reversed([*_parents(destination, self._prefix)]):
                if os.path.lexists(parent) and not os.path.isdir(parent) and parent not in others:
                    os.unlink(parent)
            os.makedirs(os.path.dirname(destination), exist_ok=True)
            if os.path.isdir(destination) and not os.path.islink(destination):
                remove_empty_tree(destination)
            _rename(path, destination)
        remove_tree(str(source))

    def _copy_others(self) -> None:
        """Copy what is left in the prefix: it belongs to somebody else, and a step could overwrite it."""
        files, empty = foreign_entries(self._prefix)
        if files or empty:
            _copy_all(self._others, (*files, *empty), all_kinds=True)

    def _guard_links(self) -> None:
        """List the links of others that lead out of the prefix: what is behind them was not copied."""
        file = guarded_links(self._name, self._layout)
        file.unlink(missing_ok=True)
        others, unclaimed = self._known_others()
        base = os.path.realpath(self._layout.install)
        links = [
            path
            for path, status in others.items()
            if stat.S_ISLNK(status[_MODE]) and path not in unclaimed and _leads_out(path, base)
        ]
        if links:
            real = os.path.realpath(self._prefix)
            spelled = {*links, *(f"{real}{path[len(self._prefix) :]}" for path in links)}
            file.write_bytes(b"".join(b"%s\0" % os.fsencode(path) for path in sorted(spelled)))

    def _known_others(self) -> tuple[Mapping[str, list[int]], Collection[str]]:
        """Return what certainly was not the package's before the build, and what nobody claimed.

        Which files belong to a package that another tool or an older forge installed is unknown.
        """
        others = self.others() if self._noted("state").get("listed") else {}
        known = _read_list(self._list, str(self._layout.install)) if others else None
        return others, known.unclaimed if known else frozenset()

    def _problem(self, path: str, other: str) -> Problem:
        message = (
            f"'{self._name}' installs '{path}', but forge did not install '{other}', which is in its place"
        )
        return Problem(message, hint=f"move '{other}' away, or install to another name, then build again")


def foreign_entries(root: str) -> tuple[list[str], list[str]]:
    """Return the files and the empty folders below a folder, without looking into other file systems.

    A mount counts as an empty folder. Bytecode caches of Python are left out.
    """
    files: list[str] = []
    empty: list[str] = []
    try:
        device = os.stat(root).st_dev
    except OSError:
        return files, empty
    waiting = [root]
    while waiting:
        folder = waiting.pop()
        count = len(files) + len(waiting) + len(empty)
        with contextlib.suppress(OSError), os.scandir(folder) as entries:
            for entry in entries:
                if not entry.is_dir(follow_symlinks=False):
                    files.append(entry.path)
                elif entry.stat(follow_symlinks=False).st_dev != device or os.path.ismount(entry.path):
                    empty.append(entry.path)
                elif entry.name != BYTECODE:
                    waiting.append(entry.path)
        if len(files) + len(waiting) + len(empty) == count and folder != root:
            empty.append(folder)
    return sorted(files), sorted(empty)


def copy_others_of_merged(layout: Layout, owned: Iterable[str]) -> None:
    """Copy what is in a merged prefix without being `owned`, once for all packages of a build.

    Without lists of installed files, another tool or an older forge installed the packages, and the
    owners of files are unknown.
    """
    base, folder = str(layout.install), _shared_others(layout)
    lists = (layout.install / INSTALLED_LISTS_DIR).glob("*.json")
    listed = {
        path for file in lists if (found := _read_list(file, base)) for path in (*found.files, *found.folders)
    }
    files, empty = foreign_entries(base) if listed or not (layout.install / PACKAGES).is_dir() else ([], [])
    listed.update(owned)
    foreign = [
        path
        for path in (*files, *empty)
        if path not in listed and path[len(base) + 1 :].partition("/")[0] not in _OF_BASE
    ]
    if foreign:
        _copy_all(folder, foreign, all_kinds=True)


def drop_others_of_merged(layout: Layout) -> None:
    """Remove these copies at the end of a build."""
    remove_tree(str(_shared_others(layout)))


def _shared_others(layout: Layout) -> Path:
    return layout.install / BACKUP_DIR / ".others"


def remove_empty_tree(path: str) -> None:
    """Remove a folder with folders only; raises OSError if it contains a file."""
    for folder, _, _ in os.walk(path, topdown=False):
        os.rmdir(folder)


def _scripts(share: Path) -> Iterator[str]:
    """Yield the files that colcon and earlier versions of forge wrote for a package without listing them."""
    files = (*share.glob("package.*"), *(share / "hook").glob("*"))
    return (str(path) for path in files if path.suffix in _SCRIPTS)


def _list_file(name: str, layout: Layout) -> Path:
    return layout.install / INSTALLED_LISTS_DIR / f"{name}.json"


def _folder(name: str, layout: Layout, kind: str = "") -> Path:
    """Return an entry of a package in the backup folder; package names contain no dots."""
    return layout.install / BACKUP_DIR / (f"{name}.{kind}" if kind else name)


def _rename(path: str, target: str) -> None:
    """Rename a file; copy it if the target is on another file system."""
    try:
        os.replace(path, target)
    except OSError as error:
        if not os.path.lexists(path) or error.errno != errno.EXDEV:
            raise
        shutil.move(path, target)


def _remove_empty(path: str, root: str, kept: Collection[str] = ()) -> None:
    """Remove the folder of a file if it is empty except for bytecode, and parents that become empty."""
    folder = os.path.dirname(path)
    while folder.startswith(f"{root}/") and folder not in kept:
        try:
            with os.scandir(folder) as entries:
                if all(entry.name == BYTECODE for entry in entries):
                    for cached in Path(folder, BYTECODE).glob("*.pyc*"):
                        cached.unlink()
                    with contextlib.suppress(FileNotFoundError):
                        os.rmdir(f"{folder}/{BYTECODE}")
            os.rmdir(folder)
        except OSError:
            return
        folder = os.path.dirname(folder)


def _parents(path: str, root: str) -> Iterator[str]:
    """Yield the folders between a file and a folder that contains it."""
    while (path := os.path.dirname(path)).startswith(f"{root}/"):
        yield path


def _status(path: str) -> os.stat_result | None:
    try:
        return os.lstat(path)
    except OSError:
        return None


_INODE, _MODE = 2, 3
"""Indexes in `_stats`."""


def _stats(path: str) -> list[int]:
    """Return what tells whether a file was written: time, size, inode and mode."""
    status = _status(path)
    return [status.st_mtime_ns, status.st_size, status.st_ino, status.st_mode] if status else []


def _copy_all(folder: Path, paths: Iterable[str], *, all_kinds: bool = False) -> None:
    """Copy files to the backup, unless an older backup still exists.

    With `all_kinds`, which are those of others, list folders, too, and copy large files: a step that writes
    to a file in place would also write to its hard link.
    """
    if (folder / _LIST).is_file():
        return
    remove_tree(str(folder))
    folder.mkdir(parents=True)
    kept = []
    for number, path in enumerate(paths):
        with contextlib.suppress(FileNotFoundError, NotADirectoryError, IsADirectoryError):
            status = os.lstat(path)
            if stat.S_ISREG(status.st_mode) or stat.S_ISLNK(status.st_mode):
                _copy(Path(path), folder / str(number), linked=not all_kinds and status.st_size > _SMALL)
            elif all_kinds and not stat.S_ISDIR(status.st_mode):
                with contextlib.suppress(OSError):  # another file system: no copy of a socket or pipe
                    os.link(path, folder / str(number))
            elif not all_kinds:
                continue  # not installed by a build: the installed file is gone
            kept.append((str(number), path, *_stats(path)))
    replace_file(folder / _LIST, json.dumps(kept).encode())


def blocking_paths(task: Task, layout: Layout) -> Iterator[Problem]:
    """Yield a problem for each file at the path of a required folder, and vice versa, and for foreign links.

    CMake installs a file *into* a folder of the same name without an error.
    """
    name = task.name
    for kind, folder in (("build", task.build_dir), ("install", task.prefix)):
        if os.path.lexists(folder) and not folder.is_dir():
            hint = f"remove it, or choose another folder with '--{kind}-base'"
            yield Problem(f"the {kind} folder '{folder}' of '{name}' is a file", hint=hint)
    if not task.earlier or leftover_backups(name, layout):
        return  # the latter: a killed build may have created it
    listed = read_installed_list(name, layout)
    files = {path for path in (listed.files if listed else task.earlier) if not path.endswith("/")}
    for path in sorted(files & {*mount_points()}):
        yield Problem(f"something is mounted on '{path}', which '{name}' installed", hint="unmount it")
    parents = {parent for path in files for parent in _parents(path, str(task.prefix))}
    for path in sorted(files - parents):
        if os.path.isdir(path) and not os.path.islink(path):
            hint = "move or remove it"
            yield Problem(f"'{path}', installed as a file by '{name}', is now a folder", hint=hint)
    links = dict(listed.links) if listed else {}
    for path in sorted(parents - files):
        if os.path.lexists(path) and not os.path.isdir(path):
            hint = "move or remove it"
            yield Problem(f"'{path}', where '{name}' installed files, is no longer a folder", hint=hint)
        elif listed and os.path.islink(path) and os.readlink(path) != links.get(path):
            target = os.path.realpath(path)
            message = f"'{path}', where '{name}' installed files, is now a link to '{target}'"
            yield Problem(message, hint="move or remove the link")


def _restore_copies(folder: Path) -> bool:
    """Restore the copied files that have changed; return False if a copy is unusable."""
    complete = True
    for number, path, modified, size, *_ in _listed(folder):
        status = os.lstat(folder / number)
        if (status.st_mtime_ns, status.st_size) != (modified, size):
            complete = False  # hard-linked, and then overwritten in place
        else:
            _restore_copy(folder / number, Path(path))
    return complete


def _listed(folder: Path) -> list[tuple[Any, ...]]:
    try:
        return [tuple(entry) for entry in json.loads((folder / _LIST).read_bytes())]
    except (OSError, ValueError, RecursionError):
        return []


def _copy(source: Path, target: Path, *, linked: bool) -> None:
    if linked:
        with contextlib.suppress(OSError):  # another file system
            target.hardlink_to(source)
            return
    shutil.copy2(source, target, follow_symlinks=False)


def _leads_out(path: str, base: str) -> bool:
    """Tell whether a link leads out of a folder; `base` has no links."""
    return os.path.islink(path) and not f"{os.path.realpath(path)}/".startswith(f"{base}/")


def _is_no_folder(path: str) -> bool:
    return os.path.lexists(path) and not os.path.isdir(path)


def _is_same_file(path: str, other: Path) -> bool:
    if os.path.islink(path) or other.is_symlink():
        return os.path.islink(path) and other.is_symlink() and os.readlink(path) == os.readlink(other)
    return os.path.isfile(path) and other.is_file() and filecmp.cmp(path, other, shallow=False)


def _begins_with(path: str, other: Path) -> bool:
    """Tell whether a file contains another one, perhaps with more at its end."""
    try:
        with open(path, "rb") as now, other.open("rb") as then:
            return all(now.read(len(part)) == part for part in iter(partial(then.read, _CHUNK), b""))
    except OSError:
        return False


def _give_back(path: str, status: Sequence[int], kept: Path) -> None:
    """Restore an entry of somebody else; of a folder, only its path and mode are known.

    A file that was written in place is restored in place: it may have other names, or be mounted here.
    """
    now = _stats(path)
    if now and stat.S_ISREG(now[_MODE]) and now[_INODE] == status[_INODE]:
        with contextlib.suppress(PermissionError):
            shutil.copyfile(kept, path)
            shutil.copystat(kept, path)
            return
    if os.path.lexists(kept):
        _restore_copy(kept, Path(path))
    elif stat.S_ISDIR(status[_MODE]):
        os.makedirs(path, exist_ok=True)
        os.chmod(path, stat.S_IMODE(status[_MODE]))


def _restore_copy(kept: Path, path: Path) -> None:
    """Restore a file unless it is unchanged."""
    status = kept.lstat()
    with contextlib.suppress(OSError):
        now = path.lstat()
        if now.st_ino == status.st_ino:
            return
    # Anything else at this path was created by the failed build.
    if path.is_dir() and not path.is_symlink():
        remove_empty_tree(str(path))
    for folder in path.parents:
        if folder.is_dir():
            break
        folder.unlink(missing_ok=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.name}.forge-draft")
    draft.unlink(missing_ok=True)
    _copy(kept, draft, linked=not kept.is_symlink())
    draft.replace(path)
