"""Copies of files that a step of a package could overwrite, and how they are given back."""

from __future__ import annotations

import contextlib
import filecmp
import json
import os
import shutil
import stat
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.files import BYTECODE, remove_tree, replace_file
from forge.base.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

_LIST = "list.json"
_CHUNK = 1 << 20
_SMALL = 65536
"""The size in bytes up to which an installed file is copied; larger ones are hard-linked in constant time."""
INODE, MODE = 2, 3
"""Indexes in `stats_of`."""


@frozen
class Copies:
    """Copies in a folder, with a list of their paths and stats."""

    folder: Path

    def make(self, paths: Iterable[str], *, of_others: bool = False) -> None:
        """Copy files, unless older copies exist.

        Those `of_others` include folders, which are only listed, and large files: a step that writes to a
        file in place would also write to its hard link.
        """
        if (self.folder / _LIST).is_file():
            return
        remove_tree(str(self.folder))
        self.folder.mkdir(parents=True)
        kept = []
        for number, path in enumerate(paths):
            with contextlib.suppress(FileNotFoundError, NotADirectoryError, IsADirectoryError):
                status, target = os.lstat(path), self.folder / str(number)
                if stat.S_ISREG(status.st_mode) or stat.S_ISLNK(status.st_mode):
                    _copy(Path(path), target, linked=not of_others and status.st_size > _SMALL)
                elif of_others and not stat.S_ISDIR(status.st_mode):
                    with contextlib.suppress(OSError):  # another file system: no copy of a socket or pipe
                        target.hardlink_to(path)
                elif not of_others:
                    continue  # not installed by a build: the installed file is gone
                kept.append((str(number), path, *stats_of(path)))
        replace_file(self.folder / _LIST, json.dumps(kept).encode())

    def entries(self) -> Iterator[tuple[Path, str, list[int]]]:
        """Yield each copy, its path and the stats of the original; folders and some pipes have no copy."""
        with contextlib.suppress(OSError, ValueError, RecursionError):
            for number, path, *status in json.loads((self.folder / _LIST).read_bytes()):
                yield self.folder / number, path, status

    def restore(self) -> bool:
        """Restore the files that have changed; return False if a copy is unusable."""
        complete = True
        for copy, path, (modified, size, *_) in self.entries():
            status = copy.lstat()
            if (status.st_mtime_ns, status.st_size) != (modified, size):
                complete = False  # hard-linked, and then overwritten in place
            else:
                _restore_copy(copy, Path(path))
        return complete


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


def remove_empty_tree(path: str) -> None:
    """Remove a folder with folders only; raises OSError if it contains a file."""
    for folder, _, _ in os.walk(path, topdown=False):
        os.rmdir(folder)


def status_of(path: str) -> os.stat_result | None:
    """Return the stat of a file or link, None without one."""
    try:
        return os.lstat(path)
    except OSError:
        return None


def stats_of(path: str) -> list[int]:
    """Return what tells whether a file was written: time, size, inode and mode."""
    status = status_of(path)
    return [status.st_mtime_ns, status.st_size, status.st_ino, status.st_mode] if status else []


def is_same_file(path: str, other: Path) -> bool:
    """Tell whether two files have the same content, or two links the same target."""
    if os.path.islink(path) or other.is_symlink():
        return os.path.islink(path) and other.is_symlink() and os.readlink(path) == os.readlink(other)
    return os.path.isfile(path) and other.is_file() and filecmp.cmp(path, other, shallow=False)


def begins_with(path: str, other: Path) -> bool:
    """Tell whether a file contains another one, perhaps with more at its end."""
    try:
        with open(path, "rb") as now, other.open("rb") as then:
            return all(now.read(len(part)) == part for part in iter(partial(then.read, _CHUNK), b""))
    except OSError:
        return False


def give_back(path: str, status: Sequence[int], kept: Path) -> None:
    """Restore an entry of somebody else; of a folder, only its path and mode are known.

    A file that was written in place is restored in place: it may have other names, or be mounted here.
    """
    now = stats_of(path)
    if now and stat.S_ISREG(now[MODE]) and now[INODE] == status[INODE]:
        with contextlib.suppress(PermissionError):
            shutil.copyfile(kept, path)
            shutil.copystat(kept, path)
            return
    if os.path.lexists(kept):
        _restore_copy(kept, Path(path))
    elif stat.S_ISDIR(status[MODE]):
        os.makedirs(path, exist_ok=True)
        os.chmod(path, stat.S_IMODE(status[MODE]))


def keep_beside(copy: Path, path: str) -> str:
    """Keep a copy in a file with a free name beside its path; return this, '' if such a file exists."""
    name, number = f"{path}.before_build", 0
    while not is_same_file(name, copy):
        if not os.path.lexists(name):
            os.makedirs(os.path.dirname(name), exist_ok=True)
            _copy(copy, Path(name), linked=False)
            return name
        number += 1
        name = f"{path}.before_build{number}"
    return ""


def _copy(source: Path, target: Path, *, linked: bool) -> None:
    if linked:
        with contextlib.suppress(OSError):  # another file system
            target.hardlink_to(source)
            return
    shutil.copy2(source, target, follow_symlinks=False)


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
