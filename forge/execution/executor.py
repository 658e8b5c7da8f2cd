"""The executors of package steps: this machine, or a plugin."""

from __future__ import annotations

import contextlib
import os
from functools import partial
from typing import TYPE_CHECKING, Protocol

from forge.base.env_vars import EXECUTORS, default_executor
from forge.base.errors import Problem, SelectionError
from forge.base.extensions import EXECUTORS as PLUGINS
from forge.base.extensions import OWN, call, entry_points, find, installed
from forge.base.frozen import frozen
from forge.base.options import option

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping
    from contextlib import AbstractContextManager
    from pathlib import Path

    from forge.build.events import Aborted, Event, Finished
    from forge.build.tasks import Task
    from forge.execution.options import JobOptions


class Executor(Protocol):
    """Runs the steps of tasks. forge decides which task is next, and installs the results of the steps."""

    slots: int
    """The number of packages that are built concurrently."""

    def run(
        self,
        task: Task,
        environment: Mapping[str, str],
        put: Callable[[Event], None],
        restart: Callable[[], Mapping[str, str]],
        /,
    ) -> Finished | Aborted | None:
        """Run the steps of `task` in order; put StepStarted, Output and StepFinished events.

        Return None if all steps succeeded, Finished if one failed, Aborted if the build is being stopped.
        Each call runs in a separate thread. To repeat the task from its first step, call `restart` after all
        programs of the earlier attempt have ended: it removes their files and returns the new environment.
        """

    def finish_steps(self) -> None:
        """Let running steps finish and start no further step."""

    def interrupt(self, *, kill: bool) -> None:
        """Terminate all running programs; with `kill`, immediately. Does not wait."""


@frozen
class ExecutorContext:
    """Information about a build for the executor of a plugin."""

    options: ExecutorOptions
    jobs: JobOptions
    """The limits for jobs, memory and load; `parallel_workers` is applied by forge."""
    build: Path
    """The build folder."""
    programs: Mapping[str, str]
    """The paths of the programs that all packages use, such as 'cmake' and 'ninja'."""
    warn: Callable[[Iterable[Problem]], object]


class ExecutorPlugin(Protocol):
    """A module with an executor: an entry point of the group 'forge.executors'."""

    def check(self, options: ExecutorOptions, /) -> None:
        """Raise SelectionError for invalid options, before anything is built."""

    def connect(self, context: ExecutorContext, /) -> AbstractContextManager[Executor]:
        """Yield the executor for one build, and release it afterwards."""


def _resource(text: str) -> tuple[str, float]:
    name, equals, number = text.partition("=")
    with contextlib.suppress(ValueError):
        if name and equals:
            return name, float(number)
    raise ValueError(f"'{text}' is not of the form NAME=NUMBER, such as memory=4e9")


class _Names(tuple[str, ...]):
    """The installed executors of forge. Others are searched only for an unknown name."""

    __slots__ = ()

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or name in OWN[PLUGINS] or name in entry_points(PLUGINS)


_NAMES = _Names((*EXECUTORS, *installed(PLUGINS)))


@frozen
class ExecutorOptions:
    """The options that select where packages are built: on this machine or by a plugin."""

    GROUP = "parallelism"

    executor: str = option(
        "how to build packages: in parallel, one at a time in topological order (sequential), or on a "
        "Dask cluster (dask, requires --scheduler) (default: parallel)",
        default_factory=lambda: default_executor(_NAMES),
        choices=_NAMES,
    )
    scheduler: str | None = option(
        "address of the Dask scheduler, such as tcp://HOST:8786; --jobs then applies per worker, "
        "--parallel-workers to all workers together (default: one package per worker thread)",
        default_factory=lambda: os.environ.get("FORGE_SCHEDULER"),
        metavar="ADDRESS",
    )
    worker_resources: tuple[tuple[str, float], ...] = option(
        "resources of Dask workers that each package requires, such as memory=4e9",
        default=(),
        parse=_resource,
        metavar="NAME=N",
    )

    @property
    def is_local(self) -> bool:
        """Whether packages are built on this machine."""
        return self.executor in EXECUTORS

    def check(self) -> None:
        """Raise ForgeError if the executor cannot be used with these options."""
        if not self.is_local:
            call(self._what, self._plugin.check, self)

    @contextlib.contextmanager
    def connected(self, context: ExecutorContext) -> Iterator[Executor | None]:
        """Yield the executor of a plugin, None if packages are built on this machine."""
        if self.is_local:
            yield None
            return
        with contextlib.ExitStack() as stack:
            connection = self._plugin.connect(context)
            yield _Guarded(self._what, call(self._what, stack.enter_context, connection))

    @property
    def _what(self) -> str:
        return f"the executor '{self.executor}'"

    @property
    def _plugin(self) -> ExecutorPlugin:
        plugin: ExecutorPlugin | None = find(PLUGINS, self.executor, "executor", ("check", "connect"))
        if plugin is None:
            raise SelectionError(
                Problem(f"unknown executor '{self.executor}'", hint="see `forge extensions`")
            )
        return plugin


class _Guarded:
    """An executor whose exceptions become ForgeErrors."""

    def __init__(self, what: str, executor: Executor) -> None:
        self.slots = executor.slots
        self.run = partial(call, what, executor.run)
        self.finish_steps = executor.finish_steps
        self.interrupt = executor.interrupt
