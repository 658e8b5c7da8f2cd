"""Prune a folder store to a maximum size; least recently used results are removed first."""

from __future__ import annotations

import contextlib
import os
import time
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.cache.action_result import decode

if TYPE_CHECKING:
    from collections.abc import Iterator

    from forge.cache.folder_store import FolderStore

DEFAULT_SIZE = 20 << 30
"""The default maximum size of a folder store in bytes."""

_YOUNG_SECONDS = 3600.0
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
        """Bytes of all files."""
        return sum(kept.size for kept in (*self.results, *self.blobs.values()))


def scan_store(store: FolderStore) -> StoreContents:
    """List all files of a store without reading their contents."""
    results = sorted(_files(store.folder / "ac"), key=lambda kept: -kept.used)
    return StoreContents(tuple(results), {kept.path.name: kept for kept in _files(store.folder / "cas")})


def prune(store: FolderStore, size: int) -> tuple[int, int]:
    """Remove results until the store takes at most `size` bytes, and unreferenced blobs.

    Returns the number of removed files and bytes.
    """
    contents = scan_store(store)
    if contents.size <= size:
        return 0, 0
    left, kept, referenced = size, set[str](), set[str]()
    removed = []
    for result in contents.results:
        blobs = _blobs(result)
        needed = result.size + sum(
            contents.blobs[name].size for name in blobs - kept if name in contents.blobs
        )
        if needed > left:
            removed.append(result)
            referenced |= blobs
        else:
            left -= needed
            kept |= blobs
    old = time.time() - _YOUNG_SECONDS
    removed += [
        blob
        for name, blob in contents.blobs.items()
        if name not in kept and (name in referenced or blob.used < old)
    ]
    for file in removed:
        with contextlib.suppress(FileNotFoundError):
            file.path.unlink()
    return len(removed), sum(file.size for file in removed)


def _blobs(result: StoredFile) -> set[str]:
    """Return the blobs of a result; none if it cannot be read."""
    with contextlib.suppress(OSError, ValueError):
        return {file.digest.hash for file in decode(result.path.read_bytes()).files}
    return set()


def _files(folder: Path) -> Iterator[StoredFile]:
    for folder_path, _, names in os.walk(folder):
        for name in names:
            path = Path(folder_path, name)
            with contextlib.suppress(FileNotFoundError):
                status = path.stat()
                yield StoredFile(path, status.st_size, status.st_mtime)
