"""Who saved what: the folders that sources lie in, and the wait for somebody to write there.

The folders are watched one by one, without what is below them: results of builds, version control and
bytecode are below them, too, and change all the time. A watch tells that something happened, never what
is to be done: the build that follows looks at all files itself.
"""

from __future__ import annotations

import contextlib
import os
import time
from typing import TYPE_CHECKING

from forge.digests import source_folders
from forge.errors import Problem
from forge.frozen import frozen
from forge.identification import IGNORE_MARK, ROS_MARKS, TELLING
from forge.source_names import is_source

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from watchfiles._rust_notify import RustNotify

    from forge.model import Workspace

STEP = 25
"""Milliseconds of silence after which a save is over: an editor writes, renames and removes in one go."""

_LONGEST = 1000
"""Milliseconds after which a build begins though somebody still writes, as git does in a long checkout."""

_POLL = 500
_SECOND = 1500
"""Milliseconds after which a second look is due where we poll: that compares times in whole seconds."""

_ATTEMPTS = 10
_MARKS = frozenset({IGNORE_MARK, *ROS_MARKS})


@frozen
class Interest:
    """What counts in one folder: files of these names (None: all sources), and folders or not."""

    names: frozenset[str] | None = None
    folders: bool = True

    def joined(self, other: Interest) -> Interest:
        """Return the interest of both."""
        both = self.names is not None and other.names is not None
        return Interest(self.names | other.names if both else None, self.folders or other.folders)  # type: ignore[operator]


def interests(
    workspace: Workspace, base_paths: Iterable[str], files: Iterable[str], results: frozenset[str]
) -> dict[str, Interest]:
    """Return the folders to watch: those of packages, and those where a package could appear.

    `files` are files below the workspace that say something, too; nobody looks into `results`.
    Raises OSError when one vanishes meanwhile.
    """
    found: dict[str, Interest] = {}
    root = str(workspace.root)

    def add(folder: str, interest: Interest) -> None:
        found[folder] = found[folder].joined(interest) if folder in found else interest

    packages = [*workspace.packages.values(), *workspace.twins]
    homes = {os.path.normpath(os.path.join(root, package.path)) for package in packages}  # noqa: PTH118  (as discovery spells it)
    for home in sorted(homes):
        for folder, targets in source_folders(home):
            add(folder, Interest())
            for target in targets:
                add(os.path.dirname(target), Interest(frozenset({os.path.basename(target)}), folders=False))  # noqa: PTH119, PTH120
    for base in base_paths:
        for folder, interest in _bare(os.path.normpath(os.path.join(root, base)), homes | results):  # noqa: PTH118
            add(folder, interest)
    for file in files:
        path = os.path.normpath(os.path.join(root, file))  # noqa: PTH118
        if os.path.isdir(os.path.dirname(path)):  # noqa: PTH112, PTH120
            add(os.path.dirname(path), Interest(frozenset({os.path.basename(path)}), folders=False))  # noqa: PTH119, PTH120
    return found


def _bare(base: str, without: frozenset[str] | set[str]) -> Iterator[tuple[str, Interest]]:
    """Yield the folders outside of packages that discovery looks into; in ignored ones the marks count."""
    waiting, visited = [base], set()
    while waiting:
        folder = waiting.pop()
        try:
            status = os.stat(folder)  # noqa: PTH116
            with os.scandir(folder) as entries:
                inside = [(entry.name, entry.is_dir()) for entry in entries]
        except OSError:
            continue
        if folder in without or (status.st_dev, status.st_ino) in visited:
            continue
        visited.add((status.st_dev, status.st_ino))
        if any(name in _MARKS for name, _ in inside):
            yield folder, Interest(_MARKS, folders=False)
            continue
        yield folder, Interest(TELLING)
        waiting += [f"{folder}/{name}" for name, below in inside if below and not name.startswith(".")]


class Saves:
    """What was written to in the folders that are watched; nothing is lost between two waits."""

    def __init__(self, warn: Callable[[Iterable[Problem]], object]) -> None:
        """Watch nothing yet; `warn` is told when the system lacks what watching takes."""
        self._warn = warn
        self.blind: frozenset[str] = frozenset()
        """Folders in which forge itself writes."""
        self._watched: Mapping[str, Interest] = {}
        self._notify: RustNotify | None = None
        self.second_look = False
        """Whether the last wait ended for no save, but because one may have been missed."""
        self._polling = os.environ.get("WATCHFILES_FORCE_POLLING", "") not in {"", "0", "false"}

    @property
    def count(self) -> int:
        """How many folders are watched."""
        return len(self._watched)

    def watch(self, look: Callable[[], Mapping[str, Interest]]) -> None:
        """Watch the folders that `look` names; it is asked again when one vanishes.

        Raises OSError when folders keep vanishing.
        """
        for _ in range(_ATTEMPTS):
            with contextlib.suppress(FileNotFoundError):
                self._watch(look())
                return
            time.sleep(0.05)
        self._watch(look())

    def _watch(self, interests: Mapping[str, Interest]) -> None:
        wanted = {folder: interest for folder, interest in interests.items() if _can_be_watched(folder)}
        if self._notify is None or wanted.keys() != self._watched.keys():
            self._notify = self._begin(sorted(wanted))
        self._watched = wanted

    def wait(self) -> frozenset[str]:
        """Return what was saved, once something was that counts; empty when something is all that is known.

        Raises KeyboardInterrupt.
        """
        assert self._notify is not None  # noqa: S101  (watch() comes first)
        due = self._polling and not self.second_look
        self.second_look = False
        while True:
            try:
                changes = self._notify.watch(_LONGEST, STEP, _SECOND if due else 0, None)
            except RuntimeError:
                # A name that is no UTF-8, or a queue that overflowed: begin anew, and let a build look.
                self._notify = self._begin(sorted(self._watched))
                return frozenset()
            if changes == "timeout":
                self.second_look = True
                return frozenset()
            if isinstance(changes, str):
                raise KeyboardInterrupt
            saved = frozenset(path for _, path in changes if self._counts(path))
            if saved:
                return saved

    def moves_folders(self, saved: frozenset[str]) -> bool:
        """Tell if other folders may have to be watched after this."""
        return not saved or any(
            path in self._watched
            or os.path.basename(path) in TELLING  # noqa: PTH119
            or os.path.islink(path)  # noqa: PTH114
            or os.path.isdir(path)  # noqa: PTH112
            for path in saved
        )

    def _counts(self, path: str) -> bool:
        if path in self.blind:
            return False
        if path in self._watched:
            return self._watched[path].folders
        folder, name = os.path.split(path)
        interest = self._watched.get(folder)
        if interest is None or not is_source(name, lambda other: os.path.lexists(f"{folder}/{other}")):
            return interest is not None and name in _MARKS
        if interest.names is None or name in interest.names:
            return True
        return interest.folders and os.path.isdir(path) and not name.startswith(".")  # noqa: PTH112

    def _begin(self, folders: list[str]) -> RustNotify:
        """Return a watch of these folders: the system's, or, where it has no more to give, one that looks."""
        from watchfiles._rust_notify import RustNotify  # noqa: PLC0415  (asked for now and then)

        if not self._polling:
            try:
                return RustNotify(folders, False, False, 0, False, False)  # noqa: FBT003  (as it takes them)
            except FileNotFoundError:
                raise
            except (OSError, RuntimeError) as error:
                self._polling = True
                self._warn([_short_of_watches(len(folders), error)])
        return RustNotify(folders, False, True, _POLL, False, False)  # noqa: FBT003


def _short_of_watches(count: int, error: Exception) -> Problem:
    return Problem(
        f"the system does not watch {count} folders for us, so forge looks twice a second: {error}",
        hint="allow more: sudo sysctl fs.inotify.max_user_watches=524288 fs.inotify.max_user_instances=1024",
    )


def _can_be_watched(folder: str) -> bool:
    """Tell if a folder may be read, and has a name that can be told to the library: it takes UTF-8 alone."""
    try:
        folder.encode()
    except UnicodeEncodeError:
        return False
    return os.access(folder, os.R_OK)
