"""What files look like and what they say: cheap stamps of stats, and digests of contents behind them.

A stamp is a digest of sizes, times, modes and inodes: equal stamps mean that nobody wrote there. Only
when stamps differ are contents read, and only of files whose own stat differs from the remembered one.
A file that changed within the clock's last tick may change again without a trace in its times: its
stat is not trusted the next time (git calls such entries racy).
"""

from __future__ import annotations

import hashlib
import json
import os
import stat
import time
from typing import TYPE_CHECKING

from forge.build.input_manifest import FileState, InputManifest
from forge.files import replace_file
from forge.model import Mark
from forge.source_names import is_source, is_source_folder

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping
    from pathlib import Path

    Stats = Mapping[str, os.stat_result]
    """What files look like, by path."""

VERSION = 2
RACY_NANOSECONDS = 20_000_000
"""Two ticks of the slowest kernel clock: file times are no finer than that."""
_COARSE_NANOSECONDS = 2_000_000_000
"""The step of file times on file systems that keep whole seconds: FAT, old NFS servers and ext3."""

NAMES_IN = "/."
"""The end of a path that stands for the names in a folder, whatever the files say."""

_BLOCK = 1 << 20
"""How many bytes are read at a time: a file may be larger than the memory."""

_NOBODY_LOOKED: Stats = {}

_RESULTS = frozenset({".built_by", ".colcon_install_layout", "latest_build"})
"""Beside COLCON_IGNORE, these mark where builds, installs and logs go, perhaps within a lone package."""


class FileTable:
    """Content digests of single files by their stats; a cache that may be lost at any time."""

    def __init__(self, path: Path) -> None:
        """Remember where the table is kept; it is read when first asked."""
        self._path = path
        self._known: dict[str, tuple[str, str]] | None = None
        self._changed = False
        self._own: set[str] = set()
        """Files that forge itself has just written: what they say is sure, but not for how long."""
        self.news: dict[str, str | None] = {}
        """Files whose content was read: what it had been before, None when that was not known."""

    def digest(self, path: str, status: os.stat_result) -> str:
        """Return the content digest of a file whose stat is `status`; raises OSError as open does."""
        known = self._load()
        said = _said(status)
        entry = known.get(path)
        if entry is not None and entry[0] == said:
            return entry[1]
        found = content_digest(path)
        known[path] = ("" if _racy(status) else said, found)
        self._own.discard(path)
        self._changed = True
        before = entry[1] if entry is not None else None
        if before != found:
            self.news.setdefault(path, before)
        return found

    def learn(self, path: str, status: os.stat_result, digest: str) -> None:
        """Take note of what a file says that was written just now; this process need not read it for that."""
        self._load()[path] = (_said(status), digest)
        self._own.add(path)
        self._changed = True

    def known(self, path: str, status: os.stat_result) -> str:
        """Return the content digest of a file that had this stat; '' when nobody has read it."""
        said, digest = self._load().get(path, ("", ""))
        return digest if said == _said(status) else ""

    def forget_others(self, paths: Collection[str]) -> None:
        """Remember nothing but the given files: a table that many builds share must not grow."""
        known = self._load()
        for path in known.keys() - paths:
            del known[path]
            self._changed = True

    def save(self) -> None:
        """Write the table if it learned anything."""
        if self._changed and self._known is not None:
            own = {path: ("", self._known[path][1]) for path in self._own}
            said = {"version": VERSION, "files": {**self._known, **own}}
            replace_file(self._path, json.dumps(said).encode())
            self._changed = False

    def _load(self) -> dict[str, tuple[str, str]]:
        if self._known is None:
            try:
                said = json.loads(self._path.read_bytes())
                valid = said["version"] == VERSION
                self._known = {p: (s, d) for p, (s, d) in said["files"].items()} if valid else {}
            except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
                self._known = {}
        return self._known


def mark_tree(root: str, table: FileTable, known: Mark | None = None) -> Mark:
    """Return what the tree below `root` looks like now; contents are read only if `known` differs."""
    return _mark(list(_below(root, (root,))), len(root) + 1, table, known, trusting=False)


def mark_files(
    paths: Iterable[str], table: FileTable, known: Mark | None = None, stats: Stats = _NOBODY_LOOKED
) -> Mark:
    """Return what the given files look like now, in the given order; a missing one shows as missing.

    `stats` are of some of them, just taken.
    """
    entries = [(path, stats.get(path) or _status(path), False) for path in paths]
    return _mark(entries, 0, table, known, trusting=True)


def tree_manifest(root: str, table: FileTable) -> InputManifest:
    """Return what each source below `root` looks like and says; folders end with '/'."""
    return {
        path: FileState(_stats(path, status), _content(path, status, table))
        for path, status, _ in _below(root, (root,))
    }


def tree_stats(root: str) -> dict[str, str]:
    """Return what each source below `root` looks like; nothing is read."""
    return {path: _stats(path, status) for path, status, _ in _below(root, (root,))}


def file_manifest(paths: Iterable[str], table: FileTable, stats: Stats = _NOBODY_LOOKED) -> InputManifest:
    """Return what the given files look like and say. `stats` are of some of them, just taken."""
    found = {}
    for path in paths:
        status = stats.get(path) or _status(path)
        found[path] = FileState(_stats(path, status), _content(path, status, table))
    return found


def stamp_files(paths: Iterable[str]) -> str:
    """Return the stamp of the stats of the given files and of what links lead to; nothing is read."""
    stamp = hashlib.blake2b(digest_size=16)
    for path in paths:
        stamp.update(f"{path}\0{_stats(path, _status(path))}\n".encode(errors="surrogateescape"))
    return stamp.hexdigest()


def content_digest(path: str) -> str:
    """Return the digest of what a file says; raises OSError as open does."""
    digest = hashlib.blake2b(digest_size=16)
    with open(path, "rb", buffering=0) as stream:  # noqa: PTH123  (thousands of files: no Path for each)
        # A block at a time: a recording may be larger than the memory.
        while block := stream.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()


def contents_of(paths: Iterable[str], table: FileTable, stats: Stats = _NOBODY_LOOKED) -> dict[str, str]:
    """Return what each file says; equal files say the same. `stats` are of some of them, just taken."""
    return {path: _content(path, stats.get(path) or _status(path), table) for path in paths}


def digest_of(paths: Iterable[str], contents: Mapping[str, str]) -> str:
    """Return one digest of some of the files that `contents_of` read."""
    said = "\n".join(f"{path}\0{contents[path]}" for path in paths)
    return hashlib.blake2b(said.encode(errors="surrogateescape"), digest_size=16).hexdigest()


def digest_words(*words: str) -> str:
    """Return one digest of some words in their order."""
    return _digest("\0".join(words).encode(errors="surrogateescape"))


def source_files(root: str, without: str | None = None) -> Iterator[str]:
    """Yield the paths of the files that count as sources, sorted folder by folder.

    Folders of the name `without` are left out.
    """
    return (path for path, _, _ in _below(root, (root,), without) if not path.endswith("/"))


def own_files(root: str) -> Iterator[tuple[str, os.stat_result]]:
    """Yield the sources that are regular files and lie below `root` itself, with their stats."""
    for path, status, linked in _below(root, (root,)):
        if not linked and stat.S_ISREG(status.st_mode):
            yield path, status


def source_folders(root: str) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield each folder that `source_files` looks into, with the files elsewhere that links in it lead to."""
    waiting: list[tuple[str, tuple[str, ...]]] = [(root, (root,))]
    while waiting:
        folder, way = waiting.pop()
        entries = _entries(folder, way[0])
        if entries is None:
            continue
        targets = []
        names = {entry.name for entry in entries}
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                if is_source_folder(entry.name, names.__contains__):
                    waiting.append((entry.path, way))
            elif entry.is_symlink() and is_source(entry.name, names.__contains__):
                target = os.path.realpath(entry.path)
                if not _leads_to_folder(entry):
                    targets.append(target)
                elif not _leads_back(target, way):
                    waiting.append((entry.path, (*way, target)))
        yield folder, tuple(targets)


def _leads_to_folder(link: os.DirEntry[str]) -> bool:
    """Tell if a link leads to a folder; one that leads to itself leads nowhere."""
    try:
        return link.is_dir()
    except OSError:
        return False


def _leads_back(target: str, way: tuple[str, ...]) -> bool:
    """Tell if the real folder `target` holds one of those on the way to it."""
    return any(f"{os.path.realpath(folder)}/".startswith(f"{target}/") for folder in way)


def _entries(folder: str, root: str) -> list[os.DirEntry[str]] | None:
    """Return what is in a folder, sorted; None for one that is no part of the sources below `root`.

    That is where results of a build go, an environment of Python, what an editor builds, and what has just
    vanished. Raises other OSErrors.
    """
    try:
        with os.scandir(folder) as found:
            entries = sorted(found, key=lambda entry: entry.name)
    except (FileNotFoundError, NotADirectoryError):
        return None
    names = {entry.name for entry in entries}
    if "COLCON_IGNORE" in names and names & _RESULTS:
        return None
    by_editor = "CMakeCache.txt" in names and os.path.basename(folder).startswith("cmake-build-")  # noqa: PTH119
    return None if folder != root and (by_editor or "pyvenv.cfg" in names) else entries


def _below(
    folder: str,
    way: tuple[str, ...],
    without: str | None = None,
    itself: os.stat_result | None = None,
) -> Iterator[tuple[str, os.stat_result, bool]]:
    """Yield each file and folder below a folder with its stat, and if a link to a folder led there.

    Folders come as paths with '/' at their end, the first one if its stat is given as `itself`. `way` are
    the folders that links and the root lead through, which are not entered again.
    """
    entries = _entries(folder, way[0])
    if entries is None:
        return
    names = {entry.name for entry in entries}
    if itself is not None:
        yield f"{folder}/", itself, len(way) > 1
    for entry in entries:
        name = entry.name
        is_folder = entry.is_dir(follow_symlinks=False)
        counts = is_source_folder if is_folder else is_source
        if (is_folder and name == without) or not counts(name, names.__contains__):
            continue
        try:
            status = entry.stat(follow_symlinks=False)
        except FileNotFoundError:
            # An editor's file that came and went while we looked.
            continue
        if is_folder:
            yield from _below(entry.path, way, without, status)
            continue
        yield entry.path, status, len(way) > 1
        if entry.is_symlink() and _leads_to_folder(entry):
            target = os.path.realpath(entry.path)
            if not _leads_back(target, way):
                yield from _below(entry.path, (*way, target), without)


def _mark(
    entries: list[tuple[str, os.stat_result | None, bool]],
    cut: int,
    table: FileTable,
    known: Mark | None,
    *,
    trusting: bool,
) -> Mark:
    """Digest the stats and, unless they are as `known` says, the contents of the entries."""
    stamp = hashlib.blake2b(digest_size=16)
    racy = False
    for path, status, _ in entries:
        racy = racy or not (trusting or _settled(path, status))
        stamp.update(f"{path[cut:]}\0{_stats(path, status)}\n".encode(errors="surrogateescape"))
    said = "" if racy else stamp.hexdigest()
    if known is not None and said and known.stamp == said:
        return known
    digest = hashlib.blake2b(digest_size=16)
    linked = b""
    for path, status, elsewhere in entries:
        line = f"{path[cut:]}\0{_content(path, status, table)}\n".encode(errors="surrogateescape")
        digest.update(line)
        if elsewhere or (status is not None and stat.S_ISLNK(status.st_mode)):
            linked += line
    return Mark(said, digest.hexdigest(), _digest(linked) if linked else "")


def _stats(path: str, status: os.stat_result | None) -> str:
    """Return what an entry looks like, in words; for a link also what it leads to."""
    if status is None:
        return ""
    if path.endswith("/"):
        # The times of a folder also change with names that are no sources.
        return f"{status.st_ino} {status.st_mode:o}"
    if not stat.S_ISLNK(status.st_mode):
        return _said(status)
    target = _status(path, follow=True)
    return f"{_said(status)} {_said(target) if target else ''}"


def _settled(path: str, status: os.stat_result | None) -> bool:
    """Tell if an entry cannot change from now on without its stats changing."""
    if status is None or path.endswith("/"):
        return True
    target = _status(path, follow=True) if stat.S_ISLNK(status.st_mode) else None
    return not _racy(status) and (target is None or not _racy(target))


def _digest(text: bytes) -> str:
    return hashlib.blake2b(text, digest_size=16).hexdigest()


def _content(path: str, status: os.stat_result | None, table: FileTable) -> str:
    """Return what a file says: its mode and content, and for a link also where it points."""
    if status is None:
        return "missing"
    try:
        if path.endswith("/"):
            return f"folder {stat.S_IMODE(status.st_mode):o}"
        if path.endswith(NAMES_IN):
            return f"names {_digest(os.fsencode(chr(0).join(sorted(os.listdir(path)))))}"  # noqa: PTH208
        if stat.S_ISREG(status.st_mode):
            return f"{stat.S_IMODE(status.st_mode):o} {table.digest(path, status)}"
        return _target(path, table) if stat.S_ISLNK(status.st_mode) else "special"
    except OSError:
        return "unreadable"


def _target(path: str, table: FileTable) -> str:
    """Return where a link points, and what stands there."""
    target = os.readlink(path)  # noqa: PTH115
    real = _status(path, follow=True)
    if real is None or not stat.S_ISREG(real.st_mode):
        return f"link {target}"
    return f"link {target} {stat.S_IMODE(real.st_mode):o} {table.digest(path, real)}"


def _status(path: str, *, follow: bool = False) -> os.stat_result | None:
    try:
        return os.stat(path, follow_symlinks=follow)  # noqa: PTH116
    except OSError:
        return None


def _said(status: os.stat_result) -> str:
    return f"{status.st_mtime_ns} {status.st_ctime_ns} {status.st_size} {status.st_ino} {status.st_mode:o}"


def _racy(status: os.stat_result) -> bool:
    """Tell if a file may be written again without its times changing."""
    newest = max(status.st_mtime_ns, status.st_ctime_ns)
    whole_seconds = not (status.st_mtime_ns % 1_000_000_000 or status.st_ctime_ns % 1_000_000_000)
    return newest > time.time_ns() - (_COARSE_NANOSECONDS if whole_seconds else RACY_NANOSECONDS)
