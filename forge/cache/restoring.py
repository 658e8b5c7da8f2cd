"""Write a cached tree into a prefix, identical to the files that the build installed."""

from __future__ import annotations

import hashlib
import os
import stat
from mmap import ACCESS_READ, mmap
from typing import TYPE_CHECKING

from forge.cache.folder_store import copy_bytes

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from forge.cache.relocation import Relocator
    from forge.cache.trees import Leaf, Tree


class CachedTree:
    """A cached tree with its open, verified blobs; later changes of the store do not affect them."""

    def __init__(
        self,
        tree: Tree,
        pack: int,
        large: Mapping[str, int],
        externals: tuple[str, ...] = (),
        external: str = "",
    ) -> None:
        """Take ownership of the descriptors of the pack, and of each large file by its digest.

        `externals` are the files outside the workspace that its build read, `external` is the digest of their
        contents.
        """
        self.tree, self.externals, self.external = tree, externals, external
        self.large = large
        self._descriptors = (pack, *large.values())
        self._pack = mmap(pack, 0, access=ACCESS_READ) if os.fstat(pack).st_size else b""

    def small(self, leaf: Leaf) -> bytes:
        """Return the bytes of a file in the pack."""
        return self._pack[leaf.offset : leaf.offset + leaf.size]

    def close(self) -> None:
        for descriptor in self._descriptors:
            os.close(descriptor)


class TreeWriter:
    """Writes the leaves of trees below one prefix."""

    def __init__(self, prefix: Path, relocator: Relocator) -> None:
        """Store the prefix and the relocator for placeholders."""
        self._prefix = str(prefix)
        self._relocator = relocator
        self.written: list[tuple[str, os.stat_result, str]] = []
        """Path, stat and content digest of each small file that was written."""
        self._created: dict[str, bool] = {}
        """Existing folders, and whether this object created them: then they contain nothing else."""

    def write_tree(self, found: CachedTree) -> None:
        """Write a whole tree; files that are already identical keep their time.

        Raises OSError, also if a symbolic link leads out of the prefix.
        """
        for leaf in found.tree.leaves:
            new = self._folder(leaf.path.rpartition("/")[0])
            path = f"{self._prefix}/{leaf.path}"
            if leaf.target is None:
                self._write(path, leaf, found, new=new)
                continue
            target = self._relocator.absolutize_word(leaf.target)
            if os.path.lexists(path):
                if os.path.islink(path) and os.readlink(path) == target:
                    continue
                os.unlink(path)
            os.symlink(target, path)
        for folder, _ in found.tree.folders:
            self._folder(folder)
        for folder, mode in reversed(found.tree.folders):
            if mode and self._created[folder]:
                os.chmod(f"{self._prefix}/{folder}", mode)

    def _folder(self, name: str) -> bool:
        """Create a folder below the prefix; return True if it did not exist."""
        if name in self._created:
            return self._created[name]
        path = f"{self._prefix}/{name}" if name else self._prefix
        if name:
            self._folder(name.rpartition("/")[0])
            try:
                os.mkdir(path)
                new = True
            except FileExistsError:
                new = False
                self._check_inside_prefix(path)
        else:
            new = not os.path.isdir(path)
            os.makedirs(path, exist_ok=True)
        self._created[name] = new
        return new

    def _check_inside_prefix(self, path: str) -> None:
        """Raise NotADirectoryError unless the path is a folder that resolves to a path below the prefix."""
        real = os.path.realpath(path)
        if not os.path.isdir(real) or not f"{real}/".startswith(f"{os.path.realpath(self._prefix)}/"):
            raise NotADirectoryError(20, "not a folder below the prefix", path)

    def _write(self, path: str, leaf: Leaf, found: CachedTree, *, new: bool) -> None:
        """Write a file, unless it is small and identical; `new` tells that its folder was empty."""
        content = None
        if leaf.offset >= 0:
            content = found.small(leaf)
            content = self._relocator.absolutize(content) if leaf.relocatable else content
        if not new and os.path.lexists(path):
            if content is not None and _has_content(path, leaf.mode, content):
                return
            # Never write into an existing file: it may be a symbolic or hard link.
            os.unlink(path)
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, leaf.mode)
        try:
            if content is None:
                copy_bytes(found.large[leaf.hash], descriptor, leaf.size)
            rest = memoryview(content or b"")
            while rest:
                rest = rest[os.write(descriptor, rest) :]
            status = os.fstat(descriptor)
            if stat.S_IMODE(status.st_mode) != leaf.mode:  # the umask has removed permissions
                os.fchmod(descriptor, leaf.mode)
                status = os.fstat(descriptor)
        finally:
            os.close(descriptor)
        if content is not None:
            self.written.append((path, status, hashlib.blake2b(content, digest_size=16).hexdigest()))


def _has_content(path: str, mode: int, content: bytes) -> bool:
    """Return True if `path` is a regular file with this mode and content."""
    try:
        status = os.lstat(path)
        if not stat.S_ISREG(status.st_mode) or stat.S_IMODE(status.st_mode) != mode:
            return False
        if status.st_size != len(content):
            return False
        with open(path, "rb") as stream:
            return stream.read() == content
    except OSError:
        return False
