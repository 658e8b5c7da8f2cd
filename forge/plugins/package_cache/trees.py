"""The installed files of a package as a relocatable tree, its encoding as blobs, and its restoration.

Small files are concatenated into one blob, the pack; each large file is a separate blob. A further blob,
the index, lists the files.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import stat
from dataclasses import asdict
from mmap import ACCESS_READ, mmap
from typing import TYPE_CHECKING, Any

from forge.base.files import BYTECODE, capabilities
from forge.base.frozen import frozen
from forge.base.layout import BACKUP_DIR, INSTALLED_LISTS_DIR, Layout
from forge.cache.model import Digest
from forge.plugins.package_cache.folder_store import copy_bytes
from forge.plugins.package_cache.linked_parts import linked_parts

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping
    from pathlib import Path

    from forge.build.model import BuildRecord
    from forge.plugins.package_cache.relocation import Relocator

LARGE = 1 << 20
"""The size in bytes from which a file is a separate blob."""

_SPECIAL = stat.S_ISUID | stat.S_ISGID | stat.S_ISVTX
"""Permissions that are never restored."""

TICK = 0.05
"""The tolerated difference in seconds between file times and process clocks."""

_VERSION = 4
_NO_NAMES = frozenset({"", ".", ".."})
_HEX = re.compile(r"[0-9a-f]{64}\Z")
_LONGEST = 4096
"""The maximum length of a path (PATH_MAX of Linux); it bounds the cost of checking all parents."""


@frozen
class Leaf:
    """An installed file: `path` relative to the prefix, mode, size and hash (with placeholders for paths).

    `offset` is its position in the pack; it is -1 for a large file, whose bytes are the blob `hash`.
    `relocatable` is True if the content contains placeholders. A symbolic link has a `target` instead.
    `linked` is a digest of a program or library that does not depend on its run path.
    """

    path: str
    mode: int
    size: int
    hash: str
    offset: int = -1
    relocatable: bool = False
    target: str | None = None
    linked: str = ""

    @property
    def state(self) -> tuple[object, ...]:
        """The parts that builds in different workspaces have in common."""
        return self.path, self.mode, self.linked or self.hash, self.target


@frozen
class Tree:
    """All files of a package, sorted by path, and its folders that are empty or have unusual permissions.

    The permissions of a folder are 0 for the default. `seconds` is the duration of the build, for estimates.
    With `has_tests`, tests need the build folder, which is not stored.
    """

    leaves: tuple[Leaf, ...]
    folders: tuple[tuple[str, int], ...] = ()
    seconds: float = 0.0
    pack: Digest | None = None
    has_tests: bool = True

    @property
    def empty_folders(self) -> tuple[str, ...]:
        paths = (*(leaf.path for leaf in self.leaves), *dict(self.folders))
        full = {parent for path in paths for parent in _parents(path)}
        return tuple(path for path, _ in self.folders if path not in full)

    @property
    def digest(self) -> str:
        """A digest of the tree, independent of its path and build time."""
        value = hashlib.sha256()
        for leaf in self.leaves:
            value.update(repr(leaf.state).encode(errors="surrogateescape"))
        folders = (f"{path}\0{mode:o}\n" for path, mode in self.folders)
        value.update("".join(folders).encode(errors="surrogateescape"))
        return value.hexdigest()

    def difference(self, other: Tree) -> str:
        """Return a file or folder that differs in another tree, '' if there is none."""
        states = {leaf.state for leaf in self.leaves}.symmetric_difference(
            leaf.state for leaf in other.leaves
        )
        folders = set(self.folders).symmetric_difference(other.folders)
        return min((str(path) for path, *_ in (*states, *folders)), default="")


class Uncacheable(Exception):
    """The installed files of a package cannot be cached; the message is the reason."""


def scan_tree(
    package: str,
    layout: Layout,
    record: BuildRecord,
    relocator: Relocator,
    pack: Callable[[bytes], object] = lambda _: None,
) -> Tree:
    """Read the installed files of a package and pass the contents of its pack to `pack` in order.

    Raises Uncacheable for files that cannot be cached, and OSError for missing files.
    """
    prefix = str(layout.prefix(package))
    names = [_name(prefix, path) for path in record.files]
    leaves, offset, owner = [], 0, os.stat(prefix).st_uid
    pack_digest = hashlib.sha256()
    for name in sorted(names):
        leaf, content = _leaf(f"{prefix}/{name}", name, relocator, offset, owner)
        leaves.append(leaf)
        if content:
            pack_digest.update(content)
            pack(content)
            offset += len(content)
    folders = _folders(prefix, names, [_name(prefix, path.rstrip("/")) for path in record.folders])
    return Tree(tuple(leaves), folders, 0.0, Digest(pack_digest.hexdigest(), offset))


def unrecorded_files(install: Path, records: Mapping[str, BuildRecord], since: float) -> dict[str, float]:
    """Return files that appeared in a merged prefix and are in no install manifest, with their times.

    Workspace-level files of forge and Python bytecode are excluded.
    """
    listed = {path for record in records.values() for path in record.files}
    times = {}
    for folder, folders, files in os.walk(install):
        folders[:] = (name for name in folders if name not in {BYTECODE, BACKUP_DIR, INSTALLED_LISTS_DIR})
        for name in files if folder != str(install) else ():
            path = f"{folder}/{name}"
            if path not in listed and (changed := os.lstat(path).st_ctime) >= since - TICK:
                times[path[len(str(install)) + 1 :]] = changed
    return times


def encode_index(tree: Tree) -> bytes:
    value = {"forge_tree": _VERSION, **asdict(tree)}
    value["leaves"] = [list(leaf.values()) for leaf in value["leaves"]]
    return json.dumps(value).encode()


def decode_index(index: bytes) -> Tree:
    """Return the tree of an index; raises ValueError if it is invalid or unsafe.

    No path leaves the prefix, leads through a link or file of the tree, or is duplicated.
    """
    try:
        value = json.loads(index)
        if value["forge_tree"] != _VERSION:
            raise ValueError("unsupported version")
        pack = value["pack"]
        tree = Tree(
            leaves=tuple(_leaf_of(entry) for entry in value["leaves"]),
            folders=tuple((_safe(path), _number(mode) & 0o777) for path, mode in value["folders"]),
            seconds=float(value["seconds"]),
            pack=Digest(_hash(pack["hash"]), _number(pack["size"])),
            has_tests=bool(value["has_tests"]),
        )
    except (ArithmeticError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError("invalid index of a tree") from error
    if not 0 <= tree.seconds < float("inf"):
        raise ValueError("expected a duration")
    _check_paths(tree)
    assert tree.pack is not None
    if any(leaf.offset + leaf.size > tree.pack.size for leaf in tree.leaves if leaf.offset >= 0):
        raise ValueError("a file extends beyond the end of the pack")
    return tree


def _name(prefix: str, path: str) -> str:
    """Return a path relative to the prefix; raises Uncacheable for one outside it."""
    if not path.startswith(f"{prefix}/"):
        raise Uncacheable(f"it installs '{path}' outside its prefix")
    return path[len(prefix) + 1 :]


def _folders(prefix: str, names: Iterable[str], empty: Iterable[str]) -> tuple[tuple[str, int], ...]:
    """Return the empty folders, and parents of files whose permissions differ from those of the prefix."""
    modes = dict.fromkeys(empty, 0)
    usual = stat.S_IMODE(os.stat(prefix).st_mode)
    for path in {*modes, *(parent for name in (*names, *modes) for parent in _parents(name))}:
        status = os.lstat(f"{prefix}/{path}")
        mode = stat.S_IMODE(status.st_mode)
        if stat.S_ISDIR(status.st_mode) and mode != usual and not mode & _SPECIAL:
            modes[path] = mode
    return tuple(sorted(modes.items()))


def _leaf(path: str, name: str, relocator: Relocator, offset: int, owner: int) -> tuple[Leaf, bytes | None]:
    """Return a file as a leaf, and its bytes for the pack; `owner` is the owner of the prefix."""
    status = os.lstat(path)
    if stat.S_ISLNK(status.st_mode):
        target = os.readlink(path)
        return Leaf(name, 0, 0, "", target=relocator.relativize_word(target)), None
    if not stat.S_ISREG(status.st_mode) or status.st_mode & _SPECIAL:
        raise Uncacheable(f"'{name}' is not a regular file")
    if capabilities(path) or status.st_uid != owner:
        raise Uncacheable(f"'{name}' has capabilities or belongs to another user")
    content, rewritten = _content(path, status, relocator)
    leaf = Leaf(
        name,
        stat.S_IMODE(status.st_mode),
        len(content),
        hashlib.sha256(content).hexdigest(),
        # Large files are copied verbatim; files with placeholders go into the pack.
        offset if rewritten or len(content) < LARGE else -1,
        rewritten,
        linked=linked_parts(content),
    )
    return leaf, bytes(content) if leaf.offset >= 0 else None


def _content(path: str, status: os.stat_result, relocator: Relocator) -> tuple[bytes | mmap, bool]:
    """Return the content to store, and whether it contains placeholders."""
    with open(path, "rb") as stream:
        if status.st_size >= LARGE:
            # Do not read it into memory, since it may be very large.
            mapping = mmap(stream.fileno(), 0, access=ACCESS_READ)
            if mapping.find(b"\0") >= 0 or not relocator.occur_in(mapping):
                return mapping, False
            content = mapping[:]
        else:
            content = stream.read()
    relative = relocator.relativize(content)
    return relative, relative != content


def _leaf_of(entry: list[Any]) -> Leaf:
    path, mode, size, digest, offset, relocatable, target, linked = entry
    return Leaf(
        path=_safe(path),
        mode=_number(mode) & 0o777,
        size=_number(size),
        hash=_hash(digest) if target is None else "",
        offset=offset if offset == -1 else _number(offset),
        relocatable=relocatable is True,
        target=None if target is None else _text(target),
        linked=_text(linked),
    )


def _check_paths(tree: Tree) -> None:
    """Raise ValueError if a path is duplicated or leads through one that is not a folder."""
    files, checked = {leaf.path for leaf in tree.leaves}, set[str]()
    paths = files.union(path for path, _ in tree.folders)
    if len(paths) != len(tree.leaves) + len(tree.folders):
        raise ValueError("duplicate path")
    for path in paths:
        for parent in _parents(path):
            if parent in checked:
                break
            if parent in files:
                raise ValueError(f"a parent of '{path}' is not a folder")
            checked.add(parent)


def _parents(path: str) -> Iterator[str]:
    while "/" in path:
        path = path.rpartition("/")[0]
        yield path


def _safe(path: object) -> str:
    """Return the path if it stays below the prefix; raises ValueError otherwise."""
    name = _text(path)
    if len(name) > _LONGEST or not name or "\0" in name or not _NO_NAMES.isdisjoint(name.split("/")):
        raise ValueError(f"'{name[:200]}' is not a path below the prefix")
    return name


def _hash(value: object) -> str:
    if not _HEX.match(_text(value)):
        raise ValueError("expected a digest")
    return _text(value)


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError("expected a string")
    return value


def _number(value: object) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise ValueError("expected a non-negative integer")
    return value


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
        return self._pack[leaf.offset : leaf.offset + leaf.size]

    def close(self) -> None:
        for descriptor in self._descriptors:
            os.close(descriptor)


class TreeWriter:
    def __init__(self, prefix: Path, relocator: Relocator) -> None:
        self._prefix = str(prefix)
        self._relocator = relocator
        self.written: list[tuple[str, os.stat_result, str]] = []
        """Path, stat and content digest of each small file that was written."""
        self._created: dict[str, bool] = {}
        """Existing folders, and whether this object created them: then they contain nothing else."""

    def write_tree(self, found: CachedTree) -> None:
        """Write a whole tree; files that are already identical keep their time.

        Raises OSError, for example if a symbolic link leads out of the prefix.
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
                real, prefix = os.path.realpath(path), os.path.realpath(self._prefix)
                if not os.path.isdir(real) or not f"{real}/".startswith(f"{prefix}/"):
                    raise NotADirectoryError(20, "not a folder below the prefix", path) from None
        else:
            new = not os.path.isdir(path)
            os.makedirs(path, exist_ok=True)
        self._created[name] = new
        return new

    def _write(self, path: str, leaf: Leaf, found: CachedTree, *, new: bool) -> None:
        """Write a file, unless it is small and identical; `new` is True if its folder was empty."""
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
