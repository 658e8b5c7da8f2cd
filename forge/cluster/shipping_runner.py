"""The runner for workers that do not see our folders: sources go there, results come by the package cache."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from forge.budget import BUILD
from forge.caching.model import RESTORED
from forge.caching.package_cache import KEPT
from forge.cluster.feed_reading import FeedReader
from forge.cluster.model import Errand, Parcel
from forge.cluster.sources import Unshippable
from forge.frozen import frozen
from forge.model import Aborted, Finished, Output, Step

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from forge.caching.package_cache import PackageCache
    from forge.cluster.line import Line
    from forge.cluster.model import Knock
    from forge.model import Event, Package, Task
    from forge.runner import Frame, Runner


@frozen
class Manifesto:
    """What a forge on a worker is told of this build, whichever package it is for.

    `words` and `arguments` are its options, `texts` the files that go beside the packages, `workspace` a name
    for all of it.
    """

    root: Path
    packages: Mapping[str, Package]
    words: tuple[str, ...]
    arguments: tuple[str, ...]
    environment: Mapping[str, str]
    texts: tuple[tuple[str, str], ...]
    workspace: str


class ShippingRunner:
    """Has packages built elsewhere by a forge of their own, then takes them from the cache."""

    def __init__(self, line: Line, told: Manifesto, here: Runner, frame: Frame, cache: PackageCache) -> None:
        """Remember the line, what workers are told, and what builds here what cannot be built there."""
        self._line = line
        self._told = told
        self._here = here
        self._frame = frame
        self._cache = cache
        self._own: set[str] = set()
        """Packages that only a build here has as they are; what needs them has another key elsewhere."""

    def run(self, task: Task, put: Callable[[Event], None]) -> None:
        """Have `task` built and put every event, the last a Finished or an Aborted."""
        begun = time.monotonic()
        if task.embedded or self._is_known(task):
            self._build_here(task, put)
            return
        if own := sorted(self._own.intersection(task.needs)):
            put(_told(task, f"'{task.name}' is built here: it needs '{own[0]}', which was", stderr=False))
            self._build_here(task, put)
            return
        try:
            parcel = self._parcel(task)
        except Unshippable as reason:
            put(_told(task, f"'{task.name}' is built here: {reason}"))
            self._build_here(task, put)
            return
        failure = self._abroad(task, parcel, put)
        if failure is not None:
            put(replace(failure, seconds=time.monotonic() - begun))
            return

        def pass_on(event: Event) -> None:
            if isinstance(event, Finished) and not event.code:
                event = replace(event, seconds=time.monotonic() - begun)
            put(event)

        self._build_here(task, pass_on)

    def _build_here(self, task: Task, put: Callable[[Event], None]) -> None:
        """Take a task from the cache, else build it, and note if nobody elsewhere can have the same."""
        self._here.run(task, put)
        if self._cache.notes.get(task.name) not in {KEPT, RESTORED}:
            self._own.add(task.name)

    def finish_steps(self) -> None:
        """Let running steps end and start no further one; elsewhere a package under way is one step."""
        self._line.finish_steps()
        self._here.finish_steps()

    def interrupt(self, *, kill: bool) -> None:
        """End all running programs now."""
        self._line.interrupt(kill=kill)
        self._here.interrupt(kill=kill)

    def _is_known(self, task: Task) -> bool:
        """Tell if the cache has the task's result, or has nothing to do with it."""
        found = self._cache.find(task)
        if found is not None:
            found.close()
        return found is not None

    def _parcel(self, task: Task) -> Parcel:
        """Return the sources of a package and of all that it needs; raises Unshippable."""
        archives = []
        for name in (*task.needs, task.name):
            package = self._told.packages[name]
            if package.embedded:
                continue
            source = self._told.root / package.path
            place = os.path.relpath(source, self._told.root)
            if place == os.curdir or place.startswith(os.pardir):
                raise Unshippable(f"'{name}' has no folder below that of the workspace")
            archives.append((place, self._line.digest(source)))
        return Parcel(self._told.workspace, tuple(archives), self._told.texts)

    def _abroad(self, task: Task, parcel: Parcel, put: Callable[[Event], None]) -> Finished | Aborted | None:
        """Have a worker build a task into the cache; return how it failed, if it did."""
        told = self._told
        step = Step(BUILD, (*told.words, "--packages-up-to", task.name, *told.arguments), Path())
        readers: list[FeedReader] = []
        complaints: list[bytes] = []

        def errand(_attempts: int, knock: Knock) -> Errand:
            readers.append(FeedReader(task, f"{knock.folder}/{parcel.workspace}", str(told.root)))
            there = replace(task, steps=(step,), files=())
            return Errand(there, told.environment, self._line.terms, parcel=parcel)

        for event in self._line.events(task.name, errand):
            match event:
                case Output(_, lines, stderr=False):
                    for said in readers[-1].read(lines):
                        put(said)
                case Output(_, lines) if lines.startswith(b"forge: "):
                    put(event)
                case Output(_, lines):
                    complaints.append(lines)
                case Finished(step=None, code=code) if code:
                    return event
                case Finished(code=code):
                    return self._judged(task, readers[-1], code, b"".join(complaints), put)
                case Aborted():
                    return event
                case _:
                    pass
        return None

    def _judged(
        self, task: Task, reader: FeedReader, code: int, complaints: bytes, put: Callable[[Event], None]
    ) -> Finished | None:
        """Say what came of a build elsewhere; return the failure of the package itself."""
        verdict = reader.verdict
        if verdict is not None and verdict.code:
            # So that a person finds here what the failed step would see.
            self._frame.open(task)
            self._frame.undo(task)
            return Finished(task.name, verdict.code, 0.0, verdict.step)
        if self._is_known(task):
            return None
        failed = sorted(name for name, ended in reader.others.items() if ended)
        if failed:
            why = f"'{failed[0]}', which it needs, could not be built on the worker"
        elif code:
            why = complaints.decode(errors="replace").partition("\n")[0] or f"forge there ended with {code}"
        elif verdict is not None and "not kept" in verdict.cache:
            why = f"its result cannot be had from there: {verdict.cache}"
        else:
            why = f"what the worker made is not found: {self._cache.remark(task.name)}"
        put(_told(task, f"'{task.name}' is built here: {why}"))
        return None


def _told(task: Task, text: str, *, stderr: bool = True) -> Output:
    return Output(task.name, f"forge: {text}\n".encode(errors="replace"), stderr=stderr)
