"""Fingerprints and manifests of files: cheap stamps of their stats, and digests of their contents.

A fingerprint of a whole tree shows that something changed. To reuse the outputs of an earlier build, the
names of the changed files are needed: a manifest contains the state of each file.

A stamp is a digest of sizes, times, modes and inodes: equal stamps mean that no file was written. Contents
are read only if stamps differ, and only of files whose own stat differs from the recorded one. A file that
changed within the clock's last tick may change again without a change of its times, so its stat is not
trusted the next time (git calls such entries racy).
"""

from __future__ import annotations

import hashlib
import json
import os
import stat
import sys
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from operator import ne
from pathlib import Path
from types import ModuleType
from typing import NamedTuple, TypeVar

from forge.base.files import replace_file
from forge.base.frozen import frozen
from forge.base.layout import IGNORE_MARK, LAYOUT_MARKER
from forge.build.model import Fingerprint
from forge.workspace.source_names import is_environment, is_source, is_source_folder

VERSION = 2
RACY_NANOSECONDS = 20_000_000
"""Two ticks of the slowest kernel clock, the resolution of file times."""
_COARSE_NANOSECONDS = 2_000_000_000
"""The resolution of file times on file systems with whole seconds: FAT, old NFS servers and ext3."""

DIR_LISTING_SUFFIX = "/."
"""The suffix of a path that represents the file names in a folder, regardless of the files' contents."""

_BLOCK = 1 << 20
"""Bytes to read at a time; a file may be larger than the memory."""

_RESULTS = frozenset({".built_by", LAYOUT_MARKER, "latest_build"})
"""Beside COLCON_IGNORE, these mark build, install and log folders, which may lie within a package."""


class FileState(NamedTuple):
    """One file at one moment: `stats` are its size, times, inode and mode as text, `content` is a digest."""

    stats: str
    content: str


_State = TypeVar("_State")
Manifest = dict[str, FileState]
"""File states by absolute path; a path ending with '/' is a folder, whose content is its mode."""


@frozen
class Changes:
    """Absolute paths of files that were added, removed or modified."""

    added: frozenset[str] = field(default_factory=frozenset)
    removed: frozenset[str] = field(default_factory=frozenset)
    modified: frozenset[str] = field(default_factory=frozenset)

    def __or__(self, after: Changes) -> Changes:
        return Changes(self.added | after.added, self.removed | after.removed, self.modified | after.modified)

    def __bool__(self) -> bool:
        return bool(self.added or self.removed or self.modified)

    @property
    def all(self) -> frozenset[str]:
        return self.added | self.removed | self.modified

    @property
    def names(self) -> frozenset[str]:
        """The paths that were added or removed."""
        return self.added | self.removed


def content_differs(then: FileState, now: FileState) -> bool:
    return then.content != now.content


def compare(
    then: Mapping[str, _State], now: Mapping[str, _State], differ: Callable[[_State, _State], bool] = ne
) -> Changes:
    """Return the differences of two sets of files, given the states of each."""
    return Changes(
        added=frozenset(now.keys() - then.keys()),
        removed=frozenset(then.keys() - now.keys()),
        modified=frozenset(path for path, state in then.items() if differ(state, now.get(path, state))),
    )


class FileTable:
    """A cache of content digests by file and stat; it may be deleted at any time."""

    def __init__(self, path: Path, answer: Callable[[str], str] = str) -> None:
        """Store the path of the table, which is read at the first access.

        `answer` returns the answer to a question of a build, see `forge.engine.world`; questions are not
        absolute paths.
        """
        self.answer = answer
        self._path = path
        self._known: dict[str, tuple[str, str]] | None = None
        self._changed = False
        self._own_files: set[str] = set()
        """Files that forge has just written. Their digests are known, but their stats are not saved."""
        self.changed_files: dict[str, str | None] = {}
        """Files with a new content digest, with their previous digest or None if it was unknown."""
        self.trees: dict[str, tuple[Fingerprint, Manifest]] = {}
        """The last result of `fingerprint_tree` by root, if it has a stamp."""
        self.stats: dict[tuple[str, ...], Sequence[str]] = {}
        """The stats of the files for which `fingerprint_files` was called with a known fingerprint."""

    def digest(self, path: str, status: os.stat_result, stat_text: str = "") -> str:
        """Return the content digest of a file with the stat `status`; raises OSError like open().

        `stat_text` is the stat as text, if the caller has it.
        """
        entries = self._load()
        stat_text = stat_text or _stat_text(status)
        entry = entries.get(path)
        if entry is not None and entry[0] == stat_text:
            return entry[1]
        digest = content_digest(path)
        # The file may be written again without a change of its times.
        entries[path] = ("" if is_written_since(time.time_ns(), status) else stat_text, digest)
        self._own_files.discard(path)
        self._changed = True
        before = entry[1] if entry is not None else None
        if before != digest:
            self.changed_files.setdefault(path, before)
        return digest

    def learn(self, path: str, status: os.stat_result, digest: str) -> None:
        """Record the digest of a file that was just written, so that this process need not read it."""
        self._load()[path] = (_stat_text(status), digest)
        self._own_files.add(path)
        self._changed = True

    def save(self) -> None:
        if self._changed and self._known is not None:
            own = {path: ("", self._known[path][1]) for path in self._own_files}
            data = {"version": VERSION, "files": {**self._known, **own}}
            replace_file(self._path, json.dumps(data).encode())
            self._changed = False

    def _load(self) -> dict[str, tuple[str, str]]:
        if self._known is None:
            try:
                data = json.loads(self._path.read_bytes())
                valid = data["version"] == VERSION
                self._known = {p: (s, d) for p, (s, d) in data["files"].items()} if valid else {}
            except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
                self._known = {}
        return self._known


def fingerprint_tree(
    root: str, table: FileTable, known: Fingerprint | None = None
) -> tuple[Fingerprint, Manifest]:
    """Return the fingerprint of the source tree at `root`, and the state of each source.

    If the stamp is the `known` one, no contents are read, and no states are returned.
    """
    started, cut = time.time_ns(), len(root) + 1
    entries = [(path, status, _stats(path, status)) for path, status, _ in _walk(root)]
    stats_text = "".join(f"{path[cut:]}\0{stats}\n" for path, _, stats in entries)
    # A file that may be written again without a change of its times has no stamp.
    is_stable = not any(
        is_written_since(started, each)
        for path, status, _ in entries
        if not path.endswith("/")
        for each in (status, stat.S_ISLNK(status.st_mode) and _status(path, follow=True))
        if each
    )
    stamp = _digest(stats_text) if is_stable else ""
    if known is not None and stamp and known.stamp == stamp:
        return known, {}
    if stamp and root in table.trees and table.trees[root][0].stamp == stamp:
        return table.trees[root]
    manifest = {
        path: FileState(stats, _content(path, status, table, stats)) for path, status, stats in entries
    }
    contents = "".join(f"{path[cut:]}\0{state.content}\n" for path, state in manifest.items())
    fingerprint = Fingerprint(stamp, _digest(contents))
    if stamp:
        table.trees[root] = fingerprint, manifest
    return fingerprint, manifest


def fingerprint_files(
    paths: tuple[str, ...], table: FileTable, known: Fingerprint | None = None
) -> tuple[Fingerprint, dict[str, str]]:
    """Return the fingerprint of `paths` in this order, missing files included, and their contents.

    If the stamp is the `known` one, contents are neither read nor returned.
    """
    statuses = map(_status, paths)
    entries = [(path, status, _stats(path, status)) for path, status in zip(paths, statuses, strict=True)]
    stamp = _digest("".join(f"{path}\0{stats}\n" for path, _, stats in entries))
    if known is not None and known.stamp == stamp:
        table.stats[paths] = [stats for _, _, stats in entries]
        return known, {}
    contents = {path: _content(path, status, table, stats) for path, status, stats in entries}
    return Fingerprint(stamp, digest_of(paths, contents)), contents


def fingerprint_again(
    paths: tuple[str, ...], table: FileTable, contents: Mapping[str, str] | None, written: Collection[str]
) -> tuple[Fingerprint, dict[str, str]] | None:
    """Return the result of `fingerprint_files`, assuming that only `written` of `paths` changed meanwhile.

    `contents` are those of the fingerprint that `fingerprint_files` has confirmed before; None without it.
    Whatever else was written since does not have the stats of this fingerprint.
    """
    if paths not in table.stats or contents is None or not all(path in contents for path in paths):
        return None
    now, updated = dict(zip(paths, table.stats[paths], strict=True)), {path: contents[path] for path in paths}
    for path in now.keys() & written:
        status = _status(path)
        now[path] = _stats(path, status)
        updated[path] = _content(path, status, table, now[path])
    stamp = _digest("".join(f"{path}\0{stats}\n" for path, stats in now.items()))
    return Fingerprint(stamp, digest_of(paths, updated)), updated


def tree_stats(root: str) -> dict[str, str]:
    """Return the stat text of each source below `root` without reading files."""
    return {path: _stats(path, status) for path, status, _ in _walk(root)}


def stamp_files(paths: Iterable[str]) -> str:
    """Return a stamp of the stats of `paths` and of link targets without reading files."""
    return _digest("".join(f"{path}\0{_stats(path, _status(path))}\n" for path in paths))


def file_state(path: str, status: os.stat_result | None = None) -> str:
    """Return the stat of a file or folder as text, for a link also that of its target; '' if missing.

    `status` is that of the path itself, if the caller has it.
    """
    status = status or _status(path)
    folder = status is not None and stat.S_ISDIR(status.st_mode)
    return _stats(f"{path}/" if folder else path, status)


def content_digest(path: str) -> str:
    """Return the digest of a file's content; raises OSError like open()."""
    digest = hashlib.blake2b(digest_size=16)
    with open(path, "rb", buffering=0) as stream:
        while block := stream.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()


def stamp_inputs(inputs: Iterable[str], table: FileTable) -> str:
    """Return a stamp of files, and of the answers to questions."""
    inputs = tuple(inputs)
    answers = (f"{each}={table.answer(each)}" for each in inputs if not each.startswith("/"))
    return digest_strings(stamp_files(each for each in inputs if each.startswith("/")), *answers)


def contents_of(paths: Iterable[str], table: FileTable) -> dict[str, str]:
    """Return mode and content digest of each file as text, and the answer to each question."""
    return {path: _content(path, _status(path), table) for path in paths}


def digest_of(paths: Iterable[str], contents: Mapping[str, str]) -> str:
    """Return one digest of `paths` and their `contents`, as returned by `contents_of`."""
    return _digest("\n".join(f"{path}\0{contents[path]}" for path in paths))


def digest_strings(*strings: str) -> str:
    return _digest("\0".join(strings))


def code_digest(plugin: object) -> str:
    module = plugin if isinstance(plugin, ModuleType) else sys.modules[type(plugin).__module__]
    file = module.__file__ or ""
    files = source_files(os.path.dirname(file)) if file.endswith("/__init__.py") else (file,)
    return digest_strings(*(content_digest(path) for path in files if path.endswith(".py")))


def source_files(root: str, excluded: Collection[str] = ()) -> Iterator[str]:
    """Yield the paths of the files that count as sources, sorted folder by folder.

    Folders with one of the names `excluded` are skipped.
    """
    return (path for path, _, _ in _walk(root, excluded) if not path.endswith("/"))


def own_files(root: str) -> Iterator[tuple[str, os.stat_result]]:
    for path, status, via_link in _walk(root):
        if not via_link and stat.S_ISREG(status.st_mode):
            yield path, status


def source_folders(root: str) -> Mapping[str, list[str]]:
    """Return each folder that `source_files` looks into, and the files elsewhere that its links lead to."""
    link_targets: dict[str, list[str]] = {root: []} if os.path.isdir(root) else {}
    for path, status, _ in _walk(root):
        if path.endswith("/"):
            link_targets[path[:-1]] = []
        elif stat.S_ISLNK(status.st_mode) and not os.path.isdir(path):
            link_targets[os.path.dirname(path)].append(os.path.realpath(path))
    return link_targets


def _entries(folder: str, root: str) -> list[os.DirEntry[str]] | None:
    """Return the sorted entries of a folder, or None if it is not part of the sources below `root`.

    Not part of the sources are build, install and log folders, virtual environments, build folders of IDEs,
    and folders that have just disappeared. Raises other OSErrors.
    """
    try:
        with os.scandir(folder) as iterator:
            entries = sorted(iterator, key=lambda entry: entry.name)
    except (FileNotFoundError, NotADirectoryError):
        return None
    names = {entry.name for entry in entries}
    if IGNORE_MARK in names and names & _RESULTS:
        return None
    by_ide = "CMakeCache.txt" in names and os.path.basename(folder).startswith("cmake-build-")
    return None if folder != root and (by_ide or is_environment(names.__contains__)) else entries


def _walk(root: str, excluded: Collection[str] = ()) -> list[tuple[str, os.stat_result, bool]]:
    """Return each file and folder below `root` with its stat, and whether it was reached through a link.

    Paths of folders end with '/'.
    """
    visited: list[tuple[str, os.stat_result, bool]] = []

    def look_into(folder: str, ancestors: tuple[str, ...], itself: os.stat_result | None = None) -> None:
        """Enter a folder below the root and link targets, which are not entered again."""
        entries = _entries(folder, root)
        if entries is None:
            return
        has, via_link = {entry.name for entry in entries}.__contains__, len(ancestors) > 1
        if itself is not None:
            visited.append((f"{folder}/", itself, via_link))
        for entry in entries:
            name = entry.name
            is_folder = entry.is_dir(follow_symlinks=False)
            counts = is_source_folder if is_folder else is_source
            if (is_folder and name in excluded) or not counts(name, has):
                continue
            try:
                status = entry.stat(follow_symlinks=False)
            except FileNotFoundError:
                # A temporary file, such as an editor's, that was removed meanwhile.
                continue
            if is_folder:
                look_into(entry.path, ancestors, status)
                continue
            visited.append((entry.path, status, via_link))
            if entry.is_symlink() and os.path.isdir(entry.path):
                target = os.path.realpath(entry.path)
                # A link to a folder that contains the link would be followed endlessly.
                if not any(f"{os.path.realpath(each)}/".startswith(f"{target}/") for each in ancestors):
                    look_into(entry.path, (*ancestors, target), _status(target, follow=True))

    look_into(root, (root,))
    return visited


def _stats(path: str, status: os.stat_result | None) -> str:
    """Return the stat of an entry as text, for a link also that of its target."""
    if status is None:
        return ""
    if path.endswith("/"):
        # Times are omitted: they also change with files in the folder that are not sources.
        return f"{status.st_ino} {status.st_mode:o}"
    if not stat.S_ISLNK(status.st_mode):
        return _stat_text(status)
    target = _status(path, follow=True)
    return f"{_stat_text(status)} {_stat_text(target) if target else ''}"


def _digest(text: str) -> str:
    return hashlib.blake2b(text.encode(errors="surrogateescape"), digest_size=16).hexdigest()


def _content(path: str, status: os.stat_result | None, table: FileTable, stats: str = "") -> str:
    """Return the mode and content digest of a file as text, for a link also its target.

    `stats` is the result of `_stats`, if the caller has it.
    """
    if not path.startswith("/"):
        return table.answer(path)
    if status is None or stat.S_ISCHR(status.st_mode) or stat.S_ISBLK(status.st_mode):
        return "missing"  # devices come and go
    try:
        if path.endswith("/"):
            return f"folder {stat.S_IMODE(status.st_mode):o}"
        if path.endswith(DIR_LISTING_SUFFIX):
            # Commands that copy or archive a folder take its mode along.
            mode = f"{stat.S_IMODE(status.st_mode):o}"
            return f"names {mode} {_digest(chr(0).join(_listing(path)))}"
        if stat.S_ISREG(status.st_mode):
            return f"{stat.S_IMODE(status.st_mode):o} {table.digest(path, status, stats)}"
        if not stat.S_ISLNK(status.st_mode):
            return "special"
        target, real = os.readlink(path), _status(path, follow=True)
        if real is None or not stat.S_ISREG(real.st_mode):
            return f"link {target}"
        return f"link {target} {stat.S_IMODE(real.st_mode):o} {table.digest(path, real)}"
    except OSError:
        return "unreadable"


def _listing(folder: str) -> list[str]:
    """Return the sorted names in a folder, those of folders ending with '/' and those of links with '/@'.

    Listing a folder also returns these kinds. Devices are excluded.
    """
    with os.scandir(folder) as entries:
        return sorted(
            f"{entry.name}/@" if entry.is_symlink() else f"{entry.name}/" if entry.is_dir() else entry.name
            for entry in entries
            if not folder.startswith("/dev/") or entry.is_symlink() or entry.is_dir() or entry.is_file()
        )


def _status(path: str, *, follow: bool = False) -> os.stat_result | None:
    """Return the stat of a file, None for missing files and for questions."""
    try:
        return os.stat(path, follow_symlinks=follow) if path.startswith("/") else None
    except OSError:
        return None


def _stat_text(status: os.stat_result) -> str:
    return f"{status.st_mtime_ns} {status.st_ctime_ns} {status.st_size} {status.st_ino} {status.st_mode:o}"


def is_written_since(moment: int, status: os.stat_result) -> bool:
    """Return True if a file may have been written after a moment, in nanoseconds."""
    newest = max(status.st_mtime_ns, status.st_ctime_ns)
    whole_seconds = not (status.st_mtime_ns % 1_000_000_000 or status.st_ctime_ns % 1_000_000_000)
    return newest > moment - (_COARSE_NANOSECONDS if whole_seconds else RACY_NANOSECONDS)
