"""The package cache of a build: look up packages before they are built, and store them afterwards.

A result is for the workspace where it was built, until a build in a workspace with a sufficiently different
path has the same result: then it is for any workspace.

Called by the workers; each package is looked up or stored by one of them at a time.
"""

from __future__ import annotations

import hashlib
import os
import threading
import time
from contextlib import ExitStack, suppress
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.errors import Problem
from forge.base.frozen import Pairs, frozen
from forge.build.inputs.fingerprints import FileTable, digest_of
from forge.build.tests.recipes import has_ctests
from forge.cache.model import RESTORED, ActionResult, Digest, OutputFile, RemoteStore, StoreError
from forge.plugins.package_cache import keys
from forge.plugins.package_cache.keys import scripts_digest
from forge.plugins.package_cache.trees import (
    TICK,
    CachedTree,
    Tree,
    TreeWriter,
    Uncacheable,
    decode_index,
    encode_index,
    scan_tree,
    unrecorded_files,
)
from forge.toolchain.programs import condensed, program_of
from forge.workspace.model import CMAKE_TYPES

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping

    from forge.base.layout import Layout
    from forge.build.model import BuildRecord
    from forge.build.tasks import Task
    from forge.plugins.package_cache.folder_store import FolderStore
    from forge.plugins.package_cache.relocation import Relocator

INDEX, PACK = "index", "pack"
"""The names of a result's blobs; large files are stored beside them under their own paths."""


@frozen
class CacheContext:
    """The shared state of one build: folders, dependencies, programs, records, the file table.

    `needs` are the direct dependencies of each package; `records` change during the build. `forced` are
    packages to build even if the cache has them. `values` are the values of variables that affect all
    packages. The inputs of builds that are not `observed` are incomplete: only such builds use their results.
    """

    layout: Layout
    relocator: Relocator
    needs: Mapping[str, frozenset[str]]
    tools: Pairs
    records: Mapping[str, BuildRecord]
    table: FileTable
    forced: Collection[str] = frozenset()
    values: Mapping[str, str] = field(default_factory=dict)
    observed: bool = True


@frozen
class PendingResult:
    """A result to publish after checking other writes between `began` and `ended`, in seconds."""

    package: str
    first: str
    words: tuple[str, ...]
    tree: Tree
    blobs: Mapping[str, Digest]
    scripts: str
    began: float
    ended: float


class PackageCache:
    """A local folder of results, and perhaps a remote store behind it."""

    def __init__(
        self,
        context: CacheContext,
        local: FolderStore,
        remote: RemoteStore | None = None,
        warn: Callable[[Problem], object] = lambda _: None,
    ) -> None:
        self._context = context
        self._local = local
        self._remote = remote
        self._warn = warn
        self._external_inputs = keys.ExternalInputs(context.relocator, context.table)
        self._lock = threading.Lock()
        self._shared_inputs: tuple[str, ...] | None = None
        self._keys: dict[str, str] = {}
        """The first keys of packages that were looked up."""
        self._settings: dict[str, str] = {}
        """The parts of these keys without sources and dependencies."""
        self._installed_keys: dict[str, str] = {}
        """The keys of installed packages, computed on demand for the first keys of their dependents."""
        self.computed_trees: dict[str, str] = {}
        """Tree digests computed for packages whose records had none."""
        self._lists: dict[str, tuple[tuple[str, ...], ...]] = {}
        """The lists of external files by first keys."""
        self._elsewhere: dict[str, keys.Origin] = {}
        """The origin of a result that may differ at this path, by first keys."""
        self._warned = False
        self._pending: list[PendingResult] = []
        self.notes: dict[str, str] = {}
        """The result of storing or restoring each package, as text."""
        self._miss_reasons: dict[str, str] = {}
        """The reason of each cache miss."""
        self.restored: set[str] = set()
        self.missed: set[str] = set()
        self.has_grown = False
        """True if entries were added to the local folder."""

    def find(self, task: Task) -> CachedTree | None:
        """Return the cached result of a task, downloaded and verified, or None if it must be built."""
        cached_tree = self._look_up(task)
        if cached_tree is None:
            self._external_inputs.stop_caching()
        return cached_tree

    def restore(self, task: Task, found: CachedTree) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Write a cached tree into the task's prefix; return the paths of the files and empty folders."""
        writer = TreeWriter(task.prefix, self._context.relocator)
        writer.write_tree(found)
        for path, status, digest in writer.written:
            self._context.table.learn(path, status, digest)
        paths = tuple(sorted(f"{task.prefix}/{leaf.path}" for leaf in found.tree.leaves))
        empty = tuple(f"{task.prefix}/{path}/" for path in found.tree.empty_folders)
        return paths, empty

    def keep(self, task: Task, record: BuildRecord) -> BuildRecord:
        """Store the installed files of a task; return its record with the digest of its tree."""
        key = self._keys.get(task.name)
        if key is None:
            return record
        problem = "" if record.from_empty else "its build folder was not empty"
        if record.saved:
            problem = f"'{record.saved[0]}' was modified during the build"
        if problem:
            self.notes[task.name] = f"not cached: {problem}"
            return record
        try:
            tree = self._put(task, key, record)
        except Uncacheable as reason:
            self.notes[task.name] = f"not cached: {reason}"
            return replace(record, tree=_uncacheable_tree(record))
        except (OSError, StoreError) as fault:
            self.notes[task.name] = f"not cached: {fault}"
            self._warn_once(fault)
            return record
        return replace(record, tree=tree.digest)

    def finish(self) -> None:
        """Publish the pending results after all packages have ended.

        In a merged prefix, the owner of a file without install manifest, such as one written by CMake code,
        is unknown. Packages that were built while it appeared are not cached.
        """
        since = min((pending.began for pending in self._pending), default=0.0)
        times = (
            unrecorded_files(self._context.layout.install, self._context.records, since)
            if self._pending
            else {}
        )
        for pending in self._pending:
            near = (path for path, at in times.items() if pending.began - TICK <= at <= pending.ended + TICK)
            unrecorded = next(near, None)
            record = self._context.records.get(pending.package)
            if record and record.saved:  # found only after all packages had ended
                self.notes[pending.package] = f"not cached: '{record.saved[0]}' was modified during the build"
            elif unrecorded is None:
                self._publish(pending)
            else:
                self.notes[pending.package] = (
                    f"not cached: '{unrecorded}' appeared during the build without being listed"
                )
        self._pending.clear()

    def remark(self, name: str) -> str:
        """Return the remarks of the cache about a package, or ''."""
        return "; ".join(filter(None, (self._miss_reasons.get(name), self.notes.get(name))))

    def _look_up(self, task: Task) -> CachedTree | None:
        if self._context.layout.symlink and not task.embedded:
            self.notes[task.name] = "not cached: installed with symbolic links"
            return None
        unknown = next((need for need in task.needs if need not in self._context.records), None)
        if unknown:
            self.notes[task.name] = f"not looked up: there is no build record of its dependency '{unknown}'"
            return None
        context = self._context
        with self._lock:  # several packages start at the same time
            if self._shared_inputs is None:
                self._shared_inputs = keys.shared_inputs(context.tools, context.table)
        needs = self._dependencies(task)
        shared = (*self._shared_inputs, *self._package_programs(task))
        shared += () if context.observed else ("not observed",)
        settings = keys.settings_key(task, shared, context.relocator, context.values)
        self._settings[task.name] = settings
        self._keys[task.name] = key = keys.input_key(settings, task, needs)
        if task.name in self._context.forced:
            return None
        cached_tree = self._find_in(key, None)
        if cached_tree is None and self._remote is not None:
            cached_tree = self._find_in(key, self._remote)
        self.notes[task.name] = RESTORED if cached_tree else ""
        reason = "" if cached_tree else "not in the cache"
        if reason and (origin := self._elsewhere.get(key)):
            reason += f" for this path: only built in '{origin.root}' so far"
            if origin.different:
                reason = f"not in the cache for this path: '{origin.different}' depends on it"
        elif reason and self._lists.get(key):
            reason += ": a file outside the workspace differs"
        self._miss_reasons[task.name] = reason
        (self.restored if cached_tree else self.missed).add(task.name)
        if cached_tree:
            # Another machine may have built it since the miss.
            self.missed.discard(task.name)
        return cached_tree

    def _dependencies(self, task: Task) -> tuple[tuple[str, str], ...]:
        """Return the direct dependencies of a task with the keys of their installed files.

        A key covers the package's own tree and the keys of its dependencies, but no path. If a rebuilt
        package has an identical tree, the keys of its dependents do not change.
        """
        context = self._context
        for name in task.needs:  # all of them, in topological order
            if name in self._installed_keys:
                continue
            record = context.records[name]
            tree = record.tree
            if not tree:
                try:
                    tree = scan_tree(name, context.layout, record, context.relocator).digest
                except (Uncacheable, OSError):
                    tree = _uncacheable_tree(record)
                self.computed_trees[name] = tree
            parts = (tree, *(self._installed_keys[need] for need in sorted(context.needs[name])))
            self._installed_keys[name] = hashlib.sha256("\0".join(parts).encode()).hexdigest()
        return tuple((need, self._installed_keys[need]) for need in sorted(context.needs[task.name]))

    def _package_programs(self, task: Task) -> list[str]:
        """Return the content digests of programs that only this package names."""
        shared = frozenset(condensed(self._context.tools))
        paths = {n: program_of(identity) for n, identity in task.inputs.tools if (n, identity) not in shared}
        words = {
            name: self._context.relocator.relativize_word(os.path.realpath(path))
            for name, path in paths.items()
        }
        contents = self._external_inputs.contents(words.values())
        return [f"{os.path.basename(name)} {contents[word]}" for name, word in sorted(words.items())]  # noqa: PTH119

    def _find_in(self, first: str, remote: RemoteStore | None) -> CachedTree | None:
        """Return the result in a store for one of its lists of inputs; the latest list is tried first.

        Without `remote`, the store is the local folder.
        """
        store, relocator = remote or self._local, self._context.relocator
        # Scripts for a path without blanks may lack quotes that another path needs.
        roots = ("", relocator.root) if relocator.is_plain else (relocator.root,)
        try:
            index = store.result(first)
            lists = keys.decode_lists(index.stdout) if index else ()
            self._lists[first] = tuple(dict.fromkeys((*self._lists.get(first, ()), *lists)))
            for words in lists:
                seen = self._external_inputs.look(words)
                contents = {word: content for word, (_, content) in seen.items()}
                for root in roots:
                    second = keys.result_key(first, words, contents, root)
                    result = store.result(second)
                    if result is None:
                        continue
                    origin = keys.decode_origin(result.stdout)
                    if not (root or origin.shown or origin.root == relocator.root):
                        self._elsewhere[first] = origin
                        continue
                    if cached_tree := self._fetch_result(remote, result, seen):
                        if remote:
                            self._store(first, second, words, result, upload=False)
                        return cached_tree
        except (StoreError, OSError, ValueError) as fault:
            self._warn_once(fault)
        return None

    def _fetch_result(
        self, remote: RemoteStore | None, result: ActionResult, seen: Mapping[str, tuple[str, str]]
    ) -> CachedTree | None:
        """Return a result with its verified blobs, copied to the local folder; None if one is missing.

        Raises ValueError for a result that forge did not create.
        """
        blobs = {file.path: file.digest for file in result.files}
        if not {INDEX, PACK} <= blobs.keys():
            raise ValueError(f"{(remote or self._local).name}: invalid result without index and pack")
        with ExitStack() as opened:
            index = self._open(remote, blobs.pop(INDEX), opened)
            if index is None:
                return None
            tree = decode_index(os.pread(index, os.fstat(index).st_size, 0))
            pack = self._open(remote, tree.pack, opened) if tree.pack else None
            large = {}
            for digest in {
                Digest(leaf.hash, leaf.size) for leaf in tree.leaves if leaf.offset < 0 and leaf.hash
            }:
                large[digest.hash] = self._open(remote, digest, opened)
            descriptors = {name: number for name, number in large.items() if number is not None}
            if pack is None or len(descriptors) < len(large):
                return None
            opened.pop_all()
        os.close(index)
        externals = dict(seen.values())
        return CachedTree(tree, pack, descriptors, tuple(externals), digest_of(externals, externals))

    def _open(self, remote: RemoteStore | None, digest: Digest, opened: ExitStack) -> int | None:
        """Open a verified blob of the local folder; fetch it from `remote` if it is missing."""
        descriptor = self._local.open(digest)
        if descriptor is None and remote:
            draft = self._local.draft()
            if remote.fetch(digest, draft):
                self._local.adopt(draft, digest)
                descriptor = self._local.open(digest)
        if descriptor is not None:
            opened.callback(os.close, descriptor)
        return descriptor

    def _put(self, task: Task, first: str, record: BuildRecord) -> Tree:
        """Store a package's tree and publish its result."""
        draft = self._local.draft()
        try:
            with draft.open("xb") as pack:
                tree = scan_tree(task.name, self._context.layout, record, self._context.relocator, pack.write)
            has_tests = task.package.build_type not in CMAKE_TYPES or has_ctests(task.build_dir)
            tree = replace(tree, seconds=round(time.time() - record.began, 3), has_tests=has_tests)
            blobs = self._put_blobs(task.prefix, tree, draft)
        finally:
            draft.unlink(missing_ok=True)
        words = tuple(map(self._context.relocator.relativize_input, record.externals))
        source = Path(self._context.relocator.root, task.package.path)
        scripts = scripts_digest(task.build_dir, source, tree, self._context.relocator)
        pending = PendingResult(task.name, first, words, tree, blobs, scripts, record.began, time.time())
        if self._context.layout.merged:
            self._pending.append(pending)
        else:
            self._publish(pending)
        return tree

    def _publish(self, pending: PendingResult) -> None:
        """Store a result locally and in the remote store.

        For any path if path independence was shown, else for this one. If a build elsewhere had another
        result, that result is marked, so that no later build counts as proof.
        """
        root, first, words = self._context.relocator.root, pending.first, pending.words
        contents = self._external_inputs.contents(words)
        second, own = (keys.result_key(first, words, contents, path) for path in ("", root))
        scripts = keys.scripts_key(self._settings[pending.package], words, contents, pending.scripts)
        before, tree = self._published(second)
        origin = keys.decode_origin(before.stdout) if before else keys.Origin(root)
        is_here = origin.root == root and not origin.shown
        different = "" if is_here or tree is None else pending.tree.difference(tree)
        key, here = second if is_here else own, keys.Origin(root, scripts=scripts)
        if not self._context.relocator.is_plain:
            key, note = own, "cached for this path only: it contains blanks or special characters"
        elif before and different and different != origin.different:
            note = f"cached for this path only: '{different}' differs from the one built in '{origin.root}'"
            doubted = keys.encode_origin(replace(origin, shown=False, different=different))
            self._store(first, second, words, replace(before, stdout=doubted))
            for each in {origin.scripts, scripts} - {""}:
                self._put_result(each, ActionResult(stdout=doubted))
        elif is_here and not origin.different and (proof := self._known_scripts(scripts)) and proof.shown:
            here = replace(here, shown=True)
            note = "cached for any path: the same build scripts did not depend on it"
        elif is_here:
            here = replace(here, different=origin.different)
            note = "cached for this path"
        elif origin.different:
            note = f"cached for this path only: '{origin.different}' depends on it"
        elif origin.shown or origin.is_unlike(root):
            key, here = second, replace(origin, shown=True)
            note = f"cached for any path: the result is the same as in '{origin.root}'"
            if scripts and scripts == origin.scripts and self._known_scripts(scripts) is None:
                self._put_result(scripts, ActionResult(stdout=keys.encode_origin(here)))
        else:
            note = f"cached for this path: '{origin.root}' is too similar to show that it does not matter"
        files = tuple(OutputFile(name, digest) for name, digest in pending.blobs.items())
        self._store(first, key, words, ActionResult(files, keys.encode_origin(here)))
        self.notes[pending.package] = note

    def _known_scripts(self, key: str) -> keys.Origin | None:
        for read in (self._remote and self._remote.result, self._local.result):
            with suppress(StoreError, ValueError):
                if key and read and (result := read(key)):
                    return keys.decode_origin(result.stdout)
        return None

    def _published(self, key: str) -> tuple[ActionResult | None, Tree | None]:
        """Return a published result, of any workspace, with its tree; None for an invalid one."""
        for read in (self._remote and self._remote.result, self._local.result):
            with ExitStack() as opened, suppress(StoreError, OSError, ValueError):
                result = read(key) if read else None
                blobs = {file.path: file.digest for file in result.files} if result else {}
                index = self._open(self._remote, blobs[INDEX], opened) if INDEX in blobs else None
                if result and index is not None:
                    keys.decode_origin(result.stdout)
                    return result, decode_index(os.pread(index, os.fstat(index).st_size, 0))
        return None, None

    def _store(
        self, first: str, key: str, words: tuple[str, ...], result: ActionResult, *, upload: bool = True
    ) -> None:
        """Store a result, and its list of inputs as the first one for the first key."""
        self._lists[first] = tuple(dict.fromkeys((words, *self._lists.get(first, ()))))
        self._put_result(key, result, upload=upload)
        self._put_result(first, ActionResult(stdout=keys.encode_lists(self._lists[first])), upload=upload)

    def _put_result(self, key: str, result: ActionResult, *, upload: bool = True) -> None:
        self.has_grown = True
        self._local.put_result(key, result)
        if self._remote is not None and upload:
            paths = {file.digest: self._local.blob_path(file.digest.hash) for file in result.files}
            # Missing blobs are already in the store that the result came from.
            here = {digest: path for digest, path in paths.items() if path.is_file()}
            self._remote.upload(key, result, here)

    def _put_blobs(self, prefix: Path, tree: Tree, pack: Path) -> dict[str, Digest]:
        """Store index, pack and large files of a tree in the local folder; return their digests by name."""
        assert tree.pack is not None
        index = encode_index(tree)
        digest = Digest(hashlib.sha256(index).hexdigest(), len(index))
        self._local.adopt(pack, tree.pack)
        draft = self._local.draft()
        draft.write_bytes(index)
        self._local.adopt(draft, digest)
        blobs = {INDEX: digest, PACK: tree.pack}
        for leaf in tree.leaves:
            if leaf.offset < 0 and leaf.hash:
                blobs[leaf.path] = Digest(leaf.hash, leaf.size)
                self._local.put(blobs[leaf.path], prefix / leaf.path)
        return blobs

    def _warn_once(self, fault: Exception) -> None:
        """Warn once that the cache is unusable or contains invalid data."""
        if not self._warned:
            self._warned = True
            hint = "packages are built instead; run 'forge cache verify' to find corrupt files"
            self._warn(Problem(f"the cache: {fault}", hint=hint))


def _uncacheable_tree(record: BuildRecord) -> str:
    """Return a substitute tree digest for a package that cannot be cached; it is valid at one path only."""
    return f"unfit {record.installed.digest}"
