"""Exchange the files of a package in its prefix: all come from the last successful build, or from the new.

A package is always installed as if built for the first time. Before its build, the files that forge installed
are moved aside, so that the build does not find them and obsolete ones do not remain. If it fails or is
interrupted, they are moved back; after a kill, the next build begins from them.

forge owns only the files that it installed. Each prefix has a list of these files with their contents; files
that several packages installed, and those outside the prefix, are copied instead of moved. All other entries
are unowned: they stay in place and are copied as well, since a step of the package could overwrite them.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import shutil
import stat
from collections import Counter
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forge.base.errors import Problem
from forge.base.files import BYTECODE, mount_points, read_json, remove_tree, replace_file, tree_below
from forge.base.layout import BACKUP_DIR, INSTALL_BASE_FILES, INSTALLED_LISTS_DIR, LOCK_FILE, Layout
from forge.build.copies import (
    MODE,
    Copies,
    begins_with,
    foreign_entries,
    give_back,
    is_folder,
    keep_beside,
    remove_empty_tree,
    stats_of,
    status_of,
)
from forge.build.installed_lists import (
    MANIFESTS,
    InstalledList,
    add_unclaimed,
    edited,
    folders_above,
    identity_now,
    list_file,
    package_markers,
    read_installed_list,
    read_list,
)
from forge.build.observed_writes import ObservedWrites, append, begin_log, read_writes, remove_log
from forge.environment.prefixes import PACKAGES

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping

    from forge.build.tasks import Task

_OF_BASE = frozenset({*INSTALL_BASE_FILES, BACKUP_DIR, INSTALLED_LISTS_DIR, LOCK_FILE})
"""Files that forge and colcon write at the top of an install folder."""
_SCRIPTS = frozenset({".bash", ".bat", ".dsv", ".fish", ".ps1", ".sh", ".zsh"})


def written_log(name: str, layout: Layout) -> Path:
    """Return the log of the writes of a package's steps below its prefix."""
    return _folder(name, layout, "written")


def stage_folder(name: str, layout: Layout) -> Path:
    """Return the folder, on the file system of the prefix, for installing a package again."""
    return Path(os.path.realpath(layout.install)) / BACKUP_DIR / f"{name}.stage"


def guarded_links(name: str, layout: Layout) -> Path:
    """Return the list of links in a prefix through which the steps of a package must not write."""
    return _folder(name, layout, "links")


def leftover_backups(name: str, layout: Layout) -> list[Path]:
    """Return the backups of a package that a killed build left behind."""
    folder = _folder(name, layout)
    return [path for path in (folder, *sorted(folder.parent.glob(f"{name}.*"))) if path.exists()]


def tidy(layout: Layout) -> None:
    """Remove the backup folder if it is empty."""
    with contextlib.suppress(OSError):
        os.rmdir(layout.install / BACKUP_DIR)


class PrefixExchange:
    """The exchange of one package's files; its state is on disk, so that a later build can continue it.

    A build uses one object per package. In the backup folder are, for a package P: `P`, the moved files;
    `P.part`, the same while they are being moved; `P.copies`, the copies of shared files; `P.others`, those
    of unowned files; `P.state`, the folders before the build; `P.list`, the list of files before the build;
    `P.written`, the log of the writes of the steps; `P.links`, the links through which they must not write.
    """

    def __init__(self, name: str, layout: Layout) -> None:
        self._name = name
        self._layout = layout
        self._prefix = str(layout.prefix(name))
        self.markers = package_markers(name, layout)
        """The files that mark the package as installed."""
        self._log = written_log(name, layout)
        self._moved, self._part, self._state, self._list = (
            _folder(name, layout, kind) for kind in ("", "part", "state", "list")
        )
        self._copies = Copies(_folder(name, layout, "copies"))
        self._others = _others_of_merged(layout) if layout.merged else Copies(_folder(name, layout, "others"))
        self._is_first = False
        """Whether nothing was installed before this build."""
        self._known_state: Mapping[str, Any] | None = None
        self._known_entries: dict[str, list[int]] | None = None

    def begin(
        self, earlier: Collection[str], shared: Collection[str] = (), *, runs_steps: bool = True
    ) -> tuple[Problem, ...]:
        """Move the package's files aside, unless a killed build has done so.

        Return a problem for each unowned file that the killed build may have changed.

        `earlier` are the files of earlier builds in records and install manifests, as absolute paths; other
        packages also installed the `shared` ones. Unless it `runs_steps`, forge alone is going to write.
        """
        # A list or a killed build may tell of files in a prefix that does not exist.
        kinds = ("", ".part", ".state", ".list", ".copies", ".others", ".stage")
        traces = (*(f"{self._moved}{kind}" for kind in kinds), str(list_file(self._name, self._layout)))
        if not (self._layout.merged or earlier or any(map(os.path.lexists, (self._prefix, *traces)))):
            self._is_first = True
            self._note_state(())
            self._moved.mkdir()
            begin_log(self._log, observed=runs_steps)
            return ()
        installed_list = read_installed_list(self._name, self._layout)
        listed = installed_list or InstalledList({})
        # After a kill, install manifests may name files that a step had not yet written.
        earlier = self.moved_files() if self._moved.is_dir() else earlier
        # Before its first build, a package owns no files.
        markers = self.markers if installed_list or earlier or self._is_installed() else ()
        files = dict.fromkeys((*listed.files, *earlier, *markers))
        if markers and not installed_list:
            # colcon and earlier versions of forge wrote scripts without listing them.
            share = Path(self._prefix, "share", self._name)
            scripts = (*share.glob("package.*"), *(share / "hook").glob("*"))
            files.update(dict.fromkeys(str(path) for path in scripts if path.suffix in _SCRIPTS))
        for path in listed.unclaimed:
            files.pop(path, None)
        folders = listed.folders
        movable = [path for path in files if path.startswith(f"{self._prefix}/") and path not in shared]
        if staying := files.keys() - set(movable):
            self._copies.make(sorted(staying))
        problems = self._recover()
        if not self._moved.is_dir():
            self._note_state((*movable, *folders))
        self._move_aside(movable, folders)
        begin_log(self._log, observed=runs_steps)
        if not self._layout.merged:
            # The remaining files are unowned, and a step could overwrite them.
            files_of_others, empty = foreign_entries(self._prefix)
            if files_of_others or empty:
                self._others.make((*files_of_others, *empty), of_others=True)
        self._known_entries = None
        self._guard_links()
        return problems

    def _is_installed(self) -> bool:
        return os.path.lexists(f"{self._prefix}/{PACKAGES}/{self._name}")

    def moved_files(self) -> dict[str, tuple[str, os.stat_result]]:
        """Return the path of the backup and its stat for each file of the last build, by its path."""
        if self._is_first:
            return {}
        cut = len(str(self._moved))
        backups = {
            f"{self._prefix}{path[cut:]}": (path, status) for path, status in tree_below(str(self._moved))[0]
        }
        for copy, path, _ in self._copies.entries():
            backups[path] = (str(copy), copy.lstat())
        return backups

    def copied_files(self) -> frozenset[str]:
        return frozenset() if self._is_first else frozenset(path for _, path, _ in self._copies.entries())

    def others(self) -> dict[str, list[int]]:
        """Return the stats of the entries that were in the prefix before the build and belong to others."""
        if self._known_entries is None:
            entries = () if self._is_first else self._others.entries()
            self._known_entries = {path: status for _, path, status in entries}
        return self._known_entries

    def writes(self) -> ObservedWrites:
        return read_writes(self._log, Path(self._prefix))

    def in_the_way(self, paths: Iterable[str]) -> Iterator[Problem]:
        entries, unclaimed = self._known_others()
        others = {path for path in entries if os.path.lexists(path)}
        if not others:
            return
        above = {parent: path for path in others for parent in folders_above(path, self._prefix)}
        base = os.path.realpath(self._layout.install)
        blocked_paths: dict[str, str] = {}
        for path in sorted(paths):
            blocking = next(
                (other for other in (path, *folders_above(path, self._prefix)) if other in others), None
            )
            passes = blocking and blocking != path and os.path.isdir(blocking)
            if blocking == path and path in unclaimed:
                continue
            if blocking and not (passes and not _leads_out(blocking, base)):
                blocked_paths.setdefault(blocking, path)
            elif path in above:
                blocked_paths.setdefault(above[path], path)
        for blocking, path in blocked_paths.items():
            yield self._problem(path, blocking)

    def announce(self, paths: Iterable[str]) -> None:
        """Log files that forge is about to write, so that they are known after a kill."""
        append(str(self._log), *(b"W" + os.fsencode(path) for path in paths))

    def overwritten(self, installed: Iterable[str]) -> Iterator[Problem]:
        """Restore unowned files that the package replaced (yield a problem for each) or removed."""
        others, unclaimed = self._known_others()
        if not others:
            return
        yield from self.refused()
        copies = {path: copy for copy, path, _ in self._others.entries()}
        for path in sorted(set(installed)):
            if path in others and path not in unclaimed and stats_of(path) != others[path]:
                give_back(path, others[path], copies[path])
                yield self._problem(path, path)
            elif is_folder(path):
                below = next((other for other in sorted(others) if other.startswith(f"{path}/")), None)
                if below:
                    yield self._problem(path, below)
        writes = self.writes()
        for path in sorted(others) if writes.removed else ():
            if not os.path.lexists(path) and writes.take_away(path):
                above = folders_above(path, self._prefix)
                blocking = [each for each in above if os.path.lexists(each) and not os.path.isdir(each)]
                give_back(path, others[path], copies[path])
                if blocking:
                    yield self._problem(blocking[0], path)

    def folders_of_others(self, listed: Iterable[str]) -> Iterator[Problem]:
        """Yield a problem for each file that CMake put into a folder of its name, of another package."""
        folders = [path for path in listed if is_folder(path)] if self._layout.merged else []
        own = list_file(self._name, self._layout)
        for file in own.parent.glob("*.json") if folders else ():
            other = read_list(file, self._prefix) if file != own else None
            for path, below in product(folders, other.files if other else ()):
                if below.startswith(f"{path}/") and os.path.lexists(below):
                    message = f"'{self._name}' installs the file '{path}', and '{file.stem}' has '{below}'"
                    command = self._layout.command(f"clean packages {file.stem}")
                    hint = f"if '{file.stem}' no longer installs it: '{command}', then build again"
                    yield Problem(message, hint=hint)
                    break

    def refused(self) -> Iterator[Problem]:
        """Yield a problem for each unowned link through which a step tried to write."""
        others, refused_paths = self.others(), dict[str, str]()
        for path in sorted(self.writes().refused):
            link = next(
                (place for place in (path, *folders_above(path, self._prefix)) if place in others), None
            )
            if link:
                refused_paths.setdefault(link, path)
        for link, path in refused_paths.items():
            yield self._problem(path, link)

    def commit(self) -> tuple[Problem, ...]:
        """Drop the backup, once the new files are listed.

        Return a problem for each edited file that the package no longer installs, which is restored, and for
        unowned files that it may have changed.
        """
        if self._is_first:
            self._moved.rmdir()
            remove_log(self._log)
            self._state.unlink()
            return ()
        listed = read_list(self._list, str(self._layout.install))
        problems = [*self._keep_changed()]
        cut = len(str(self._moved))
        for path, _ in tree_below(str(self._moved))[0]:
            original = f"{self._prefix}{path[cut:]}"
            if listed is None or os.path.lexists(original) or original not in listed.files:
                continue
            if identity_now(path) != listed.files[original]:
                os.makedirs(os.path.dirname(original), exist_ok=True)
                os.rename(path, original)
                problems.append(edited(original, self._name))
        self._drop()
        return tuple(problems)

    def roll_back(self) -> tuple[Problem, ...]:
        """Remove the files that the build has written, and move the package's files back.

        Return a problem for each unowned file that the build may have changed.
        """
        if self._part.is_dir():
            self._move_back(self._part)
        self._remove_written()
        problems = self._keep_changed()
        for manifest in MANIFESTS:
            (self._layout.build_dir(self._name) / manifest).unlink(missing_ok=True)
        if self._moved.is_dir():
            self._move_back(self._moved)
        for path, mode in self._noted("folders").items():
            if not os.path.lexists(path):
                os.makedirs(path, exist_ok=True)
            if is_folder(path):
                os.chmod(path, mode)
        self._copies.restore()
        if self._list.is_file():
            list_file(self._name, self._layout).parent.mkdir(exist_ok=True)  # may be gone
            self._list.replace(list_file(self._name, self._layout))
        elif self._state.is_file():
            list_file(self._name, self._layout).unlink(missing_ok=True)
        self._note_leftovers()
        if not self._layout.merged and not self._noted("state").get("existed", True):
            with contextlib.suppress(OSError):
                os.rmdir(self._prefix)
        self._drop()
        return problems

    def _note_leftovers(self) -> None:
        """Let the next build replace files of unknown owners that a step may have written unobserved."""
        if self.writes().complete:
            return
        listed = read_installed_list(self._name, self._layout) or InstalledList({})
        known = {*self.others(), *self._of_other_packages(), *listed.files}
        skip = len(str(self._layout.install)) + 1
        left = [
            path
            for path, _ in tree_below(self._prefix)[0]
            if path not in known and path[skip:].partition("/")[0] not in _OF_BASE
        ]
        if left:
            add_unclaimed(self._name, self._layout, left)

    def _keep_changed(self) -> tuple[Problem, ...]:
        """Keep the earlier contents of unowned files that an unobserved step may have changed.

        Their owner may have changed them instead, so the new contents are kept, too. Appended content does
        not count as a change. Where no step is observed, files in a merged prefix may be the package's own,
        which no manifest lists.
        """
        others, unclaimed = self._known_others()
        writes = self.writes() if others else ObservedWrites(complete=True)
        if writes.complete or (self._layout.merged and not writes.started):
            return ()
        problems = []
        for copy, path, status in self._others.entries():
            is_known = path in unclaimed or path in writes.files or stats_of(path) == status
            if is_known or not stat.S_ISREG(status[MODE]) or begins_with(path, copy):
                continue
            if beside := keep_beside(copy, path):
                message = f"'{path}' changed during the build of '{self._name}', which could not be observed"
                problems.append(Problem(message, hint=f"its earlier content is in '{beside}'"))
        return tuple(problems)

    def _drop(self) -> None:
        others = () if self._layout.merged else (self._others.folder,)
        for folder in (self._moved, self._copies.folder, *others):
            if folder.is_dir():
                trash = Path(f"{folder}.trash")
                remove_tree(str(trash))
                folder.rename(trash)
                remove_tree(str(trash))
        remove_log(self._log)
        for file in (self._state, self._list, guarded_links(self._name, self._layout)):
            file.unlink(missing_ok=True)

    def _recover(self) -> tuple[Problem, ...]:
        """Continue after a kill: remove the files that the killed build wrote, or undo a partial move."""
        problems: tuple[Problem, ...] = ()
        remove_tree(str(stage_folder(self._name, self._layout)))
        remove_tree(f"{self._moved}.trash")
        if self._part.is_dir():
            # Killed while moving: all files are still those of the last successful build.
            self._move_back(self._part)
        if self._moved.is_dir():
            self._remove_written()
            problems = self._keep_changed()
            if not self.writes().complete:
                # It is unknown which files were written by the killed build.
                noted = {
                    "state": {**self._noted("state"), "listed": False},
                    "folders": self._noted("folders"),
                }
                self._write_state(noted)
        if not self._layout.merged:
            remove_tree(str(self._others.folder))
            self._known_entries = None
        return problems

    def _remove_written(self) -> None:
        """Remove the files that the steps wrote below the prefix; restore other files that they overwrote."""
        writes = self.writes()
        others = {**self.others(), **(self._of_other_packages() if writes.files else {})}
        make_writable(self._folders_of((*writes.files, *(f"{path}/" for path in writes.folders))))
        for path in sorted(writes.files):
            if path in others or not path.startswith(f"{self._prefix}/"):
                continue
            with contextlib.suppress(FileNotFoundError, NotADirectoryError, IsADirectoryError):
                os.unlink(path)
                remove_empty_folders(path, self._prefix, others)
        for path in sorted(writes.folders, reverse=True):
            if path not in others and path.startswith(f"{self._prefix}/"):
                remove_empty_folders(f"{path}/x", self._prefix, others)
        for copy, path, status in self._others.entries():
            if stats_of(path) != status and (
                path in writes.files or (not os.path.lexists(path) and writes.take_away(path))
            ):
                give_back(path, status, copy)

    def _of_other_packages(self) -> dict[str, list[int]]:
        """Return the files that other packages have installed into the same prefix."""
        if not self._layout.merged:
            return {}
        own = list_file(self._name, self._layout)
        lists = (read_list(file, self._prefix) for file in own.parent.glob("*.json") if file != own)
        return {path: [] for listed in lists if listed for path in listed.files}

    def _note_state(self, paths: Iterable[str]) -> None:
        """Record the package's folders, which may become empty and be removed, with their permissions."""
        folders: dict[str, int | None] = {}
        for path in paths:
            for folder in (path.rstrip("/"), *self._folders_of([path])):
                if folder not in folders:
                    status = status_of(folder)
                    is_folder = status is not None and stat.S_ISDIR(status.st_mode)
                    folders[folder] = stat.S_IMODE(status.st_mode) if status and is_folder else None
        modes = {path: mode for path, mode in folders.items() if mode is not None}
        state = {
            "existed": os.path.lexists(self._prefix),
            "listed": not self._is_installed() or list_file(self._name, self._layout).exists(),
        }
        data = {"state": state, "folders": modes}
        with contextlib.suppress(FileNotFoundError):
            replace_file(self._list, list_file(self._name, self._layout).read_bytes())
        self._write_state(data)

    def _write_state(self, data: Mapping[str, Any]) -> None:
        replace_file(self._state, json.dumps(data).encode())
        self._known_state = data

    def _noted(self, key: str) -> Mapping[str, Any]:
        if self._known_state is None:
            self._known_state = read_json(self._state)
        value = self._known_state.get(key)
        return value if isinstance(value, dict) else {}

    def _folders_of(self, paths: Iterable[str]) -> Iterator[str]:
        """Yield the folders of the prefix that contain these files or, if they end with '/', folders."""
        return (folder for path in paths for folder in (*folders_above(path, self._prefix), self._prefix))

    def _move_aside(self, paths: Iterable[str], folders: Collection[str]) -> None:
        """Move files out of the prefix, and remove folders that become empty."""
        target = self._moved if self._moved.is_dir() else self._part
        target.mkdir(parents=True, exist_ok=True)
        cut, parents, emptied = len(self._prefix), {str(target)}, set()
        paths = sorted(paths)
        make_writable(self._folders_of((*paths, *folders)))
        for path in paths:
            aside = f"{target}{path[cut:]}"
            parent = os.path.dirname(aside)
            with contextlib.suppress(FileNotFoundError, NotADirectoryError):
                status = os.lstat(path)
                if stat.S_ISDIR(status.st_mode):
                    continue
                if os.path.lexists(aside):
                    os.unlink(path)
                else:
                    if parent not in parents:
                        os.makedirs(parent, exist_ok=True)
                        parents.add(parent)
                    _rename(path, aside)
                emptied.add(os.path.dirname(path))
        for folder in sorted({*emptied, *folders}, reverse=True):
            remove_empty_folders(f"{folder}/x", self._prefix)
        if emptied and not self._layout.merged and not os.path.islink(self._prefix):
            with contextlib.suppress(OSError):  # in use
                os.rmdir(self._prefix)
        if target is self._part:
            self._part.rename(self._moved)

    def _move_back(self, source: Path) -> None:
        """Move files to their original paths, replacing the build's, but no file of another package."""
        others, installed = self.others(), self._of_other_packages()
        cut, backups = len(str(source)), [path for path, _ in tree_below(str(source))[0]]
        make_writable(self._folders_of(f"{self._prefix}{path[cut:]}" for path in backups))
        for path in backups:
            destination = f"{self._prefix}{path[cut:]}"
            if destination in installed and os.path.lexists(destination):
                continue
            for parent in reversed([*folders_above(destination, self._prefix)]):
                if os.path.lexists(parent) and not os.path.isdir(parent) and parent not in others:
                    os.unlink(parent)
            os.makedirs(os.path.dirname(destination), exist_ok=True)
            if is_folder(destination):
                remove_empty_tree(destination)
            _rename(path, destination)
        remove_tree(str(source))

    def _guard_links(self) -> None:
        """List unowned links out of the prefix: files behind them were not copied."""
        file = guarded_links(self._name, self._layout)
        file.unlink(missing_ok=True)
        others, unclaimed = self._known_others()
        base = os.path.realpath(self._layout.install)
        links = [
            path
            for path, status in others.items()
            if stat.S_ISLNK(status[MODE]) and path not in unclaimed and _leads_out(path, base)
        ]
        if links:
            real = os.path.realpath(self._prefix)
            spelled = {*links, *(f"{real}{path[len(self._prefix) :]}" for path in links)}
            file.write_bytes(b"".join(b"%s\0" % os.fsencode(path) for path in sorted(spelled)))

    def unclaimed(self) -> Collection[str]:
        """Return the files that may belong to the package, which was unknown before the build."""
        return self._known_others()[1]

    def _known_others(self) -> tuple[Mapping[str, list[int]], Collection[str]]:
        """Return the entries that certainly did not belong to the package, and those of unknown owners.

        It is unknown which files belong to a package that another tool or an older forge installed.
        """
        others = self.others() if self._noted("state").get("listed") else {}
        listed = read_list(self._list, str(self._layout.install)) if others else None
        return others, listed.unclaimed if listed else frozenset()

    def _problem(self, path: str, other: str) -> Problem:
        message = (
            f"'{self._name}' installs '{path}', but forge did not install '{other}', which is in its place"
        )
        return Problem(message, hint=f"move '{other}' away, or install to another name, then build again")


def copy_others_of_merged(layout: Layout, owned: Iterable[str]) -> None:
    """Copy the entries of a merged prefix that are not `owned`, once for all packages of a build.

    Without lists of installed files, another tool or an older forge installed the packages, and the
    owners of files are unknown.
    """
    base = str(layout.install)
    lists = (layout.install / INSTALLED_LISTS_DIR).glob("*.json")
    listed = {
        path
        for file in lists
        if (installed_list := read_list(file, base))
        for path in (*installed_list.files, *installed_list.folders)
    }
    files, empty = foreign_entries(base) if listed or not (layout.install / PACKAGES).is_dir() else ([], [])
    listed.update(owned)
    foreign = [
        path
        for path in (*files, *empty)
        if path not in listed and path[len(base) + 1 :].partition("/")[0] not in _OF_BASE
    ]
    if foreign:
        _others_of_merged(layout).make(foreign, of_others=True)


def drop_others_of_merged(layout: Layout) -> None:
    remove_tree(str(_others_of_merged(layout).folder))


def _others_of_merged(layout: Layout) -> Copies:
    return Copies(layout.install / BACKUP_DIR / ".others")


def _folder(name: str, layout: Layout, kind: str = "") -> Path:
    """Return an entry of a package in the backup folder; package names contain no dots."""
    return Path(f"{layout.install}/{BACKUP_DIR}/{name}{kind and '.'}{kind}")


def _rename(path: str, target: str) -> None:
    """Rename a file; copy it if the target is on another file system."""
    try:
        os.replace(path, target)
    except OSError as error:
        if not os.path.lexists(path) or error.errno != errno.EXDEV:
            raise
        shutil.move(path, target)


_removals: Counter[str] = Counter()


def removed_folders(prefix: Path) -> int:
    """Return how many folders of a prefix this process has removed because they were empty."""
    return _removals[str(prefix)]


def make_writable(folders: Iterable[str]) -> dict[str, int]:
    """Let the user change the entries of his folders, which packages may install without write permission.

    Return the modes of those that did not allow it.
    """
    modes: dict[str, int] = {}
    for folder in sorted({*folders}):  # parents first
        status = status_of(folder)
        if status and stat.S_ISDIR(status.st_mode) and not os.access(folder, os.W_OK | os.X_OK):
            with contextlib.suppress(OSError):  # of another user
                os.chmod(folder, stat.S_IMODE(status.st_mode) | stat.S_IRWXU)
                modes[folder] = stat.S_IMODE(status.st_mode)
    return modes


def remove_empty_folders(path: str, root: str, kept: Collection[str] = ()) -> None:
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
        _removals[root] += 1
        folder = os.path.dirname(folder)


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
        return  # the latter may come from a killed build
    listed = read_installed_list(name, layout)
    files = {path for path in (listed.files if listed else task.earlier) if not path.endswith("/")}
    for path in sorted(files & {*mount_points()}):
        yield Problem(f"something is mounted on '{path}', which '{name}' installed", hint="unmount it")
    folders = {os.path.dirname(path) for path in files}
    parents = {parent for folder in folders for parent in folders_above(f"{folder}/", str(task.prefix))}
    for path in () if task.intact else sorted(files - parents):
        if is_folder(path):
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


def _leads_out(path: str, base: str) -> bool:
    """Return whether a link leads out of a folder; `base` has no links."""
    return os.path.islink(path) and not f"{os.path.realpath(path)}/".startswith(f"{base}/")
