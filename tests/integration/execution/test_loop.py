"""The loop and the runner that starts real programs."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from forge.build.events import (
    Aborted,
    Event,
    Finished,
    Fresh,
    Output,
    Skipped,
    Started,
    StepFinished,
    StepStarted,
)
from forge.build.model import BuildInputs, BuildRecord
from forge.build.tasks import BuildPlan, Step, StepKind, Task
from forge.execution.loop import execute
from forge.execution.runner import ProcessRunner, TaskLifecycle
from forge.execution.scheduler import Scheduler
from tests.packages import package


def task(tmp_path: Path, name: str, *programs: str, needs: Sequence[str] = ()) -> Task:
    """Return a task whose steps are Python programs."""
    steps = tuple(Step(StepKind.INSTALL, (sys.executable, "-c", code), tmp_path) for code in programs)
    return Task(name, package(name), tmp_path, tmp_path / name, tuple(needs), steps, "")


def plan_of(*tasks: Task) -> BuildPlan:
    """Return a plan of the tasks."""
    return BuildPlan({t.name: t for t in tasks})


def real_runner(done: list[str] | None = None) -> ProcessRunner:
    """Return a runner in this process's environment; `done` takes the names of installed tasks."""

    def install(done_task: Task) -> BuildRecord:
        if done is not None:
            done.append(done_task.name)
        return BuildRecord(BuildInputs())

    return ProcessRunner(TaskLifecycle(lambda _: os.environ, lambda _task, _variables: None, install))


def run(
    plan: BuildPlan, runner: ProcessRunner | None = None, *, limit: int = 0, go_on: bool = False
) -> list[Event]:
    """Execute and return all events."""
    scheduler = Scheduler(plan, limit, continue_on_error=go_on)
    return list(execute(plan, runner or real_runner(), scheduler, lambda one: one))


def ends(events: Sequence[Event]) -> dict[str, object]:
    """Return how each task ended: its code, or the word for another end."""
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


def test_steps_run_in_order_and_every_line_arrives_with_its_stream(tmp_path: Path) -> None:
    program = "import sys; print('out'); sys.stdout.flush(); print('err', end='', file=sys.stderr)"
    done: list[str] = []
    events = run(plan_of(task(tmp_path, "a", program, "print('second')")), real_runner(done))
    assert [e for e in events if isinstance(e, Output)] == [
        Output("a", b"out\n", stderr=False),
        Output("a", b"err\n", stderr=True),
        Output("a", b"second\n", stderr=False),
    ]
    assert [type(e) for e in events if not isinstance(e, Output)] == [
        Started,
        StepStarted,
        StepFinished,
        StepStarted,
        StepFinished,
        Finished,
    ]
    assert done == ["a"]


def test_a_failed_step_ends_its_task_and_is_named(tmp_path: Path) -> None:
    done: list[str] = []
    events = run(plan_of(task(tmp_path, "a", "raise SystemExit(3)", "print('never')")), real_runner(done))
    last = events[-1]
    assert isinstance(last, Finished)
    assert last.code == 3
    assert last.step is not None
    assert last.step.argv[-1] == "raise SystemExit(3)"
    assert not done


def test_a_program_that_cannot_start_is_a_failure_with_a_reason(tmp_path: Path) -> None:
    broken = replace(task(tmp_path, "a"), steps=(Step(StepKind.INSTALL, ("/no/such/program",), tmp_path),))
    events = run(plan_of(broken))
    assert (
        Output("a", b"forge: cannot start '/no/such/program': No such file or directory\n", stderr=True)
        in events
    )
    assert ends(events) == {"a": 127}


def test_after_a_failure_running_steps_end_and_nothing_more_starts(tmp_path: Path) -> None:
    plan = plan_of(
        task(tmp_path, "bad", "raise SystemExit(1)"),
        task(tmp_path, "slow", "import time; time.sleep(0.5)", "print('never')"),
        task(tmp_path, "above", "print()", needs=["bad"]),
    )
    events = run(plan, limit=2)
    assert ends(events) == {"bad": 1, "slow": "Aborted", "above": "Skipped"}
    assert not any(isinstance(e, Output) for e in events)


def test_going_on_skips_only_what_needs_the_failed(tmp_path: Path) -> None:
    plan = plan_of(
        task(tmp_path, "bad", "raise SystemExit(1)"),
        task(tmp_path, "good", "print()"),
        task(tmp_path, "above", "print()", needs=["bad"]),
        task(tmp_path, "top", "print()", needs=["above", "bad"]),
    )
    assert ends(run(plan, go_on=True)) == {"bad": 1, "good": 0, "above": "Skipped", "top": "Skipped"}


def test_a_task_that_turns_out_fresh_lets_others_go_on(tmp_path: Path) -> None:
    plan = plan_of(
        task(tmp_path, "a", "raise SystemExit(1)"),
        task(tmp_path, "b", "raise SystemExit(1)", needs=["a"]),
        task(tmp_path, "c", "print()", needs=["a", "b"]),
    )
    scheduler = Scheduler(plan, 1)
    events = list(execute(plan, real_runner(), scheduler, lambda one: one if one.name == "c" else None))
    assert [e.task for e in events if isinstance(e, Fresh)] == ["a", "b"]
    assert ends(events) == {"c": 0}


def test_a_record_is_there_only_after_success(tmp_path: Path) -> None:
    record = tmp_path / "record"
    for code, expected in ((0, True), (1, False)):
        step = Step(
            StepKind.INSTALL,
            (sys.executable, "-c", f"raise SystemExit({code})"),
            tmp_path,
            record=(record, f"digest {code}"),
        )
        run(plan_of(replace(task(tmp_path, "a"), steps=(step,))))
        assert record.is_file() is expected


def test_what_its_record_says_was_done_is_not_done_again(tmp_path: Path) -> None:
    step = Step(
        StepKind.INSTALL,
        (sys.executable, "-c", "raise SystemExit(1)"),
        tmp_path,
        record=(tmp_path / "r", "done"),
    )
    (tmp_path / "r").write_text("done")
    assert ends(run(plan_of(replace(task(tmp_path, "a"), steps=(step,))))) == {"a": 0}
    (tmp_path / "r").write_text("other")
    assert ends(run(plan_of(replace(task(tmp_path, "a"), steps=(step,))))) == {"a": 1}


def test_files_are_written_before_the_first_step(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "file"
    one = replace(task(tmp_path, "a", f"print(open({str(path)!r}).read())"), files=((path, "text"),))
    assert Output("a", b"text\n", stderr=False) in run(plan_of(one))


def test_a_steps_own_variables_win(tmp_path: Path) -> None:
    step = Step(
        StepKind.INSTALL,
        (sys.executable, "-c", "import os; print(os.environ['X'])"),
        tmp_path,
        (("X", "mine"),),
    )
    runner = ProcessRunner(
        TaskLifecycle(
            lambda _: {**os.environ, "X": "theirs"},
            lambda _task, _variables: None,
            lambda _: BuildRecord(BuildInputs()),
        )
    )
    events = run(plan_of(replace(task(tmp_path, "a"), steps=(step,))), runner)
    assert Output("a", b"mine\n", stderr=False) in events
    started = next(e for e in events if isinstance(e, StepStarted))
    assert started.environment == (("X", "mine"),)


def test_an_exception_in_a_worker_is_raised_in_the_loop(tmp_path: Path) -> None:
    def install(_task: Task) -> BuildRecord:
        raise OSError("disk full")

    runner = ProcessRunner(TaskLifecycle(lambda _: os.environ, lambda _task, _variables: None, install))
    with pytest.raises(OSError, match="disk full"):
        run(plan_of(task(tmp_path, "a", "print()"), task(tmp_path, "b", "print()")), runner, limit=1)


def interrupted(plan: BuildPlan, ready: Callable[[], bool], times: int = 1) -> list[Event]:
    """Execute, sending SIGINT to ourselves when `ready`, and return the events until the end."""

    def send() -> None:
        while not ready():
            time.sleep(0.01)
        for _ in range(times):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.2)

    events: list[Event] = []
    thread = threading.Thread(target=send)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        # extend() keeps what came before the interrupt.
        events.extend(execute(plan, real_runner(), Scheduler(plan, 0), lambda one: one))
    thread.join()
    return events


def test_an_interrupt_ends_the_programs_and_their_children(tmp_path: Path) -> None:
    flag = tmp_path / "flag"
    child = f"open({str(flag)!r}, 'w').close(); import time; time.sleep(60)"
    program = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {child!r}])"
    plan = plan_of(task(tmp_path, "a", program), task(tmp_path, "b", "print()", needs=["a"]))
    begun = time.monotonic()
    events = interrupted(plan, flag.exists)
    assert time.monotonic() - begun < 30
    assert ends(events) == {"a": "Aborted" if ends(events)["a"] == "Aborted" else 1, "b": "Skipped"}


def test_a_second_interrupt_kills_what_ignores_the_first(tmp_path: Path) -> None:
    flag = tmp_path / "flag"
    program = (
        "import signal, time; signal.signal(signal.SIGINT, signal.SIG_IGN); "
        f"open({str(flag)!r}, 'w').close(); time.sleep(60)"
    )
    begun = time.monotonic()
    events = interrupted(plan_of(task(tmp_path, "a", program)), flag.exists, times=2)
    assert time.monotonic() - begun < 4
    assert ends(events) == {"a": "Aborted"}


def test_a_daemon_that_a_step_leaves_behind_is_not_waited_for(tmp_path: Path) -> None:
    program = "import subprocess; print(subprocess.Popen(['sleep', '30']).pid, flush=True)"
    begun = time.monotonic()
    events = run(plan_of(task(tmp_path, "a", program)))
    assert time.monotonic() - begun < 10
    (said,) = (event for event in events if isinstance(event, Output))
    os.kill(int(said.lines), signal.SIGKILL)
    assert ends(events) == {"a": 0}


def test_leaving_the_loop_early_ends_the_programs(tmp_path: Path) -> None:
    flag = tmp_path / "flag"
    program = f"open({str(flag)!r}, 'w').close(); import time; time.sleep(60)"
    tasks = task(tmp_path, "a", program), task(tmp_path, "b", program)
    events = execute(plan_of(*tasks), real_runner(), Scheduler(plan_of(*tasks), 2), lambda one: one)
    for event in events:
        if isinstance(event, StepStarted):
            break
    while not flag.exists():
        time.sleep(0.01)
    begun = time.monotonic()
    events.close()
    assert time.monotonic() - begun < 10
    assert threading.active_count() == 1 or not [t for t in threading.enumerate() if t.name in {"a", "b"}]


def test_signal_handlers_are_as_before_afterwards(tmp_path: Path) -> None:
    before = signal.getsignal(signal.SIGINT)
    run(plan_of(task(tmp_path, "a", "print()")))
    assert signal.getsignal(signal.SIGINT) is before
