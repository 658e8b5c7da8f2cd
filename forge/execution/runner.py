"""Run the steps of a task: the Runner protocol, and the runner that starts processes."""

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

from forge.base.files import has_text, write_if_changed
from forge.base.frozen import frozen
from forge.base.layout import LAST_COMMAND
from forge.build.events import Aborted, Finished, Output, StepFinished, StepStarted
from forge.build.tasks import TEST_FAILURES, StepCondition, StepKind, environment_file, step_line
from forge.execution.jobserver import without_jobserver_notices
from forge.execution.worker_client import ROSIDL_WORKER_VARIABLE, WORKER_VARIABLE
from forge.toolchain.gcc_heap import CXX_LAUNCHER, HEAP_VARIABLE
from forge.toolchain.precompiled_headers import HEADERS_VARIABLE, LIBRARY_PATH_BELOW

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from contextlib import AbstractContextManager

    from forge.build.events import Event
    from forge.build.model import BuildRecord
    from forge.build.tasks import Step, Task
    from forge.execution.job_pool import JobPool
    from forge.execution.observer import Observer
    from forge.execution.started import StartedProcesses

GRACE_SECONDS = 3.0
"""The time for an interrupted program to end before it receives the next stronger signal."""

_LINGER_SECONDS = 1.0
"""How long forge reads from a silent pipe that another process holds open after the step's program ended."""

_LONGEST_LINE = 65536
"""Bytes after which an unfinished line is emitted."""

_NOT_STARTED = 127


class Runner(Protocol):
    """Runs one task at a time per calling thread."""

    def run(self, task: Task, put: Callable[[Event], None]) -> None:
        """Run the steps of `task` and put every event; the last is Finished or Aborted."""

    def finish_steps(self) -> None:
        """Let running steps finish and start no further step."""

    def interrupt(self, *, kill: bool) -> None:
        """Terminate all running programs; with `kill`, immediately."""


class RunSteps(Protocol):
    """A function that runs the steps of a task."""

    def __call__(
        self, task: Task, environment: Mapping[str, str], put: Callable[[Event], None], started: float, /
    ) -> Event | None:
        """Run them until one fails or the build is stopped; return Finished or Aborted in these cases."""


_OF_THIS_BUILD = frozenset(
    {
        *(WORKER_VARIABLE, ROSIDL_WORKER_VARIABLE),
        *(HEADERS_VARIABLE, LIBRARY_PATH_BELOW, CXX_LAUNCHER, HEAP_VARIABLE),
    }
)
"""Variables for processes and files that this build has started or checked; others do without."""


@frozen
class TaskLifecycle:
    """The callbacks before and after the steps of a task, locally or on a cluster.

    `restore(task)` is called first: if it returns a record, no step runs. `environment(task)` returns the
    environment of the steps. `begin(task, environment)` is called before the first step and `install(task)`
    after the last; it returns the record. `undo(task)` is called instead if a step failed or the build was
    stopped. `remark(task)` returns the package cache's remark at the end. `check(task)` raises ForgeError if
    forge made a step fail.
    """

    environment: Callable[[Task], Mapping[str, str]]
    begin: Callable[[Task, Mapping[str, str]], None]
    install: Callable[[Task], BuildRecord]
    undo: Callable[[Task], None] = lambda _: None
    restore: Callable[[Task], BuildRecord | None] = lambda _: None
    remark: Callable[[Task], str] = lambda _: ""
    check: Callable[[Task], None] = lambda _: None

    def open(self, task: Task) -> Mapping[str, str]:
        """Prepare the first step; return the environment of the steps."""
        environment = self.environment(task)
        self.begin(task, environment)
        task.build_dir.mkdir(parents=True, exist_ok=True)
        for path, text in task.files:
            write_if_changed(path, text)
        exports = [f"export {name}={shlex.quote(value)}" for name, value in changed_variables(environment)]
        write_if_changed(environment_file(task), "\n".join(exports) + "\n", mode=0o600)
        return environment

    def run_build(self, task: Task, put: Callable[[Event], None], steps: RunSteps) -> None:
        """Run `task` with its lifecycle callbacks; `steps` runs its steps. Put every event."""
        try:
            put(self._run_task(task, put, steps))
        except BaseException:
            # For example a full disk: partially installed files must not look complete. Keep the first error.
            with contextlib.suppress(OSError):
                self.undo(task)
            raise

    def _run_task(self, task: Task, put: Callable[[Event], None], steps: RunSteps) -> Event:
        started = time.monotonic()
        record = self.restore(task)
        if record is not None:
            return Finished(task.name, 0, time.monotonic() - started, record=record, cache=self.remark(task))
        environment = self.open(task)
        failure = steps(task, environment, put, started)
        if failure is not None:
            self.check(task)
            self.undo(task)
            return failure
        record = self.install(task)
        seconds = time.monotonic() - started
        record = replace(record, seconds=seconds)
        return Finished(task.name, 0, seconds, record=record, cache=self.remark(task))


class Launch(Protocol):
    """Wraps the program of a step, for example to trace it."""

    def __call__(self, task: Task, step: Step, /) -> AbstractContextManager[Sequence[str]]:
        """Return a context manager that yields the argv to run and exits after the program ended."""


def unwrapped(_: Task, step: Step) -> AbstractContextManager[Sequence[str]]:
    """Run the argv of the step itself."""
    return nullcontext(step.argv)


class ProcessRunner:
    """Runs each step as a process group of its own."""

    def __init__(
        self,
        lifecycle: TaskLifecycle,
        job_pool: JobPool | None = None,
        started: StartedProcesses | None = None,
        launch: Launch = unwrapped,
        observer: Observer | None = None,
    ) -> None:
        """Store the lifecycle of tasks, the job pool, the record of started processes, and the observer."""
        self._lifecycle = lifecycle
        self._job_pool = job_pool
        self._started = started
        self._launch = launch
        self._observer = observer
        self._stopping = threading.Event()
        self._groups: set[int] = set()
        self._lock = threading.Lock()
        self._last_signal: signal.Signals | None = None

    def run(self, task: Task, put: Callable[[Event], None]) -> None:
        """Run the steps of `task` in order, until one fails or the build is stopped."""
        with self._job_pool.package() if self._job_pool else nullcontext(enter_result=True) as begun:
            if begun:
                self._lifecycle.run_build(task, put, self.run_steps)
            else:
                put(Aborted(task.name, 0.0))

    def run_steps(
        self, task: Task, environment: Mapping[str, str], put: Callable[[Event], None], started: float
    ) -> Event | None:
        """Run the steps until one fails or the build is stopped, which returns Finished or Aborted."""
        tests = StepCondition.TESTS_PASSED
        for step in task.steps:
            if step.condition not in {StepCondition.ALWAYS, tests}:
                continue
            if self._stopping.is_set():
                return Aborted(task.name, time.monotonic() - started)
            code = self._run_step(task, step, environment, put)
            if code and self._stopping.is_set() and code < 0:
                return Aborted(task.name, time.monotonic() - started)
            if code and step.meaning(code) is None:
                return Finished(task.name, code, time.monotonic() - started, step)
            failed = step.meaning(code) == TEST_FAILURES
            tests = StepCondition.TESTS_FAILED if failed else StepCondition.TESTS_PASSED
        return None

    def finish_steps(self) -> None:
        """Let running steps finish and start no further step."""
        self._stopping.set()
        if self._job_pool:
            self._job_pool.stop()

    def interrupt(self, *, kill: bool) -> None:
        """Interrupt every process group; those that do not end are terminated, then killed."""
        self.finish_steps()
        if self._started and self._last_signal is None:
            self._started.note_descendants()
        self._signal(signal.SIGKILL if kill else signal.SIGINT)
        if not kill:
            threading.Thread(target=self._escalate, daemon=True).start()

    def _escalate(self) -> None:
        for signal_number in (signal.SIGTERM, signal.SIGKILL):
            time.sleep(GRACE_SECONDS)
            self._signal(signal_number)

    def _signal(self, number: signal.Signals) -> None:
        with self._lock:
            self._last_signal = number
            for group in self._groups:
                _signal_group(group, number)

    def _register_group(self, group: int) -> None:
        """Register a process group; signal it if it started during an interrupt."""
        if self._started:
            self._started.note(group)
        with self._lock:
            self._groups.add(group)
            if self._last_signal is not None:
                _signal_group(group, self._last_signal)

    def _run_step(
        self, task: Task, step: Step, environment: Mapping[str, str], put: Callable[[Event], None]
    ) -> int:
        if step.record:
            if has_text(*step.record):
                return 0
            step.record[0].unlink(missing_ok=True)
        for path in filter(os.path.islink, step.replaces):
            Path(path).unlink()
        line = step_line(step, environment_file(task))
        write_if_changed(task.build_dir / task.scratch_dir / LAST_COMMAND, line + "\n")
        variables = {**environment, **dict(step.env)}
        put(StepStarted(task.name, step, changed_variables(variables)))
        tools = self._job_pool.tools(step, variables) if self._job_pool else nullcontext((variables, ()))
        with tools as tool_context, self._launch(task, step) as argv:
            code = self._start(task, replace(step, argv=tuple(argv)), tool_context, put)
        if step.record and code == 0:
            if step.kind is StepKind.CONFIGURE:
                from forge.build.build_dir import restore_outputs

                restore_outputs(step.cwd)
            write_if_changed(*step.record)
        put(StepFinished(task.name, step, code))
        return code

    def _start(
        self,
        task: Task,
        step: Step,
        tool_context: tuple[Mapping[str, str], Sequence[int]],
        put: Callable[[Event], None],
    ) -> int:
        variables, descriptors = tool_context
        if self._observer:
            variables = self._observer.variables(task, variables)
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
            missing = "its working directory no longer exists" if not step.cwd.is_dir() else error.strerror
            message = f"forge: cannot start '{step.argv[0]}': {missing}\n"
            put(Output(task.name, message.encode(), stderr=True))
            return _NOT_STARTED
        self._register_group(process.pid)
        if self._observer:
            self._observer.note_process(variables, process.pid)
        try:
            with process:  # which closes both pipes in the end
                _read_lines(process, lambda lines, stderr: put(Output(task.name, lines, stderr=stderr)))
            return process.returncode
        finally:
            with self._lock:
                self._groups.discard(process.pid)


def _signal_group(group: int, number: signal.Signals) -> None:
    # forge may not signal a program of another user, such as sudo.
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(group, number)


def _read_lines(process: subprocess.Popen[bytes], put: Callable[[bytes, bool], None]) -> None:
    """Put the lines of both pipes as they arrive, until both are closed.

    A daemon started by the program may hold the pipes open; it is not waited for.
    """
    with selectors.DefaultSelector() as selector, _exit_descriptor(process) as end:
        for pipe, stderr in ((process.stdout, False), (process.stderr, True)):
            assert pipe is not None
            selector.register(pipe, selectors.EVENT_READ, stderr)
        if end is not None:
            selector.register(end, selectors.EVENT_READ)
        partial_lines = {False: b"", True: b""}
        timeout = None
        while any(key.data is not None for key in selector.get_map().values()):
            ready = selector.select(timeout)
            if not ready:
                break
            for key, _ in ready:
                if key.data is None:
                    selector.unregister(key.fileobj)
                    timeout = _LINGER_SECONDS
                    continue
                chunk = os.read(key.fd, _LONGEST_LINE)
                if not chunk:
                    selector.unregister(key.fileobj)
                partial_lines[key.data] = _emit_lines(partial_lines[key.data] + chunk, key.data, put)
        for stderr, partial_line in partial_lines.items():
            if partial_line:
                put(partial_line + b"\n", stderr)


def _emit_lines(data: bytes, stderr: bool, put: Callable[[bytes, bool], None]) -> bytes:
    """Put the complete lines; return the incomplete last one."""
    lines, end, partial_line = data.rpartition(b"\n")
    lines = without_jobserver_notices(lines + end)
    if lines:
        put(lines, stderr)
    if len(partial_line) >= _LONGEST_LINE:
        put(partial_line, stderr)
        return b""
    return partial_line


@contextlib.contextmanager
def _exit_descriptor(process: subprocess.Popen[bytes]) -> Iterator[int | None]:
    """Yield a descriptor that becomes readable when the process ends, or None if unsupported."""
    try:
        descriptor = os.pidfd_open(process.pid)
    except (AttributeError, OSError):
        yield None
        return
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def changed_variables(variables: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    """Return the variables that differ from forge's own environment and that are valid after this build."""
    return tuple(
        sorted(
            (name, value)
            for name, value in variables.items()
            if os.environ.get(name) != value and name not in _OF_THIS_BUILD
        )
    )
