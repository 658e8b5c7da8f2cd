"""The package cache of one build: looks packages up before they are built, keeps them after.

Asked by the workers; each package is looked up or kept by one of them at a time.
"""

from __future__ import annotations

import hashlib
import os
import threading
import time
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING

from forge.caching import keys
from forge.caching.lineage import Lineage, unfit
from forge.caching.model import RESTORED, ActionResult, Digest, OutputFile, StoreFault
from forge.caching.outside import Outside
from forge.caching.processor import WORD, words_of
from forge.caching.relocation import ODD
from forge.caching.restoring import Contents, Planter
from forge.caching.trees import TICK, Unfit, index_of, strays, survey, tree_of
from forge.errors import Problem
from forge.frozen import frozen
from forge.tools import condensed, program_of

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping
    from pathlib import Path

    from forge.caching.folder_store import FolderStore
    from forge.caching.model import Store
    from forge.caching.outside import Seen
    from forge.caching.relocation import Places
    from forge.caching.trees import Tree
    from forge.caching.uploads import Uploads
    from forge.digests import FileTable
    from forge.layout import Layout
    from forge.model import Pairs, Record, Task

INDEX, PACK = "index", "pack"
"""What the blobs of a result are called; large files stand beside them under their own paths."""


@frozen
class Circle:
    """What the packages of one build have in common: folders, needs, programs, records, file tables.

    `own` is the table of forge's files and the programs'. `needs` are the direct ones of each package;
    `records` are looked up when asked, since they change. `forced` are packages that are to be built though
    the cache may have them.
    """

    layout: Layout
    places: Places
    needs: Mapping[str, frozenset[str]]
    tools: Pairs
    records: Mapping[str, Record]
    table: FileTable
    own: FileTable
    forced: Collection[str] = frozenset()


@frozen
class Held:
    """A result that waits until it is known what else was written between two times, in seconds."""

    package: str
    first: str
    inputs: keys.Inputs
    result: ActionResult
    began: float
    ended: float


@frozen
class Found:
    """A tree of the cache with its open, verified contents.

    `externals` are the files outside of the workspace that its build had read, `external` the digest of what
    they say.
    """

    tree: Tree
    contents: Contents
    externals: tuple[str, ...]
    external: str

    def close(self) -> None:
        """Let go of the contents."""
        self.contents.close()


class PackageCache:
    """A local folder of results, and perhaps a remote store behind it."""

    def __init__(
        self,
        circle: Circle,
        local: FolderStore,
        remote: Store | None = None,
        uploads: Uploads | None = None,
        warn: Callable[[Problem], object] = lambda _: None,
    ) -> None:
        """Remember the seams; nothing is opened yet. Without `uploads` the remote is only read."""
        self._circle = circle
        self._local = local
        self._remote = remote
        self._uploads = uploads
        self._warn = warn
        self._lineage = Lineage(circle.needs, circle.records, circle.layout, circle.places)
        self._outside = Outside(circle.places, circle.table)
        self._holding = threading.Lock()
        self._held: tuple[str, ...] | None = None
        self._keys: dict[str, str] = {}
        self._lists: dict[str, tuple[keys.Inputs, ...]] = {}
        self._complained = False
        self._held_back: list[Held] = []
        self.notes: dict[str, str] = {}
        """What became of each package, in words."""
        self._why: dict[str, str] = {}
        """Why each package that was looked for was not there."""
        self.restored: set[str] = set()
        self.missed: set[str] = set()
        self.grown = False
        """Whether something was added to the local folder."""

    @property
    def looked(self) -> Mapping[str, str]:
        """What the trees of packages come to of which no record had said so."""
        return self._lineage.looked

    def find(self, task: Task) -> Found | None:
        """Return what the cache has for a task, brought here and verified, or None: then it will be built."""
        found = self._looked_up(task)
        if found is None:
            self._outside.distrust()
        return found

    def restore(self, task: Task, found: Found) -> tuple[dict[str, os.stat_result | None], tuple[str, ...]]:
        """Write what was found into the task's prefix.

        Return the absolute paths of the files, sorted, each with its stat if it is small and was written now,
        and those of empty folders.
        """
        planter = Planter(task.prefix, self._circle.places)
        planter.plant(found.tree, found.contents)
        stats = {}
        for path, status, digest in planter.written:
            self._circle.table.learn(path, status, digest)
            stats[path] = status
        paths = sorted(f"{task.prefix}/{leaf.path}" for leaf in found.tree.leaves)
        empty = tuple(f"{task.prefix}/{path}/" for path in found.tree.empty_folders)
        return {path: stats.get(path) for path in paths}, empty

    def keep(self, task: Task, record: Record) -> Record:
        """Keep what a task has just installed; return its record with what its tree comes to."""
        key = self._keys.get(task.name)
        if key is None:
            return record
        doubt = _doubt(record)
        if doubt:
            self.notes[task.name] = f"not kept: {doubt}"
            return record
        try:
            tree = self._put(task, key, record)
        except Unfit as reason:
            self.notes[task.name] = f"not kept: {reason}"
            return replace(record, tree=unfit(record))
        except (OSError, StoreFault) as fault:
            self.notes[task.name] = f"not kept: {fault}"
            self._complain(fault)
            return record
        self.notes[task.name] = f"kept for this path alone: {tree.bound}" if tree.bound else KEPT
        return replace(record, tree=tree.digest)

    def settle(self) -> None:
        """Let keys lead to what was kept, once all packages have ended.

        In a merged prefix nobody can tell whose a file is that no tool lists, as one that CMake code writes:
        what was built while it appeared is not kept.
        """
        since = min((held.began for held in self._held_back), default=0.0)
        found = strays(self._circle.layout.install, self._circle.records, since) if self._held_back else {}
        for held in self._held_back:
            near = (path for path, at in found.items() if held.began - TICK <= at <= held.ended + TICK)
            stray = next(near, None)
            if stray is None:
                self._publish(held)
            else:
                self.notes[held.package] = f"not kept: '{stray}' appeared meanwhile, which no tool lists"
        self._held_back.clear()

    def remark(self, name: str) -> str:
        """Return in words what the cache had to do with a package, '' for nothing."""
        return "; ".join(filter(None, (self._why.get(name), self.notes.get(name))))

    def _looked_up(self, task: Task) -> Found | None:
        if not self._concerns(task):
            return None
        self._keys[task.name] = key = self._first_key(task)
        if task.name in self._circle.forced:
            return None
        found = self._find_in(self._local, key)
        if found is None and self._remote is not None:
            found = self._find_in(self._remote, key)
        self.notes[task.name] = RESTORED if found else ""
        self._why[task.name] = "" if found else self._why_not(key)
        (self.restored if found else self.missed).add(task.name)
        if found:
            # Another machine may have built it since it was missed.
            self.missed.discard(task.name)
        return found

    def _concerns(self, task: Task) -> bool:
        """Tell if the cache has to do with a task, and if not, why."""
        if self._circle.layout.symlink and not task.embedded:
            self.notes[task.name] = "not kept: it is installed by links"
            return False
        unknown = next((need for need in task.needs if need not in self._circle.records), None)
        if unknown:
            self.notes[task.name] = f"not looked up: how '{unknown}', which it needs, was built nobody knows"
        return unknown is None

    def _first_key(self, task: Task) -> str:
        with self._holding:  # the first packages ask at the same time
            if self._held is None:
                self._held = keys.circumstances(self._circle.tools, self._circle.own)
        needs = self._lineage.needs_of(task.name, task.needs)
        return keys.first_key(task, needs, (*self._held, *self._own_programs(task)), self._circle.places)

    def _own_programs(self, task: Task) -> list[str]:
        """Return what programs say that this package alone names."""
        shared = frozenset(condensed(self._circle.tools))
        paths = {n: program_of(identity) for n, identity in task.parts.tools if (n, identity) not in shared}
        words = {name: self._circle.places.loose_word(os.path.realpath(path)) for name, path in paths.items()}
        contents = self._outside.look(words.values()).contents
        return [f"{os.path.basename(name)} {contents[word]}" for name, word in sorted(words.items())]  # noqa: PTH119

    def _find_in(self, store: Store, first: str) -> Found | None:
        """Return what a store has for any of the lists of inputs that it knows, the latest first."""
        try:
            lists = self._lists_in(store, first)
            for inputs in lists:
                if not inputs.holds_at(self._circle.places):
                    continue
                seen = self._outside.look(inputs.paths)
                second = keys.second_key(first, inputs, seen.contents, self._circle.places)
                result = store.result(second)
                found = result and self._brought(store, result, seen)
                if result and found:
                    if store is not self._local:
                        self._remember(first, second, inputs, result)
                    return found
        except (StoreFault, OSError, ValueError) as fault:
            self._complain(fault)
        return None

    def _lists_in(self, store: Store, first: str) -> tuple[keys.Inputs, ...]:
        result = store.result(first)
        found = keys.read(result.stdout) if result else ()
        self._lists[first] = tuple(dict.fromkeys((*self._lists.get(first, ()), *found)))
        return found

    def _brought(self, store: Store, result: ActionResult, seen: Seen) -> Found | None:
        """Return a result with its blobs in the local folder, open and verified; None when one is missing.

        Raises ValueError for a result that no forge has made.
        """
        blobs = {file.path: file.digest for file in result.files}
        if not {INDEX, PACK} <= blobs.keys():
            raise ValueError(f"{store.name}: a result without index and pack")
        with ExitStack() as opened:
            index = self._open(store, blobs.pop(INDEX), opened)
            if index is None:
                return None
            tree = tree_of(_whole(index))
            pack = self._open(store, tree.pack, opened) if tree.pack else None
            large = {}
            for digest in {
                Digest(leaf.hash, leaf.size) for leaf in tree.leaves if leaf.offset < 0 and leaf.hash
            }:
                large[digest.hash] = self._open(store, digest, opened)
            descriptors = {name: number for name, number in large.items() if number is not None}
            if pack is None or len(descriptors) < len(large):
                return None
            opened.pop_all()
        os.close(index)
        return Found(tree, Contents(pack, descriptors), *seen.record)

    def _open(self, store: Store, digest: Digest, opened: ExitStack) -> int | None:
        """Open a verified blob of the local folder, brought there from `store` if it is not."""
        descriptor = self._local.open(digest)
        if descriptor is None and store is not self._local:
            draft = self._local.draft()
            if store.fetch(digest, draft):
                self._local.adopt(draft, digest)
                descriptor = self._local.open(digest)
        if descriptor is not None:
            opened.callback(os.close, descriptor)
        return descriptor

    def _put(self, task: Task, first: str, record: Record) -> Tree:
        """Put a package's tree into the stores and let its keys lead to it."""
        draft = self._local.draft()
        try:
            with draft.open("xb") as pack:
                tree = survey(task.name, self._circle.layout, record, self._circle.places, pack.write)
            if self._circle.places.kind == ODD and not tree.bound:
                tree = replace(
                    tree, bound="the path of the workspace has other signs than letters and blanks"
                )
            tree = replace(tree, seconds=round(time.time() - record.began, 3))
            blobs = self._put_blobs(task.prefix, tree, draft)
        finally:
            draft.unlink(missing_ok=True)
        places = self._circle.places
        read = (*map(places.loose_word, record.externals), *words_of(task, places.root / task.package.path))
        inputs = keys.Inputs(read, tree.bound, places.kind)
        result = ActionResult(tuple(OutputFile(name, digest) for name, digest in blobs.items()))
        held = Held(task.name, first, inputs, result, record.began, time.time())
        if self._circle.layout.merged:
            self._held_back.append(held)
        else:
            self._publish(held)
        return tree

    def _publish(self, held: Held) -> None:
        """Let both keys of a result lead to it, here and in the remote store."""
        contents = self._outside.look(held.inputs.paths).contents
        second = keys.second_key(held.first, held.inputs, contents, self._circle.places)
        self._remember(held.first, second, held.inputs, held.result)
        if self._uploads is not None:
            paths = {file.digest: self._local.blob_path(file.digest.hash) for file in held.result.files}
            self._uploads.add(second, held.result, paths)
            self._uploads.add(held.first, ActionResult(stdout=keys.written(self._lists[held.first])), {})

    def _put_blobs(self, prefix: Path, tree: Tree, pack: Path) -> dict[str, Digest]:
        """Put index, pack and large files of a tree into the local folder; return them by name."""
        assert tree.pack is not None  # noqa: S101  (survey() says so)
        index = index_of(tree)
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

    def _remember(self, first: str, second: str, inputs: keys.Inputs, result: ActionResult) -> None:
        """Let both keys lead to a result in the local folder; the list comes first from now on."""
        self.grown = True
        self._lists[first] = tuple(dict.fromkeys((inputs, *self._lists.get(first, ()))))
        self._local.put_result(second, result)
        self._local.put_result(first, ActionResult(stdout=keys.written(self._lists[first])))

    def _why_not(self, first: str) -> str:
        lists = self._lists.get(first, ())
        bound = next((inputs.bound for inputs in lists if inputs.bound), "")
        if bound:
            return f"not in the cache for this path: elsewhere {bound}"
        if lists and not any(inputs.holds_at(self._circle.places) for inputs in lists):
            return "not in the cache for this path: what was made elsewhere lacks the quotes that it takes"
        if lists and all(WORD in inputs.paths for inputs in lists):
            return "not in the cache: a file outside of the workspace, or the processor, is another one"
        return "not in the cache: a file outside of the workspace says something else" if lists else MISSED

    def _complain(self, fault: Exception) -> None:
        """Say once that the local folder cannot be used, or that it holds nonsense."""
        if not self._complained:
            self._complained = True
            hint = "packages are built instead; 'forge cache verify' looks for what is spoilt"
            self._warn(Problem(f"the cache: {fault}", hint=hint))


KEPT, MISSED = "kept", "not in the cache"


def _whole(descriptor: int) -> bytes:
    size = os.fstat(descriptor).st_size
    return os.pread(descriptor, size, 0)


def _doubt(record: Record) -> str:
    """Return why others must not be given what a build made; '' when it is what anybody would have made."""
    if record.saved:
        return f"'{record.saved[0]}' was saved while it was built"
    return "" if record.from_empty else "it was built in a folder that was not empty"
