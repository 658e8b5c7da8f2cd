"""Maintain a folder store: list its files, prune it to a maximum size, count hits and misses."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import re
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from forge.base.files import replace_file
from forge.base.frozen import frozen
from forge.plugins.package_cache.folder_store import DRAFT, FolderStore, decode_result

DEFAULT_SIZE = 20 << 30
"""The default maximum size of a folder store in bytes."""

_STORED = re.compile(r"[0-9a-f]{64}")
YOUNG_SECONDS = 3600.0
"""Unreferenced blobs younger than this are kept: a running build may not have written their result yet."""


@frozen
class StoredFile:
    """A result or blob file of a store, with its size and time of last use."""

    path: Path
    size: int
    used: float


@frozen
class StoreContents:
    """All files of a store: results, most recently used first, and blobs by SHA-256."""

    results: tuple[StoredFile, ...]
    blobs: dict[str, StoredFile]

    @property
    def size(self) -> int:
        return sum(file.size for file in (*self.results, *self.blobs.values()))


def scan_store(store: FolderStore) -> StoreContents:
    """List all files of a store without reading their contents."""
    results = sorted(_files(store.folder / "ac"), key=lambda file: -file.used)
    return StoreContents(tuple(results), {file.path.name: file for file in _files(store.folder / "cas")})


def prune(store: FolderStore, size: int, since: float = 0.0) -> tuple[int, int]:
    """Remove results until the store takes at most `size` bytes, and unreferenced blobs.

    Results that were not used `since` then are removed as well. Returns the number of removed files and
    bytes.
    """
    contents = scan_store(store)
    if contents.size <= size and all(result.used >= since for result in contents.results):
        return 0, 0
    left, kept_blobs, referenced = size, set[str](), set[str]()
    removed = []
    for result in contents.results:
        blobs = set[str]()  # no blobs if the result cannot be read
        with contextlib.suppress(OSError, ValueError):
            blobs = {file.digest.hash for file in decode_result(result.path.read_bytes()).files}
        needed = result.size + sum(
            contents.blobs[name].size for name in blobs - kept_blobs if name in contents.blobs
        )
        if needed > left or result.used < since:
            removed.append(result)
            referenced |= blobs
        else:
            left -= needed
            kept_blobs |= blobs
    old = time.time() - YOUNG_SECONDS
    removed += [
        blob
        for name, blob in contents.blobs.items()
        if name not in kept_blobs and (name in referenced or blob.used < old)
    ]
    for file in removed:
        with contextlib.suppress(FileNotFoundError):
            file.path.unlink()
    return len(removed), sum(file.size for file in removed)


def _files(folder: Path) -> Iterator[StoredFile]:
    """Yield the files with names of a store; other files in the folder belong to the user."""
    for folder_path, _, names in os.walk(folder):
        above = os.path.basename(folder_path)  # noqa: PTH119  (each file of a cache)
        for name in names:
            if not (DRAFT.fullmatch(name) or (_STORED.fullmatch(name) and name[:2] == above)):
                continue
            path = Path(folder_path, name)
            with contextlib.suppress(FileNotFoundError):
                status = path.stat()
                yield StoredFile(path, status.st_size, status.st_mtime)


_FILE = "counts.json"


@frozen
class Counts:
    """The number of packages restored from the cache, and of misses."""

    restored: int = 0
    missed: int = 0


def add_counts(folder: Path, counts: Counts, rights: int) -> None:
    """Add the counts of one build, under a lock against concurrent builds.

    `rights` are the permissions of files in the store.
    """
    if counts == Counts() or not folder.is_dir():
        return
    mode = rights & 0o666
    with open(folder / ".lock", "a", opener=partial(os.open, mode=mode)) as lock:
        with contextlib.suppress(PermissionError):  # another user of the group owns it
            os.fchmod(lock.fileno(), mode)
        fcntl.flock(lock, fcntl.LOCK_EX)
        before = read_counts(folder)
        now = {"restored": before.restored + counts.restored, "missed": before.missed + counts.missed}
        replace_file(folder / _FILE, json.dumps(now).encode(), mode=mode)


def read_counts(folder: Path) -> Counts:
    """Return the total counts of all builds; zero if there are none."""
    with contextlib.suppress(OSError, ValueError, LookupError, TypeError, RecursionError):
        data = json.loads((folder / _FILE).read_bytes())
        return Counts(int(data["restored"]), int(data["missed"]))
    return Counts()
