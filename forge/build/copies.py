"""Backup copies of files that a build step could overwrite, and how they are restored."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import stat
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path

from forge.base.files import delete_tree, remove_tree, replace_file, tree_below
from forge.base.frozen import frozen

_LIST = "list.json"
_CHUNK = 1 << 20
INODE, MODE = 2, 3
"""Indexes in `stats_of`."""


@frozen
class Copies:
    """Copies in a folder, with a list of their paths and stats."""

    folder: Path

    def make(self, paths: Iterable[str], *, of_others: bool = False) -> None:
        """Copy files unless copies exist; `of_others`, also list folders and hard-link special files."""
        if (self.folder / _LIST).is_file():
            return
        remove_tree(str(self.folder))
        self.folder.mkdir(parents=True)
        entries = []
        for number, path in enumerate(paths):
            with contextlib.suppress(FileNotFoundError, NotADirectoryError, IsADirectoryError):
                status, target = os.lstat(path), self.folder / str(number)
                if stat.S_ISREG(status.st_mode) or stat.S_ISLNK(status.st_mode):
                    shutil.copy2(path, target, follow_symlinks=False)
                elif of_others and not stat.S_ISDIR(status.st_mode):
                    with contextlib.suppress(OSError):  # fails on another file system
                        target.hardlink_to(path)
                elif not of_others:
                    continue  # not installed by a build: the installed file no longer exists
                entries.append((str(number), path, *stats_of(path)))
        replace_file(self.folder / _LIST, json.dumps(entries).encode())

    def entries(self) -> Iterator[tuple[Path, str, list[int]]]:
        """Yield each copy, its path and the stats of the original; folders and some pipes have no copy."""
        with contextlib.suppress(OSError, ValueError, RecursionError):
            for number, path, *status in json.loads((self.folder / _LIST).read_bytes()):
                yield self.folder / number, path, status

    def restore(self) -> None:
        """Restore the files whose contents or times have changed."""
        for copy, path, status in self.entries():
            if stats_of(path) != status or not is_same_file(path, copy):
                give_back(path, status, copy)


def foreign_entries(root: str) -> tuple[list[str], list[str]]:
    """Return the files and the empty folders below a folder, without looking into other file systems."""
    status = status_of(f"{root}/")
    files, empty = tree_below(root, status.st_dev) if status else ([], [])
    return sorted(path for path, _ in files), sorted(empty)


def remove_empty_tree(path: str) -> None:
    """Remove a folder with folders only; raises OSError if it contains a file."""
    for folder, _, _ in os.walk(path, topdown=False):
        os.rmdir(folder)


def discard(path: Path) -> None:
    """Remove a file, link or folder; raises OSError."""
    if path.is_dir() and not path.is_symlink():
        delete_tree(path)
    else:
        path.unlink(missing_ok=True)


def is_folder(path: str) -> bool:
    """Return whether the path is a folder, not a link to one."""
    return os.path.isdir(path) and not os.path.islink(path)


def status_of(path: str) -> os.stat_result | None:
    """Return the stat of a file or link, None if it does not exist."""
    try:
        return os.lstat(path)
    except OSError:
        return None


def stats_of(path: str) -> list[int]:
    """Return the values that change when a file is written: time, size, inode and mode."""
    status = status_of(path)
    return [status.st_mtime_ns, status.st_size, status.st_ino, status.st_mode] if status else []


def is_same_file(path: str, other: Path) -> bool:
    """Return whether two readable files have the same content, or two links the same target."""
    try:
        if os.path.islink(path) or other.is_symlink():
            return os.path.islink(path) and other.is_symlink() and os.readlink(path) == os.readlink(other)
        return os.path.isfile(path) and other.is_file() and has_same_content(path, other)
    except OSError:
        return False


def has_same_content(path: str | Path, other: Path) -> bool:
    """Return whether two files have the same content.

    `filecmp` would not read a file again whose content changed while its size and time stayed the same.
    """
    return os.path.getsize(path) == other.stat().st_size and begins_with(path, other)


def begins_with(path: str | Path, other: Path) -> bool:
    try:
        with open(path, "rb") as now, other.open("rb") as then:
            return all(now.read(len(part)) == part for part in iter(partial(then.read, _CHUNK), b""))
    except OSError:
        return False


def give_back(path: str, status: Sequence[int], kept: Path) -> None:
    """Restore an unowned entry; for a folder, only the path and mode are known.

    A file that was written in place is restored in place: it may have other names, or be mounted here.
    """
    now = stats_of(path)
    if now and stat.S_ISREG(now[MODE]) and now[INODE] == status[INODE]:
        with contextlib.suppress(OSError):  # not writable, or a running program
            shutil.copyfile(kept, path)
            shutil.copystat(kept, path)
            return
    if not os.path.lexists(kept):
        if stat.S_ISDIR(status[MODE]):
            os.makedirs(path, exist_ok=True)
            os.chmod(path, stat.S_IMODE(status[MODE]))
        return
    # Anything else at this path was created by the failed build.
    if os.path.isdir(path) and not os.path.islink(path):
        remove_empty_tree(path)
    target = Path(path)
    for folder in target.parents:
        if folder.is_dir():
            break
        folder.unlink(missing_ok=True)
    target.parent.mkdir(parents=True, exist_ok=True)
    draft = target.with_name(f".{target.name}.forge-draft")
    draft.unlink(missing_ok=True)
    if kept.is_symlink() or kept.is_file():
        shutil.copy2(kept, draft, follow_symlinks=False)
    else:
        draft.hardlink_to(kept)
    draft.replace(target)


def keep_beside(copy: Path, path: str) -> str:
    """Keep a copy beside its path under a free name; return its path, '' if there is such a copy already."""
    name, number = f"{path}.before_build", 0
    while not is_same_file(name, copy):
        if not os.path.lexists(name):
            os.makedirs(os.path.dirname(name), exist_ok=True)
            shutil.copy2(copy, name, follow_symlinks=False)
            return name
        number += 1
        name = f"{path}.before_build{number}"
    return ""
