"""The loop and the runner that starts real programs."""

import os
import signal
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from forge.build.events import (
    Aborted,
    Event,
    Finished,
    Output,
    Skipped,
    StepStarted,
)
from forge.build.model import BuildRecord
from forge.build.tasks import BuildPlan, Step, StepKind, Task
from forge.execution.job_pool import JobPool
from forge.execution.loop import Scheduler, execute
from forge.execution.runner import LocalExecutor, TaskLifecycle, TaskRunner
from forge.execution.started import StartedProcesses
from tests.packages import package


def task(tmp_path: Path, name: str, *programs: str, needs: Sequence[str] = ()) -> Task:
    """Return a task whose steps are Python programs."""
    steps = tuple(Step(StepKind.INSTALL, (sys.executable, "-c", code), tmp_path) for code in programs)
    return Task(name, package(name), tmp_path, tmp_path / name, tuple(needs), steps, "")


def plan_of(*tasks: Task) -> BuildPlan:
    return BuildPlan({t.name: t for t in tasks})


class Lifecycle(TaskLifecycle):
    """Runs steps in the environment of this process."""

    def environment(self, _task: Task) -> Mapping[str, str]:
        return os.environ


def real_runner(folder: Path, lifecycle: TaskLifecycle | None = None) -> TaskRunner:
    """Return a runner that starts programs."""
    return TaskRunner(lifecycle or Lifecycle(), LocalExecutor(JobPool(1), StartedProcesses(folder)))


def run(plan: BuildPlan, runner: TaskRunner, *, limit: int = 0) -> list[Event]:
    """Execute and return all events."""
    return list(execute(plan, runner, Scheduler(plan, limit), lambda one: one))


def ends(events: Sequence[Event]) -> dict[str, object]:
    """Return how each task ended: its exit code, or the name of another event."""
    found: dict[str, object] = {}
    for event in events:
        match event:
            case Finished(name, code):
                found[name] = code
            case Aborted(name) | Skipped(name):
                found[name] = type(event).__name__
            case _:
                pass
    return found


def test_a_program_that_cannot_start_fails_with_a_reason(tmp_path: Path) -> None:
    broken = replace(task(tmp_path, "a"), steps=(Step(StepKind.INSTALL, ("/no/such/program",), tmp_path),))
    events = run(plan_of(broken), real_runner(tmp_path))
    assert (
        Output("a", b"forge: cannot start '/no/such/program': No such file or directory\n", stderr=True)
        in events
    )
    assert ends(events) == {"a": 127}


def test_an_exception_in_a_worker_is_raised_in_the_loop(tmp_path: Path) -> None:
    class Full(Lifecycle):
        def install(self, _task: Task) -> BuildRecord:
            raise OSError("disk full")

    runner = real_runner(tmp_path, Full())
    with pytest.raises(OSError, match="disk full"):
        run(plan_of(task(tmp_path, "a", "print()"), task(tmp_path, "b", "print()")), runner, limit=1)


def test_the_loop_does_not_wait_for_daemons_of_steps(tmp_path: Path) -> None:
    program = "import subprocess; print(subprocess.Popen(['sleep', '30']).pid, flush=True)"
    begun = time.monotonic()
    events = run(plan_of(task(tmp_path, "a", program)), real_runner(tmp_path))
    assert time.monotonic() - begun < 10
    (said,) = (event for event in events if isinstance(event, Output))
    os.kill(int(said.lines), signal.SIGKILL)
    assert ends(events) == {"a": 0}


def test_the_loop_does_not_wait_for_daemons_that_write(tmp_path: Path) -> None:
    """They end when they write into the closed pipe."""
    program = "import subprocess; subprocess.Popen('while echo x; do sleep 0.1; done', shell=True)"
    begun = time.monotonic()
    events = run(plan_of(task(tmp_path, "a", program)), real_runner(tmp_path))
    assert time.monotonic() - begun < 20
    assert ends(events) == {"a": 0}


def test_leaving_the_loop_early_ends_the_programs(tmp_path: Path) -> None:
    flag = tmp_path / "flag"
    program = f"open({str(flag)!r}, 'w').close(); import time; time.sleep(60)"
    tasks = task(tmp_path, "a", program), task(tmp_path, "b", program)
    events = execute(plan_of(*tasks), real_runner(tmp_path), Scheduler(plan_of(*tasks), 2), lambda one: one)
    for event in events:
        if isinstance(event, StepStarted):
            break
    while not flag.exists():
        time.sleep(0.01)
    begun = time.monotonic()
    events.close()
    assert time.monotonic() - begun < 10
    assert threading.active_count() == 1 or not [t for t in threading.enumerate() if t.name in {"a", "b"}]
