"""How the steps of a task are run: the protocol, and the runner that starts real programs."""

from __future__ import annotations

import contextlib
import os
import selectors
import shlex
import signal
import subprocess
import threading
import time
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from forge.files import write_if_changed
from forge.jobserver import is_blurb
from forge.model import FAILURE, SUCCESS, TEST_FAILURES, Aborted, Finished, Output, StepFinished, StepStarted
from forge.steps import LAST_COMMAND, environment_file, step_line

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from forge.budget import Budget
    from forge.model import Event, Record, Step, Task

GRACE_SECONDS = 5.0
"""How long an interrupted program may take to end before it is told again, and harder."""

_NOT_STARTED = 127


class Runner(Protocol):
    """Runs one task at a time per calling thread."""

    def run(self, task: Task, put: Callable[[Event], None]) -> None:
        """Run the steps of `task` and put every event, the last a Finished or an Aborted."""

    def finish_steps(self) -> None:
        """Let running steps end and start no further one."""

    def interrupt(self, *, kill: bool) -> None:
        """End all running programs now."""


class ProcessRunner:
    """Starts each step as a process group of its own.

    `environment(task)` is what a task's programs see; `begin(task)` and `install(task)` are called
    before its first step and after its last; the latter says what was made. `undo(task)` is called
    instead when a step failed or the build was stopped.
    """

    def __init__(
        self,
        environment: Callable[[Task], Mapping[str, str]],
        begin: Callable[[Task], None],
        install: Callable[[Task], Record],
        budget: Budget | None = None,
        undo: Callable[[Task], None] = lambda _: None,
    ) -> None:
        """Remember the seams, and where jobs come from if they are counted; nothing runs yet."""
        self._environment = environment
        self._begin = begin
        self._install = install
        self._budget = budget
        self._undo = undo
        self._stopping = threading.Event()
        self._groups: set[int] = set()
        self._lock = threading.Lock()

    def run(self, task: Task, put: Callable[[Event], None]) -> None:
        """Run the steps of `task` in order, until one fails or the build is stopped."""
        with self._budget.package() if self._budget else nullcontext(enter_result=True) as begun:
            if begun:
                self._run(task, put)
            else:
                put(Aborted(task.name, 0.0))

    def _run(self, task: Task, put: Callable[[Event], None]) -> None:
        started = time.monotonic()
        self._begin(task)
        task.build_dir.mkdir(parents=True, exist_ok=True)
        for path, text in task.files:
            write_if_changed(path, text)
        environment = self._environment(task)
        exports = [f"export {name}={shlex.quote(value)}" for name, value in _changed(environment)]
        write_if_changed(environment_file(task), "\n".join(exports) + "\n", mode=0o600)
        failure = self._run_steps(task, environment, put, started)
        if failure is not None:
            self._undo(task)
            put(failure)
            return
        record = self._install(task)
        seconds = time.monotonic() - started
        put(Finished(task.name, 0, seconds, record=replace(record, seconds=seconds)))

    def _run_steps(
        self, task: Task, environment: Mapping[str, str], put: Callable[[Event], None], started: float
    ) -> Event | None:
        """Run the steps until one fails or the build is stopped; return what that comes to."""
        verdict = SUCCESS
        for step in task.steps:
            if step.after not in {"", verdict}:
                continue
            if self._stopping.is_set():
                return Aborted(task.name, time.monotonic() - started)
            code = self._run_step(task, step, environment, put)
            if code and self._stopping.is_set() and code < 0:
                return Aborted(task.name, time.monotonic() - started)
            if code and step.meaning(code) is None:
                return Finished(task.name, code, time.monotonic() - started, step)
            verdict = FAILURE if step.meaning(code) == TEST_FAILURES else SUCCESS
        return None

    def finish_steps(self) -> None:
        """Let running steps end and start no further one."""
        self._stopping.set()
        if self._budget:
            self._budget.stop()

    def interrupt(self, *, kill: bool) -> None:
        """Interrupt every process group; those that do not end are terminated, then killed."""
        self.finish_steps()
        self._signal(signal.SIGKILL if kill else signal.SIGINT)
        if not kill:
            threading.Thread(target=self._insist, daemon=True).start()

    def _insist(self) -> None:
        for harder in (signal.SIGTERM, signal.SIGKILL):
            time.sleep(GRACE_SECONDS)
            self._signal(harder)

    def _signal(self, number: signal.Signals) -> None:
        with self._lock:
            for group in self._groups:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(group, number)

    def _run_step(
        self, task: Task, step: Step, environment: Mapping[str, str], put: Callable[[Event], None]
    ) -> int:
        if step.record:
            step.record[0].unlink(missing_ok=True)
        for path in filter(os.path.islink, step.replaces):
            Path(path).unlink()
        line = step_line(step, environment_file(task))
        write_if_changed(task.build_dir / task.desk / LAST_COMMAND, line + "\n")
        variables = {**environment, **dict(step.env)}
        put(StepStarted(task.name, step, _changed(variables)))
        with self._budget.tools(step, variables) if self._budget else nullcontext((variables, ())) as seen:
            code = self._start(task, step, seen, put)
        if step.record and code == 0:
            write_if_changed(*step.record)
        put(StepFinished(task.name, step, code))
        return code

    def _start(
        self,
        task: Task,
        step: Step,
        seen: tuple[Mapping[str, str], Sequence[int]],
        put: Callable[[Event], None],
    ) -> int:
        variables, descriptors = seen
        try:
            process = subprocess.Popen(
                step.argv,
                cwd=step.cwd,
                env=variables,
                pass_fds=descriptors,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                start_new_session=True,
            )
        except OSError as error:
            message = f"forge: cannot start '{step.argv[0]}': {error.strerror}\n"
            put(Output(task.name, message.encode(), stderr=True))
            return _NOT_STARTED
        with self._lock:
            self._groups.add(process.pid)
        try:
            with process:  # which closes both pipes in the end
                _read_lines(process, lambda line, stderr: put(Output(task.name, line, stderr=stderr)))
            return process.returncode
        finally:
            with self._lock:
                self._groups.discard(process.pid)


def _read_lines(process: subprocess.Popen[bytes], put: Callable[[bytes, bool], None]) -> None:
    """Hand over each line of both pipes as it comes, until both are closed."""
    with selectors.DefaultSelector() as selector:
        for pipe, stderr in ((process.stdout, False), (process.stderr, True)):
            assert pipe is not None  # noqa: S101  (asked for above)
            selector.register(pipe, selectors.EVENT_READ, stderr)
        rests = {False: b"", True: b""}
        while selector.get_map():
            for key, _ in selector.select():
                chunk = os.read(key.fd, 65536)
                if not chunk:
                    selector.unregister(key.fileobj)
                *lines, rests[key.data] = (rests[key.data] + chunk).split(b"\n")
                for line in lines:
                    if not is_blurb(line):
                        put(line + b"\n", key.data)
        for stderr, rest in rests.items():
            if rest:
                put(rest + b"\n", stderr)


def _changed(variables: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    """Return the variables that differ from forge's own environment, which logs need not repeat."""
    return tuple(sorted((name, value) for name, value in variables.items() if os.environ.get(name) != value))
