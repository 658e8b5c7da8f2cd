"""The runner for workers without shared folders: it sends sources and gets results from the package cache."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.build.events import Aborted, Finished, Output
from forge.build.tasks import Step
from forge.cache.model import RESTORED
from forge.cache.package_cache import KEPT
from forge.execution.dask.feed_reading import FeedReader
from forge.execution.dask.model import RemoteTask, SourceBundle
from forge.execution.dask.sources import Unshippable
from forge.execution.job_pool import BUILD

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from forge.build.events import Event
    from forge.build.tasks import Task
    from forge.cache.package_cache import PackageCache
    from forge.execution.dask.connection import Connection
    from forge.execution.dask.model import TaskRequest
    from forge.execution.runner import Runner, TaskLifecycle
    from forge.workspace.model import Package


@frozen
class RemoteConfig:
    """The configuration of forge on the workers, shared by all packages of a build.

    `words` and `arguments` are its command line before and after the package, `texts` the files beside the
    packages, `workspace` an id of the workspace.
    """

    root: Path
    packages: Mapping[str, Package]
    words: tuple[str, ...]
    arguments: tuple[str, ...]
    environment: Mapping[str, str]
    texts: tuple[tuple[str, str], ...]
    workspace: str


class ShippingRunner:
    """Lets forge on a worker build each package, then restores it from the cache."""

    def __init__(
        self,
        connection: Connection,
        config: RemoteConfig,
        local: Runner,
        lifecycle: TaskLifecycle,
        cache: PackageCache,
    ) -> None:
        """Store the connection, the workers' configuration, and the runner for local builds."""
        self._connection = connection
        self._config = config
        self._local = local
        self._lifecycle = lifecycle
        self._cache = cache
        self._local_only: set[str] = set()
        """Packages that exist only locally; packages that need them would have another key on a worker."""

    def run(self, task: Task, put: Callable[[Event], None]) -> None:
        """Build `task` and put every event; the last is Finished or Aborted."""
        begun = time.monotonic()
        if task.embedded or self._is_known(task):
            self._build_here(task, put)
            return
        if local_only := sorted(self._local_only.intersection(task.needs)):
            put(
                _output(
                    task,
                    f"'{task.name}' is built locally: it needs '{local_only[0]}', which was",
                    stderr=False,
                )
            )
            self._build_here(task, put)
            return
        try:
            bundle = self._make_bundle(task)
        except Unshippable as reason:
            put(_output(task, f"'{task.name}' is built locally: {reason}"))
            self._build_here(task, put)
            return
        failure = self._build_remotely(task, bundle, put)
        if failure is not None:
            put(replace(failure, seconds=time.monotonic() - begun))
            return

        def pass_on(event: Event) -> None:
            if isinstance(event, Finished) and not event.code:
                event = replace(event, seconds=time.monotonic() - begun)
            put(event)

        self._build_here(task, pass_on)

    def _build_here(self, task: Task, put: Callable[[Event], None]) -> None:
        """Restore a task from the cache or build it; note whether its result is available to workers."""
        self._local.run(task, put)
        if self._cache.notes.get(task.name) not in {KEPT, RESTORED}:
            self._local_only.add(task.name)

    def finish_steps(self) -> None:
        """Let running steps finish and start no further step; on a worker, a package is one step."""
        self._connection.finish_steps()
        self._local.finish_steps()

    def interrupt(self, *, kill: bool) -> None:
        """Terminate all running programs; with `kill`, immediately."""
        self._connection.interrupt(kill=kill)
        self._local.interrupt(kill=kill)

    def _is_known(self, task: Task) -> bool:
        """Return True if the cache has the result of a task."""
        found = self._cache.find(task)
        if found is not None:
            found.close()
        return found is not None

    def _make_bundle(self, task: Task) -> SourceBundle:
        """Return the sources of a package and its dependencies; raises Unshippable."""
        archives = []
        for name in (*task.needs, task.name):
            package = self._config.packages[name]
            if package.embedded:
                continue
            source = self._config.root / package.path
            folder = os.path.relpath(source, self._config.root)
            if folder == os.curdir or folder.startswith(os.pardir):
                raise Unshippable(f"'{name}' is not in a subfolder of the workspace")
            archives.append((folder, self._connection.digest(source)))
        return SourceBundle(self._config.workspace, tuple(archives), self._config.texts)

    def _build_remotely(
        self, task: Task, bundle: SourceBundle, put: Callable[[Event], None]
    ) -> Finished | Aborted | None:
        """Let a worker build a task into the cache; return the event of a failure, else None."""
        config = self._config
        step = Step(BUILD, (*config.words, "--packages-up-to", task.name, *config.arguments), Path())
        readers: list[FeedReader] = []
        errors: list[bytes] = []

        def remote_task(_attempts: int, request: TaskRequest) -> RemoteTask:
            readers.append(FeedReader(task, f"{request.folder}/{bundle.workspace}", str(config.root)))
            there = replace(task, steps=(step,), files=())
            return RemoteTask(there, config.environment, self._connection.terms, bundle=bundle)

        for event in self._connection.events(task.name, remote_task):
            match event:
                case Output(_, lines, stderr=False):
                    for remote_event in readers[-1].read(lines):
                        put(remote_event)
                case Output(_, lines) if lines.startswith(b"forge: "):
                    put(event)
                case Output(_, lines):
                    errors.append(lines)
                case Finished(step=None, code=code) if code:
                    return event
                case Finished(code=code):
                    return self._check_result(task, readers[-1], code, b"".join(errors), put)
                case Aborted():
                    return event
                case _:
                    pass
        return None

    def _check_result(
        self, task: Task, reader: FeedReader, code: int, errors: bytes, put: Callable[[Event], None]
    ) -> Finished | None:
        """Report the result of a remote build; return the failure of the package itself, else None."""
        verdict = reader.verdict
        if verdict is not None and verdict.code:
            # Write the environment of the failed step locally, so that it can be repeated by hand.
            self._lifecycle.open(task)
            self._lifecycle.undo(task)
            return Finished(task.name, verdict.code, 0.0, verdict.step)
        if self._is_known(task):
            return None
        failed = sorted(name for name, ended in reader.others.items() if ended)
        if failed:
            reason = f"its dependency '{failed[0]}' could not be built on the worker"
        elif code:
            reason = errors.decode(errors="replace").partition("\n")[0] or f"forge there ended with {code}"
        elif verdict is not None and "not cached" in verdict.cache:
            reason = f"the worker could not cache its result: {verdict.cache}"
        else:
            reason = f"the worker's result is not in the cache: {self._cache.remark(task.name)}"
        put(_output(task, f"'{task.name}' is built locally: {reason}"))
        return None


def _output(task: Task, text: str, *, stderr: bool = True) -> Output:
    return Output(task.name, f"forge: {text}\n".encode(errors="replace"), stderr=stderr)
