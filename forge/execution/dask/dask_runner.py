"""The runner for packages built on a cluster: steps run there, the rest of the lifecycle here."""

from __future__ import annotations

import contextlib
import time
from dataclasses import replace
from typing import TYPE_CHECKING

from forge.base.errors import HostError, Problem
from forge.base.files import remove_folder
from forge.base.layout import SCRATCH_DIR
from forge.build.events import Aborted, Finished, StepStarted
from forge.execution.dask.messages import RemoteTask
from forge.execution.dask.step_runner import try_lock
from forge.execution.runner import changed_variables

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from forge.build.events import Event
    from forge.build.tasks import Task
    from forge.execution.dask.connection import Connection
    from forge.execution.runner import TaskLifecycle

_RELEASE_SECONDS = 15.0
"""The time for the programs of a lost worker to end."""


class DaskRunner:
    """Runs the steps of tasks on workers."""

    def __init__(self, connection: Connection, lifecycle: TaskLifecycle) -> None:
        """Store the connection to the workers and the lifecycle of tasks."""
        self._connection = connection
        self._lifecycle = lifecycle
        self._folder = connection.cluster.folder

    def run(self, task: Task, put: Callable[[Event], None]) -> None:
        """Run the steps of `task` on a worker and put every event; the last is Finished or Aborted."""
        self._lifecycle.run_build(task, put, self._steps)

    def finish_steps(self) -> None:
        """Let running steps finish and start no further step."""
        self._connection.finish_steps()

    def interrupt(self, *, kill: bool) -> None:
        """Terminate all running programs; with `kill`, immediately."""
        self._connection.interrupt(kill=kill)

    def _steps(
        self, task: Task, environment: Mapping[str, str], put: Callable[[Event], None], started: float
    ) -> Event | None:
        lock = self._folder / f"{task.name}.lock"
        step_environment = dict(environment)

        def remote_task(attempts: int) -> RemoteTask:
            if attempts:
                step_environment.update(self._restart(task, lock))
            return RemoteTask(task, step_environment, self._connection.limits, lock)

        for event in self._connection.events(task.name, remote_task):
            match event:
                case StepStarted(_, step):
                    put(
                        StepStarted(
                            task.name, step, changed_variables({**step_environment, **dict(step.env)})
                        )
                    )
                case Finished(code=0):
                    return None
                case Finished() | Aborted():
                    return replace(event, seconds=time.monotonic() - started)
                case _:
                    put(event)
        return None

    def _restart(self, task: Task, lock: Path) -> Mapping[str, str]:
        """Remove partial results of a lost worker; return the environment of the steps."""
        _await_release(lock)
        self._lifecycle.undo(task)
        with contextlib.suppress(OSError):
            remove_folder(str(task.build_dir), last=SCRATCH_DIR)
        return self._lifecycle.open(task)


def _await_release(lock: Path) -> None:
    """Wait until no program of an earlier attempt runs; raise HostError if this takes too long."""
    until = time.monotonic() + _RELEASE_SECONDS
    with lock.open("a") as stream:
        while not try_lock(stream.fileno()):
            if time.monotonic() > until:
                hint = "end the processes that still run on the lost worker, then build again"
                raise HostError(Problem(f"'{lock}' is still locked by a lost worker", hint=hint))
            time.sleep(0.05)
