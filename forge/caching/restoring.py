"""A tree out of the cache, written into a prefix: exactly what the build had installed."""

from __future__ import annotations

import hashlib
import os
import stat
from mmap import ACCESS_READ, mmap
from typing import TYPE_CHECKING

from forge.caching.folder_store import copy_bytes

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from forge.caching.relocation import Places
    from forge.caching.trees import Leaf, Tree


class Contents:
    """The open blobs of one tree, verified before: nothing that happens to the store can change them now."""

    def __init__(self, pack: int, large: Mapping[str, int]) -> None:
        """Take over descriptors: of the pack, and of each large file by its digest."""
        self._descriptors = (pack, *large.values())
        self._large = large
        self._pack = mmap(pack, 0, access=ACCESS_READ) if os.fstat(pack).st_size else b""

    def small(self, leaf: Leaf) -> bytes:
        """Return the bytes of a file that is in the pack."""
        return self._pack[leaf.offset : leaf.offset + leaf.size]

    def large(self, leaf: Leaf) -> int:
        """Return the descriptor of a large file."""
        return self._large[leaf.hash]

    def close(self) -> None:
        """Close them."""
        for descriptor in self._descriptors:
            os.close(descriptor)


class Planter:
    """Writes the leaves of trees below one prefix."""

    def __init__(self, prefix: Path, places: Places) -> None:
        """Remember where, and how paths are put in again."""
        self._prefix = str(prefix)
        self._places = places
        self.written: list[tuple[str, os.stat_result, str]] = []
        """Path, stat and content digest of each small file that was written."""
        self._seen: dict[str, bool] = {}
        """Folders that are there, and whether they were made here: then nothing else is in them."""

    def plant(self, tree: Tree, contents: Contents) -> None:
        """Write all of a tree; a file that says so already stays as it is, with its time.

        Raises OSError as the system does, and for a folder that a link leads out of the prefix.
        """
        for leaf in tree.leaves:
            new = self._folder(leaf.path.rpartition("/")[0])
            path = f"{self._prefix}/{leaf.path}"
            if leaf.target is not None:
                self._link(path, self._places.settled_word(leaf.target))
            elif leaf.offset < 0:
                self._copy(path, leaf, contents.large(leaf), new=new)
            else:
                content = contents.small(leaf)
                self._write(path, leaf, self._places.settled(content) if leaf.loose else content, new=new)
        for folder, _ in tree.folders:
            self._folder(folder)
        for folder, mode in reversed(tree.folders):
            if mode and self._seen[folder]:
                os.chmod(f"{self._prefix}/{folder}", mode)  # noqa: PTH101

    def _folder(self, name: str) -> bool:
        """Make a folder below the prefix; tell if nothing was there."""
        if name in self._seen:
            return self._seen[name]
        path = f"{self._prefix}/{name}" if name else self._prefix
        if name:
            self._folder(name.rpartition("/")[0])
            try:
                os.mkdir(path)  # noqa: PTH102  (thousands: no Path for each)
                new = True
            except FileExistsError:
                new = False
                self._refuse_way_out(path)
        else:
            new = not os.path.isdir(path)  # noqa: PTH112
            os.makedirs(path, exist_ok=True)  # noqa: PTH103
        self._seen[name] = new
        return new

    def _refuse_way_out(self, path: str) -> None:
        """Raise NotADirectoryError unless a folder, or the link to one, stays below the prefix."""
        real = os.path.realpath(path)
        if not os.path.isdir(real) or not f"{real}/".startswith(f"{os.path.realpath(self._prefix)}/"):  # noqa: PTH112
            raise NotADirectoryError(20, "it is no folder below the prefix", path)

    def _write(self, path: str, leaf: Leaf, content: bytes, *, new: bool) -> None:
        if not new and _says(path, leaf.mode, content):
            return
        descriptor = _create(path, leaf.mode, new=new)
        try:
            rest = memoryview(content)
            while rest:
                rest = rest[os.write(descriptor, rest) :]
            status = _with_mode(descriptor, leaf.mode)
        finally:
            os.close(descriptor)
        self.written.append((path, status, hashlib.blake2b(content, digest_size=16).hexdigest()))

    def _copy(self, path: str, leaf: Leaf, source: int, *, new: bool) -> None:
        descriptor = _create(path, leaf.mode, new=new)
        try:
            copy_bytes(source, descriptor, leaf.size)
            _with_mode(descriptor, leaf.mode)
        finally:
            os.close(descriptor)

    def _link(self, path: str, target: str) -> None:
        if os.path.lexists(path):
            if os.path.islink(path) and os.readlink(path) == target:  # noqa: PTH114, PTH115
                return
            os.unlink(path)  # noqa: PTH108
        os.symlink(target, path)  # noqa: PTH211


def _create(path: str, mode: int, *, new: bool) -> int:
    if not new and os.path.lexists(path):
        # Never into what is there: it may be a link, or share its bytes with another file.
        os.unlink(path)  # noqa: PTH108
    return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)


def _with_mode(descriptor: int, mode: int) -> os.stat_result:
    """Give a file its rights where the process would leave some out; return its stat."""
    status = os.fstat(descriptor)
    if stat.S_IMODE(status.st_mode) != mode:
        os.fchmod(descriptor, mode)
        status = os.fstat(descriptor)
    return status


def _says(path: str, mode: int, content: bytes) -> bool:
    """Tell if a regular file with these rights says just this."""
    try:
        status = os.lstat(path)
        if not stat.S_ISREG(status.st_mode) or stat.S_IMODE(status.st_mode) != mode:
            return False
        if status.st_size != len(content):
            return False
        with open(path, "rb") as stream:  # noqa: PTH123
            return stream.read() == content
    except OSError:
        return False
