"""The installed files of one package as a value that holds at any path, and how files become one.

Small files are put one after the other into one blob, the pack; each large one is a blob of its own. The
index, one more blob, says what there is.
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

from forge.caching.model import Digest
from forge.caching.relocation import Bound
from forge.files import BYTECODE
from forge.frozen import frozen
from forge.results import BEFORE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping
    from pathlib import Path

    from forge.caching.relocation import Places
    from forge.layout import Layout
    from forge.model import Record

LARGE = 1 << 20
"""Bytes from which a file is a blob of its own."""

_SPECIAL = stat.S_ISUID | stat.S_ISGID | stat.S_ISVTX
"""Rights that nothing restored may bring along."""

TICK = 0.05
"""Seconds by which the clocks of files and of processes may differ."""

_VERSION = 2
_NO_NAMES = frozenset({"", ".", ".."})
_HEX = re.compile(r"[0-9a-f]{64}\Z")
_LONGEST = 4096
"""Signs of a path: Linux takes no longer ones, and to look at all folders above takes the square of it."""


@frozen
class Leaf:
    """An installed file: `path` from the prefix, permissions, and what it says with paths put aside.

    `offset` is where it begins in the pack; a large one has none, and its bytes are the blob `hash`.
    `loose` tells that paths are to be put in again. A link has a `target` instead.
    """

    path: str
    mode: int
    size: int
    hash: str
    offset: int = -1
    loose: bool = False
    target: str | None = None


@frozen
class Tree:
    """All files of a package, sorted by path, and its folders that are empty or have unusual permissions.

    Each of these has its permissions, 0 for those that any new folder gets.
    `seconds` is how long the build took, for estimates; `bound` says why the tree holds only where it was
    made, '' if it holds anywhere.
    """

    package: str
    leaves: tuple[Leaf, ...]
    folders: tuple[tuple[str, int], ...] = ()
    seconds: float = 0.0
    bound: str = ""
    pack: Digest | None = None

    @property
    def empty_folders(self) -> tuple[str, ...]:
        """The folders in which nothing is, sorted."""
        paths = (*(leaf.path for leaf in self.leaves), *dict(self.folders))
        full = {parent for path in paths for parent in _parents(path)}
        return tuple(path for path, _ in self.folders if path not in full)

    @property
    def digest(self) -> str:
        """What the tree comes to, whatever the path and however long it took."""
        said = hashlib.sha256()
        for leaf in self.leaves:
            said.update(
                f"{leaf.path}\0{leaf.mode:o} {leaf.hash} {leaf.target}\n".encode(errors="surrogateescape")
            )
        folders = (f"{path}\0{mode:o}\n" for path, mode in self.folders)
        said.update("".join(folders).encode(errors="surrogateescape"))
        return said.hexdigest()


class Unfit(Exception):  # noqa: N818  (it is told, and ends nothing)
    """What a package installed cannot be kept; the message says why."""


def survey(
    package: str,
    layout: Layout,
    record: Record,
    places: Places,
    pack: Callable[[bytes], object] = lambda _: None,
) -> Tree:
    """Read what a package installed, and hand the contents of its pack to `pack`, in order.

    Raises Unfit for what cannot be kept, and OSError for what is not there.
    """
    prefix = str(layout.prefix(package))
    names = [_name(prefix, path) for path in record.files]
    leaves, offset, bound = [], 0, ""
    whole = hashlib.sha256()
    for name in sorted(names):
        leaf, content, why = _leaf(f"{prefix}/{name}", name, places, offset)
        leaves.append(leaf)
        if content:
            whole.update(content)
            pack(content)
            offset += len(content)
        if why and not bound:
            bound = f"'{name}' has {why} in it"
    folders = _folders(prefix, names, [_name(prefix, path.rstrip("/")) for path in record.folders])
    return Tree(package, tuple(leaves), folders, 0.0, bound, Digest(whole.hexdigest(), offset))


def strays(install: Path, records: Mapping[str, Record], since: float) -> dict[str, float]:
    """Return what appeared in a merged prefix that no package's tools list: when, in seconds, by path.

    Not what forge writes beside all packages, nor what Python compiles for itself.
    """
    listed = {path for record in records.values() for path in record.files}
    found = {}
    for folder, folders, files in os.walk(install):
        folders[:] = (name for name in folders if name not in {BYTECODE, BEFORE})
        for name in files if folder != str(install) else ():
            path = f"{folder}/{name}"
            if path not in listed and (changed := os.lstat(path).st_ctime) >= since - TICK:
                found[path[len(str(install)) + 1 :]] = changed
    return found


def index_of(tree: Tree) -> bytes:
    """Return the tree as JSON, the index."""
    said = {"forge_tree": _VERSION, **asdict(tree)}
    said["leaves"] = [
        [leaf.path, leaf.mode, leaf.size, leaf.hash, leaf.offset, leaf.loose, leaf.target]
        for leaf in tree.leaves
    ]
    return json.dumps(said).encode()


def tree_of(index: bytes) -> Tree:
    """Return the tree that an index describes; raises ValueError for anything that is none, or unsafe.

    No path leaves the prefix, none leads through a link of the tree or a file, none comes twice.
    """
    try:
        said = json.loads(index)
        if said["forge_tree"] != _VERSION:
            raise ValueError("another version")
        pack = said["pack"]
        tree = Tree(
            package=_text(said["package"]),
            leaves=tuple(_leaf_of(entry) for entry in said["leaves"]),
            folders=tuple((_safe(path), _number(mode) & 0o777) for path, mode in said["folders"]),
            seconds=_duration(said["seconds"]),
            bound=_text(said["bound"]),
            pack=Digest(_hash(pack["hash"]), _number(pack["size"])),
        )
    except (ArithmeticError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError("no index of a tree") from error
    _refuse_crossing(tree)
    assert tree.pack is not None  # noqa: S101  (set above)
    if any(leaf.offset + leaf.size > tree.pack.size for leaf in tree.leaves if leaf.offset >= 0):
        raise ValueError("a file lies beyond the end of the pack")
    return tree


def _name(prefix: str, path: str) -> str:
    """Return a path from the prefix; raises Unfit for one outside of it."""
    if not path.startswith(f"{prefix}/"):
        raise Unfit(f"it installs '{path}', outside of its prefix")
    return path[len(prefix) + 1 :]


def _folders(prefix: str, names: Iterable[str], empty: Iterable[str]) -> tuple[tuple[str, int], ...]:
    """Return the empty folders, and those above files whose rights are not those of the prefix."""
    found = dict.fromkeys(empty, 0)
    usual = stat.S_IMODE(os.stat(prefix).st_mode)  # noqa: PTH116
    for path in {*found, *(parent for name in (*names, *found) for parent in _parents(name))}:
        status = os.lstat(f"{prefix}/{path}")
        mode = stat.S_IMODE(status.st_mode)
        if stat.S_ISDIR(status.st_mode) and mode != usual and not mode & _SPECIAL:
            found[path] = mode
    return tuple(sorted(found.items()))


def _leaf(path: str, name: str, places: Places, offset: int) -> tuple[Leaf, bytes | None, str]:
    """Return a file as a leaf, what it adds to the pack, and why it is bound to where it is."""
    status = os.lstat(path)
    if stat.S_ISLNK(status.st_mode):
        target = os.readlink(path)  # noqa: PTH115  (thousands of files: no Path for each)
        return Leaf(name, 0, 0, "", target=places.loose_word(target)), None, ""
    if not stat.S_ISREG(status.st_mode) or status.st_mode & _SPECIAL:
        raise Unfit(f"'{name}' is no ordinary file")
    kept, why, rewritten = _content(path, status, places)
    leaf = Leaf(
        name,
        stat.S_IMODE(status.st_mode),
        len(kept),
        hashlib.sha256(kept).hexdigest(),
        # A large file is linked or copied as it stands: what would have to be rewritten goes into the pack.
        offset if rewritten or len(kept) < LARGE else -1,
        rewritten,
    )
    return leaf, bytes(kept) if leaf.offset >= 0 else None, why


def _content(path: str, status: os.stat_result, places: Places) -> tuple[bytes | mmap, str, bool]:
    """Return what is kept of a file, why it is bound to where it is, and whether paths were put aside."""
    with open(path, "rb") as stream:  # noqa: PTH123
        if status.st_size >= LARGE:
            # Not into memory, however large it is.
            whole = mmap(stream.fileno(), 0, access=ACCESS_READ)
            if not places.occur_in(whole):
                return whole, "", False
            if whole.find(b"\0") >= 0:
                return whole, places.name_in(whole), False
            content = whole[:]
        else:
            content = stream.read()
    loose = places.loosened(content)
    return (content, loose.place, False) if isinstance(loose, Bound) else (loose, "", loose is not content)


def _leaf_of(entry: list[Any]) -> Leaf:
    path, mode, size, digest, offset, loose, target = entry
    return Leaf(
        path=_safe(path),
        mode=_number(mode) & 0o777,
        size=_number(size),
        hash=_hash(digest) if target is None else "",
        offset=offset if offset == -1 else _number(offset),
        loose=loose is True,
        target=None if target is None else _text(target),
    )


def _refuse_crossing(tree: Tree) -> None:
    """Raise ValueError when a path comes twice, or leads through one that is no folder."""
    paths = {leaf.path for leaf in tree.leaves}
    if len(paths) != len(tree.leaves):
        raise ValueError("a path comes twice")
    checked: set[str] = set()
    folders = {path for path, _ in tree.folders}
    for path in (*paths, *folders):
        for parent in _parents(path):
            if parent in checked:
                break
            if parent in paths:
                raise ValueError(f"'{path}' lies below what is no folder")
            checked.add(parent)
    if paths & folders or len(folders) != len(tree.folders):
        raise ValueError("a path comes twice")


def _parents(path: str) -> Iterator[str]:
    while "/" in path:
        path = path.rpartition("/")[0]
        yield path


def _safe(path: object) -> str:
    """Return a path that stays below the prefix."""
    name = _text(path)
    if len(name) > _LONGEST or not name or "\0" in name or not _NO_NAMES.isdisjoint(name.split("/")):
        raise ValueError(f"'{name[:200]}' is no path below a prefix")
    return name


def _hash(said: object) -> str:
    if not _HEX.match(_text(said)):
        raise ValueError("no digest")
    return _text(said)


def _text(said: object) -> str:
    if not isinstance(said, str):
        raise TypeError("no text")
    return said


def _duration(said: object) -> float:
    seconds = float(said) if isinstance(said, int | float) else -1.0
    if not 0 <= seconds < float("inf"):
        raise ValueError("no duration")
    return seconds


def _number(said: object) -> int:
    if not isinstance(said, int) or isinstance(said, bool) or said < 0:
        raise ValueError("no number")
    return said
