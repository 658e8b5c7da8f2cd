"""Watches source folders for changes.

Each folder is watched without its subfolders, because results of builds, version control and bytecode change
all the time. Events only trigger a build, which checks all files itself.
"""

from __future__ import annotations

import contextlib
import os
import time
from itertools import chain
from typing import TYPE_CHECKING

from forge.base.errors import Problem
from forge.base.frozen import frozen
from forge.base.layout import IGNORE_MARK
from forge.build.inputs.fingerprints import file_state, source_folders
from forge.workspace.identification import MARKER_FILES, ROS_IGNORE_FILES
from forge.workspace.source_names import is_environment, is_source, may_contain_packages

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from watchfiles.main import FileChange

    from forge.workspace.model import Workspace

STEP = 25
"""Milliseconds without events after which a change is complete: editors write, rename and remove at once."""

_LONGEST = 1000
"""Milliseconds after which a build starts despite further events, as during a long git checkout."""

_TIMEOUT = 200
"""Milliseconds between two timeouts of the library, each of which empties its queue of events.

Longer, fewer instants in which it could drop an event; shorter, a watch starts faster.
"""

_POLL = 500
"""Milliseconds between two checks when polling."""

_SECOND = 1.5
"""Seconds after which to check again when polling, which compares times in whole seconds."""

_ATTEMPTS = 10
_IGNORE_MARKERS = frozenset({IGNORE_MARK, *ROS_IGNORE_FILES})


@frozen
class WatchSpec:
    """The relevant changes in one folder: files with these names (None: all sources), and subfolders."""

    names: frozenset[str] | None = None
    folders: bool = True

    def joined(self, other: WatchSpec) -> WatchSpec:
        both = self.names is not None and other.names is not None
        return WatchSpec(self.names | other.names if both else None, self.folders or other.folders)  # type: ignore[operator]


def watch_specs(
    workspace: Workspace, base_paths: Iterable[str], files: Iterable[str], results: frozenset[str]
) -> dict[str, WatchSpec]:
    """Return the folders to watch: those of packages, and those in which packages may appear.

    `files` are further input files below the workspace; `results` are excluded. Raises OSError if a folder
    disappears meanwhile.
    """
    found: dict[str, WatchSpec] = {}
    root = str(workspace.root)

    def add(folder: str, spec: WatchSpec) -> None:
        found[folder] = found[folder].joined(spec) if folder in found else spec

    packages = [*workspace.packages.values(), *workspace.duplicates]
    homes = {os.path.normpath(os.path.join(root, package.path)) for package in packages}
    for home in sorted(homes):
        for folder, targets in source_folders(home):
            add(folder, WatchSpec())
            for target in targets:
                add(os.path.dirname(target), WatchSpec(frozenset({os.path.basename(target)}), folders=False))
    for base in base_paths:
        for folder, spec in _bare(os.path.normpath(os.path.join(root, base)), homes | results):
            add(folder, spec)
    for file in files:
        path = os.path.normpath(os.path.join(root, file))
        if os.path.isdir(os.path.dirname(path)):
            add(os.path.dirname(path), WatchSpec(frozenset({os.path.basename(path)}), folders=False))
    return found


def _bare(base: str, without: frozenset[str] | set[str]) -> Iterator[tuple[str, WatchSpec]]:
    """Yield the folders outside of packages that discovery searches; in ignored ones only markers count."""
    waiting, visited = [base], set()
    while waiting:
        folder = waiting.pop()
        try:
            status = os.stat(folder)
            with os.scandir(folder) as entries:
                inside = [(entry.name, entry.is_dir()) for entry in entries]
        except OSError:
            continue
        if folder in without or (status.st_dev, status.st_ino) in visited:
            continue
        visited.add((status.st_dev, status.st_ino))
        if folder != base and is_environment({name for name, _ in inside}.__contains__):
            continue
        if any(name in _IGNORE_MARKERS for name, _ in inside):
            yield folder, WatchSpec(_IGNORE_MARKERS, folders=False)
            continue
        yield folder, WatchSpec(MARKER_FILES)
        waiting += [f"{folder}/{name}" for name, below in inside if below and may_contain_packages(name)]


class FileWatcher:
    """Collects changes in the watched folders, also between two waits."""

    def __init__(self, warn: Callable[[Iterable[Problem]], object]) -> None:
        """Watch nothing yet; `warn` is called if the system's limits are exceeded."""
        self._warn = warn
        self.ignored_folders: frozenset[str] = frozenset()
        """Folders that forge itself writes to."""
        self._watched: Mapping[str, WatchSpec] = {}
        self._changes: Iterator[set[FileChange]] | None = None
        self.second_check = False
        """Whether the last wait ended without a change, because polling may have missed one."""
        self._polling = os.environ.get("WATCHFILES_FORCE_POLLING", "") not in {"", "0", "false"}

    @property
    def count(self) -> int:
        """Number of watched folders."""
        return len(self._watched)

    def watch(self, list_folders: Callable[[], Mapping[str, WatchSpec]]) -> None:
        """Watch the folders that `list_folders` returns; call it again if one disappears.

        Raises OSError if folders keep disappearing.
        """
        for _ in range(_ATTEMPTS):
            with contextlib.suppress(FileNotFoundError):
                self._watch(list_folders())
                return
            time.sleep(0.05)
        self._watch(list_folders())

    def _watch(self, watch_specs: Mapping[str, WatchSpec]) -> None:
        wanted = {folder: spec for folder, spec in watch_specs.items() if _can_be_watched(folder)}
        if self._changes is None or wanted.keys() != self._watched.keys():
            self._changes = self._begin(sorted(wanted))
        self._watched = wanted

    def wait(self) -> frozenset[str]:
        """Wait for relevant changes and return their paths; empty if the paths are unknown.

        Raises KeyboardInterrupt.
        """
        assert self._changes is not None
        due = time.monotonic() + _SECOND if self._polling and not self.second_check else float("inf")
        self.second_check = False
        while time.monotonic() < due:
            try:
                changes = next(self._changes)
            except RuntimeError:
                # A name is not valid UTF-8, or the queue overflowed: restart, and let a build check.
                self._changes = self._begin(sorted(self._watched))
                return frozenset()
            changed = frozenset(path for _, path in changes if self._counts(path))
            if changed:
                return changed
        self.second_check = True
        return frozenset()

    def states(self, changed: frozenset[str]) -> dict[str, str]:
        """Return the states of the changed files, when polling of everything, to compare them later."""
        paths = {*changed, *self._watched, *self._files()} if self._polling else changed
        return {path: file_state(path) for path in paths}

    def moves_folders(self, changed: frozenset[str]) -> bool:
        return not changed or any(
            path in self._watched
            or os.path.basename(path) in MARKER_FILES
            or os.path.islink(path)
            or os.path.isdir(path)
            for path in changed
        )

    def _files(self) -> Iterator[str]:
        """Yield the watched files, without folders."""
        for folder in self._watched:
            with contextlib.suppress(OSError), os.scandir(folder) as entries:
                yield from (e.path for e in entries if not e.is_dir() and self._counts(e.path))

    def _counts(self, path: str) -> bool:
        if path in self.ignored_folders:
            return False
        if path in self._watched:
            return self._watched[path].folders
        folder, name = os.path.split(path)
        spec = self._watched.get(folder)
        if spec is None or not is_source(name, lambda other: os.path.lexists(f"{folder}/{other}")):
            return spec is not None and name in _IGNORE_MARKERS
        if spec.names is None or name in spec.names:
            return True
        return spec.folders and os.path.isdir(path) and may_contain_packages(name)

    def _begin(self, folders: list[str]) -> Iterator[set[FileChange]]:
        """Watch these folders natively, or by polling if the system's limits are exceeded."""
        if not self._polling:
            try:
                return _changes_in(folders, polling=False)
            except FileNotFoundError:
                raise
            except (OSError, RuntimeError) as error:
                self._polling = True
                message = f"cannot watch {len(folders)} folders, polling twice a second instead: {error}"
                limits = "fs.inotify.max_user_watches=524288 fs.inotify.max_user_instances=1024"
                self._warn([Problem(message, hint=f"raise the limits: sudo sysctl {limits}")])
        return _changes_in(folders, polling=True)


def _changes_in(folders: list[str], *, polling: bool) -> Iterator[set[FileChange]]:
    """Watch folders from now on, and yield their changes; an empty set after a timeout without any."""
    from watchfiles import watch

    changes = watch(
        *folders,
        watch_filter=None,
        debounce=_LONGEST,
        step=STEP,
        rust_timeout=_TIMEOUT,
        yield_on_timeout=True,
        force_polling=polling,
        poll_delay_ms=_POLL,
        recursive=False,
    )
    # The generator starts to watch when the first item is requested.
    return chain((next(changes),), changes)


def _can_be_watched(folder: str) -> bool:
    """Tell whether a folder is readable and its name is valid UTF-8, as the library requires."""
    try:
        folder.encode()
    except UnicodeEncodeError:
        return False
    return os.access(folder, os.R_OK)
