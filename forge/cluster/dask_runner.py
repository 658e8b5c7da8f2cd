"""The runner for workers that see our folders: the steps run there, what surrounds them is done here."""

from __future__ import annotations

import shutil
import time
from dataclasses import replace
from typing import TYPE_CHECKING

from forge.cluster.attendant import taken
from forge.cluster.connection import FOLDER
from forge.cluster.model import Errand
from forge.errors import EnvironmentFault, Problem
from forge.model import Aborted, Finished, StepStarted
from forge.runner import changed

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from forge.cluster.line import Line
    from forge.cluster.model import Knock
    from forge.layout import Layout
    from forge.model import Event, Task
    from forge.runner import Frame

_RELEASE_SECONDS = 15.0
"""How long the programs of a worker that was lost may take to end."""


class DaskRunner:
    """Has steps run by workers on a shared filesystem."""

    def __init__(self, line: Line, frame: Frame, layout: Layout) -> None:
        """Remember the line to the workers, and what surrounds the steps."""
        self._line = line
        self._frame = frame
        self._folder = layout.build / FOLDER

    def run(self, task: Task, put: Callable[[Event], None]) -> None:
        """Run the steps of `task` on a worker and put every event, the last a Finished or an Aborted."""
        self._frame.carry_out(task, put, self._steps)

    def finish_steps(self) -> None:
        """Let running steps end and start no further one."""
        self._line.finish_steps()

    def interrupt(self, *, kill: bool) -> None:
        """End all running programs now."""
        self._line.interrupt(kill=kill)

    def _steps(
        self, task: Task, environment: Mapping[str, str], put: Callable[[Event], None], started: float
    ) -> Event | None:
        lock = self._folder / f"{task.name}.lock"
        seen = dict(environment)

        def errand(attempts: int, _knock: Knock) -> Errand:
            if attempts:
                seen.update(self._begin_again(task, lock))
            return Errand(task, seen, self._line.terms, lock)

        for event in self._line.events(task.name, errand):
            match event:
                case StepStarted(_, step):
                    put(StepStarted(task.name, step, changed({**seen, **dict(step.env)})))
                case Finished(code=0):
                    return None
                case Finished() | Aborted():
                    return replace(event, seconds=time.monotonic() - started)
                case _:
                    put(event)
        return None

    def _begin_again(self, task: Task, lock: Path) -> Mapping[str, str]:
        """Remove what a lost worker left half-made; return what the programs see."""
        _await_release(lock)
        self._frame.undo(task)
        shutil.rmtree(task.build_dir, ignore_errors=True)
        return self._frame.open(task)


def _await_release(lock: Path) -> None:
    """Wait until nothing of an earlier attempt runs; raise EnvironmentFault when it goes on and on."""
    until = time.monotonic() + _RELEASE_SECONDS
    with lock.open("a") as stream:
        while not taken(stream.fileno()):
            if time.monotonic() > until:
                hint = "end what still runs on the worker that was lost, then build again"
                raise EnvironmentFault(Problem(f"a lost worker still holds '{lock}'", hint=hint))
            time.sleep(0.05)
