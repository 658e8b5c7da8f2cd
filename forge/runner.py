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

from forge.files import says, write_if_changed
from forge.frozen import frozen
from forge.jobserver import without_blurbs
from forge.model import (
    CONFIGURE,
    FAILURE,
    SUCCESS,
    TEST_FAILURES,
    Aborted,
    Finished,
    Output,
    StepFinished,
    StepStarted,
)
from forge.steps import LAST_COMMAND, environment_file, step_line

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from contextlib import AbstractContextManager

    from forge.budget import Budget
    from forge.model import Event, Record, Step, Task
    from forge.started import StartedProcesses

GRACE_SECONDS = 3.0
"""How long an interrupted program may take to end before it is told again, and harder."""

_LINGER_SECONDS = 1.0
"""How long forge listens to a pipe that is silent and held open, after the program that it was for ended."""

_LONGEST_LINE = 65536
"""Bytes after which a line is handed over though it has no end."""

_NOT_STARTED = 127


class Runner(Protocol):
    """Runs one task at a time per calling thread."""

    def run(self, task: Task, put: Callable[[Event], None]) -> None:
        """Run the steps of `task` and put every event, the last a Finished or an Aborted."""

    def finish_steps(self) -> None:
        """Let running steps end and start no further one."""

    def interrupt(self, *, kill: bool) -> None:
        """End all running programs now."""


class Steps(Protocol):
    """What runs the steps of a task."""

    def __call__(
        self, task: Task, environment: Mapping[str, str], put: Callable[[Event], None], started: float, /
    ) -> Event | None:
        """Run them until one fails or the build is stopped; return what that comes to, else None."""


@frozen
class Frame:
    """What surrounds the steps of a task, wherever they run.

    `environment(task)` is what a task's programs see; `begin(task, environment)` and `install(task)` are
    called before its first step and after its last; the latter says what was made. `undo(task)` is called
    instead when a step failed or the build was stopped. `restore(task)` is asked first of all: where it
    returns a record, no step runs. `remark(task)` is what the package cache had to do with it, at its end.
    """

    environment: Callable[[Task], Mapping[str, str]]
    begin: Callable[[Task, Mapping[str, str]], None]
    install: Callable[[Task], Record]
    undo: Callable[[Task], None] = lambda _: None
    restore: Callable[[Task], Record | None] = lambda _: None
    remark: Callable[[Task], str] = lambda _: ""

    def open(self, task: Task) -> Mapping[str, str]:
        """Make everything ready for the first step; return what the programs see."""
        environment = self.environment(task)
        self.begin(task, environment)
        task.build_dir.mkdir(parents=True, exist_ok=True)
        for path, text in task.files:
            write_if_changed(path, text)
        exports = [f"export {name}={shlex.quote(value)}" for name, value in changed(environment)]
        write_if_changed(environment_file(task), "\n".join(exports) + "\n", mode=0o600)
        return environment

    def carry_out(self, task: Task, put: Callable[[Event], None], steps: Steps) -> None:
        """Run the steps of `task` by `steps`, with all that surrounds them; put every event."""
        try:
            put(self._carried_out(task, put, steps))
        except BaseException:
            # A full disk, say: what was installed half-way must not look whole. The first cause is told.
            with contextlib.suppress(OSError):
                self.undo(task)
            raise

    def _carried_out(self, task: Task, put: Callable[[Event], None], steps: Steps) -> Event:
        started = time.monotonic()
        record = self.restore(task)
        if record is not None:
            return Finished(task.name, 0, time.monotonic() - started, record=record, cache=self.remark(task))
        environment = self.open(task)
        failure = steps(task, environment, put, started)
        if failure is not None:
            self.undo(task)
            return failure
        record = self.install(task)
        seconds = time.monotonic() - started
        record = replace(record, seconds=seconds)
        return Finished(task.name, 0, seconds, record=record, cache=self.remark(task))


class Launch(Protocol):
    """How the program of a step is started, and what is done when it has ended."""

    def __call__(self, task: Task, step: Step, /) -> AbstractContextManager[Sequence[str]]:
        """Return a context that gives the words to run, and ends after the program."""


def as_it_is(_: Task, step: Step) -> AbstractContextManager[Sequence[str]]:
    """Start the program of a step as the step has it."""
    return nullcontext(step.argv)


class ProcessRunner:
    """Starts each step as a process group of its own."""

    def __init__(
        self,
        frame: Frame,
        budget: Budget | None = None,
        started: StartedProcesses | None = None,
        launch: Launch = as_it_is,
    ) -> None:
        """Remember what surrounds steps, where counted jobs come from, and where processes are noted."""
        self._frame = frame
        self._budget = budget
        self._started = started
        self._launch = launch
        self._stopping = threading.Event()
        self._groups: set[int] = set()
        self._lock = threading.Lock()
        self._said_last: signal.Signals | None = None

    def run(self, task: Task, put: Callable[[Event], None]) -> None:
        """Run the steps of `task` in order, until one fails or the build is stopped."""
        with self._budget.package() if self._budget else nullcontext(enter_result=True) as begun:
            if begun:
                self._frame.carry_out(task, put, self.run_steps)
            else:
                put(Aborted(task.name, 0.0))

    def run_steps(
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
        if self._started and self._said_last is None:
            self._started.note_descendants()
        self._signal(signal.SIGKILL if kill else signal.SIGINT)
        if not kill:
            threading.Thread(target=self._insist, daemon=True).start()

    def _insist(self) -> None:
        for harder in (signal.SIGTERM, signal.SIGKILL):
            time.sleep(GRACE_SECONDS)
            self._signal(harder)

    def _signal(self, number: signal.Signals) -> None:
        with self._lock:
            self._said_last = number
            for group in self._groups:
                _tell(group, number)

    def _know(self, group: int) -> None:
        """Take note of a process group; one that began in the moment of an interrupt hears of it now."""
        if self._started:
            self._started.note(group)
        with self._lock:
            self._groups.add(group)
            if self._said_last is not None:
                _tell(group, self._said_last)

    def _run_step(
        self, task: Task, step: Step, environment: Mapping[str, str], put: Callable[[Event], None]
    ) -> int:
        if step.record:
            if says(*step.record):
                return 0
            step.record[0].unlink(missing_ok=True)
        for path in filter(os.path.islink, step.replaces):
            Path(path).unlink()
        line = step_line(step, environment_file(task))
        write_if_changed(task.build_dir / task.desk / LAST_COMMAND, line + "\n")
        variables = {**environment, **dict(step.env)}
        put(StepStarted(task.name, step, changed(variables)))
        tools = self._budget.tools(step, variables) if self._budget else nullcontext((variables, ()))
        with tools as seen, self._launch(task, step) as argv:
            code = self._start(task, replace(step, argv=tuple(argv)), seen, put)
        if step.record and code == 0:
            if step.label == CONFIGURE:
                from forge.build.build_dir import bring_back_products  # noqa: PLC0415  (few steps configure)

                bring_back_products(step.cwd)
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
            missing = "its folder is gone" if not step.cwd.is_dir() else error.strerror
            message = f"forge: cannot start '{step.argv[0]}': {missing}\n"
            put(Output(task.name, message.encode(), stderr=True))
            return _NOT_STARTED
        self._know(process.pid)
        try:
            with process:  # which closes both pipes in the end
                _read_lines(process, lambda lines, stderr: put(Output(task.name, lines, stderr=stderr)))
            return process.returncode
        finally:
            with self._lock:
                self._groups.discard(process.pid)


def _tell(group: int, number: signal.Signals) -> None:
    # A program of another user, such as sudo, may not be told.
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(group, number)


def _read_lines(process: subprocess.Popen[bytes], put: Callable[[bytes, bool], None]) -> None:
    """Hand over the lines of both pipes as they come, until both are closed.

    A program may leave another one behind that holds them open, as a daemon does: nobody waits for that.
    """
    with selectors.DefaultSelector() as selector, _end_of(process) as end:
        for pipe, stderr in ((process.stdout, False), (process.stderr, True)):
            assert pipe is not None  # noqa: S101  (asked for above)
            selector.register(pipe, selectors.EVENT_READ, stderr)
        if end is not None:
            selector.register(end, selectors.EVENT_READ)
        rests = {False: b"", True: b""}
        patience = None
        while any(key.data is not None for key in selector.get_map().values()):
            ready = selector.select(patience)
            if not ready:
                break
            for key, _ in ready:
                if key.data is None:
                    selector.unregister(key.fileobj)
                    patience = _LINGER_SECONDS
                    continue
                chunk = os.read(key.fd, _LONGEST_LINE)
                if not chunk:
                    selector.unregister(key.fileobj)
                rests[key.data] = _hand_over(rests[key.data] + chunk, key.data, put)
        for stderr, rest in rests.items():
            if rest:
                put(rest + b"\n", stderr)


def _hand_over(said: bytes, stderr: bool, put: Callable[[bytes, bool], None]) -> bytes:  # noqa: FBT001  (as `put` has it)
    """Put the whole lines, and return what may go on."""
    lines, end, rest = said.rpartition(b"\n")
    lines = without_blurbs(lines + end)
    if lines:
        put(lines, stderr)
    if len(rest) >= _LONGEST_LINE:
        put(rest, stderr)
        return b""
    return rest


@contextlib.contextmanager
def _end_of(process: subprocess.Popen[bytes]) -> Iterator[int | None]:
    """Yield a descriptor that becomes readable when the process ends, or None where there is none."""
    try:
        descriptor = os.pidfd_open(process.pid)
    except (AttributeError, OSError):
        yield None
        return
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def changed(variables: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    """Return the variables that differ from forge's own environment, which logs need not repeat."""
    return tuple(sorted((name, value) for name, value in variables.items() if os.environ.get(name) != value))
