"""Keeping a folder of results within a size: what was used least of late goes first."""

from __future__ import annotations

import contextlib
import os
import time
from pathlib import Path
from typing import TYPE_CHECKING

from forge.caching.action_result import decode
from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterator

    from forge.caching.folder_store import FolderStore

DEFAULT_SIZE = 20 << 30
"""Bytes that a folder of results may take, unless somebody says otherwise."""

_YOUNG_SECONDS = 3600.0
"""What is younger may belong to a build at work, whose result is yet to be written."""


@frozen
class Kept:
    """One file of a store: a result or a blob, with its size and when it was used last."""

    path: Path
    size: int
    used: float


@frozen
class Shelf:
    """All that is in a folder: results, the one used last first, and blobs by their SHA-256."""

    results: tuple[Kept, ...]
    blobs: dict[str, Kept]

    @property
    def size(self) -> int:
        """Bytes of all files."""
        return sum(kept.size for kept in (*self.results, *self.blobs.values()))


def look(store: FolderStore) -> Shelf:
    """Look at all files of a store; contents are not read."""
    results = sorted(_files(store.folder / "ac"), key=lambda kept: -kept.used)
    return Shelf(tuple(results), {kept.path.name: kept for kept in _files(store.folder / "cas")})


def prune(store: FolderStore, size: int) -> tuple[int, int]:
    """Remove results until the rest takes no more than `size` bytes, and blobs that no result leads to.

    Returns how many files, and how many bytes, were removed.
    """
    shelf = look(store)
    if shelf.size <= size:
        return 0, 0
    left, kept, led_to = size, set[str](), set[str]()
    doomed = []
    for result in shelf.results:
        blobs = _blobs(result)
        needed = result.size + sum(shelf.blobs[name].size for name in blobs - kept if name in shelf.blobs)
        if needed > left:
            doomed.append(result)
            led_to |= blobs
        else:
            left -= needed
            kept |= blobs
    old = time.time() - _YOUNG_SECONDS
    doomed += [
        blob for name, blob in shelf.blobs.items() if name not in kept and (name in led_to or blob.used < old)
    ]
    for file in doomed:
        with contextlib.suppress(FileNotFoundError):
            file.path.unlink()
    return len(doomed), sum(file.size for file in doomed)


def _blobs(result: Kept) -> set[str]:
    """Return the blobs that a result leads to; nothing for one that cannot be read."""
    with contextlib.suppress(OSError, ValueError):
        return {file.digest.hash for file in decode(result.path.read_bytes()).files}
    return set()


def _files(folder: Path) -> Iterator[Kept]:
    for place, _, names in os.walk(folder):
        for name in names:
            path = Path(place, name)
            with contextlib.suppress(FileNotFoundError):
                status = path.stat()
                yield Kept(path, status.st_size, status.st_mtime)
