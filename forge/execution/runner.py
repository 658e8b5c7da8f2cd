"""Run tasks: the actions before and after their steps, and the executor that starts processes."""

from __future__ import annotations

import contextlib
import os
import selectors
import shlex
import signal
import subprocess
import threading
import time
from collections import Counter, deque
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from forge.base.files import has_text, remove_folder, write_if_changed
from forge.base.layout import LAST_COMMAND, SCRATCH_DIR
from forge.build.events import Aborted, Event, Finished, Output, StepFinished, StepStarted
from forge.build.model import BuildInputs, BuildRecord
from forge.build.prefix import removed_folders
from forge.build.tasks import (
    KILLED_ALONE,
    REPEATED_ALONE,
    TEST_FAILURES,
    TEST_STEPS,
    TIMED_OUT,
    Step,
    StepCondition,
    StepKind,
    Task,
    environment_file,
    step_line,
)
from forge.execution.jobserver import without_jobserver_notices
from forge.execution.memory import SIGKILL_CODES, PackageMemory, killed_program
from forge.execution.observer import note_step
from forge.execution.started import BUILD_FOLDER_VARIABLE, START_VARIABLE, StartedProcesses

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from forge.execution.executor import Executor
    from forge.execution.job_pool import JobPool

Surroundings: TypeAlias = (
    "Callable[[Task, Step, Mapping[str, str], Callable[[], bool]], "
    "AbstractContextManager[tuple[Mapping[str, str], bool]]]"
)
"""Yields the environment of a step, and whether its log is to name the process of the step.

The arguments are the task, the step, its current environment and a function that tests for interruption.
"""

_INSTALLATIONS = 3
"""The maximum number of attempts of an install step while other packages install into the same prefix."""
GRACE_SECONDS = 3.0
"""The time for an interrupted program to end before it receives the next stronger signal."""

_LINGER_SECONDS = 1.0
"""The time to read from a silent pipe that another process holds open after the step's program ended."""
_LONGEST_LINGER = 5.0
"""The same for a pipe into which that process keeps writing."""

_LONGEST_LINE = 65536
"""The number of bytes after which an unfinished line is emitted."""

_NOT_STARTED = 127

_COMPILES = frozenset({StepKind.BUILD, StepKind.BUILD_TARGET})
_LAST_PIECES = 500
"""The number of pieces of a failed step's output that are searched for a killed compiler.

Most commands print one.
"""


_OWN_PREFIX = "FORGE_"
_VALID_LATER = frozenset({"FORGE_COMMAND", BUILD_FOLDER_VARIABLE})
"""forge's variables, except those that are valid only during this build."""


class TaskLifecycle:
    """Actions before and after the steps of a task, always on this machine."""

    __slots__ = ()

    def restore(self, _task: Task) -> BuildRecord | None:
        """Return the record of a task that needs no step, because its result was stored; called first."""
        return None

    def environment(self, task: Task) -> Mapping[str, str]:
        """Return the environment of the steps."""
        raise NotImplementedError

    def staged(self, task: Task) -> Task:
        """Return the task with its steps in a stage, if possible; called before the first step."""
        return task

    def unstaged(self, _task: Task, _failed: Step | None, *, stopped: bool) -> Task | None:
        """Remove the stage and return the task to rerun in place; otherwise do nothing and return None."""
        return None

    def is_outdated(self, _task: Task) -> bool:
        """Return True if the steps, which succeeded, must run again from an empty build folder."""
        return False

    def begin(self, task: Task, environment: Mapping[str, str]) -> None:
        """Prepare the first step."""

    def install(self, _task: Task) -> BuildRecord:
        """Install the results after the last step, and return the record."""
        return BuildRecord(BuildInputs())

    def undo(self, task: Task) -> None:
        """Restore the previous state, because a step failed or the build was stopped."""

    def remark(self, _task: Task) -> str:
        """Return the remark of the package cache at the end."""
        return ""

    def check(self, task: Task) -> None:
        """Raise ForgeError if forge made a step fail."""


class TaskRunner:
    """Runs one task at a time per calling thread."""

    def __init__(self, lifecycle: TaskLifecycle, executor: Executor, job_pool: JobPool | None = None) -> None:
        """Store the arguments; with a `job_pool`, a task holds a job from beginning to end."""
        self.executor = executor
        self._lifecycle = lifecycle
        self._job_pool = job_pool

    def run(self, task: Task, put: Callable[[Event | BaseException], None]) -> None:
        """Restore the result of `task`, or run its steps and install it; put every event.

        The last one is Finished or Aborted. An exception is put before it.
        """
        lifecycle = self._lifecycle
        try:
            with self._job_pool.package() if self._job_pool else nullcontext(enter_result=True) as begun:
                if not begun:
                    put(Aborted(task.name, 0.0))
                    return
                started = time.monotonic()
                record = lifecycle.restore(task)
                if record is None:
                    task = lifecycle.staged(task)
                    failure = self.executor.run(task, self._open(task), put, partial(self._restart, task))
                    if failure is None and lifecycle.is_outdated(task):
                        failure = self.executor.run(
                            task, self._restart(task), put, partial(self._restart, task)
                        )
                    failed_step = failure.step if isinstance(failure, Finished) else None
                    if again := lifecycle.unstaged(task, failed_step, stopped=isinstance(failure, Aborted)):
                        task = again
                        failure = self.executor.run(task, self._open(task), put, partial(self._restart, task))
                    if failure is not None:
                        failure = replace(failure, seconds=time.monotonic() - started)
                        lifecycle.check(task)
                        lifecycle.undo(task)
                        put(failure)
                        return
                    record = lifecycle.install(task)
                    record = replace(record, seconds=time.monotonic() - started)
                seconds = time.monotonic() - started
                put(Finished(task.name, 0, seconds, record=record, cache=lifecycle.remark(task)))
        except BaseException as error:
            # The disk may be full, for example: partially installed files must not look complete.
            with contextlib.suppress(Exception):
                lifecycle.undo(task)
            put(error)
            put(Aborted(task.name, 0.0))

    def _open(self, task: Task) -> Mapping[str, str]:
        """Prepare the first step; return the environment of the steps."""
        environment = self._lifecycle.environment(task)
        self._lifecycle.begin(task, environment)
        task.build_dir.mkdir(parents=True, exist_ok=True)
        for path, text in task.files:
            write_if_changed(path, text)
        exports = [f"export {name}={shlex.quote(value)}" for name, value in changed_variables(environment)]
        write_if_changed(environment_file(task), "\n".join(exports) + "\n", mode=0o600)
        return environment

    def _restart(self, task: Task) -> Mapping[str, str]:
        """Remove the partial results of an earlier attempt; return the environment of the steps."""
        self._lifecycle.undo(task)
        with contextlib.suppress(OSError):
            remove_folder(str(task.build_dir), last=SCRATCH_DIR)
        return self._open(task)


def _unchanged(
    _task: Task, _step: Step, variables: Mapping[str, str], _is_stopped: object
) -> AbstractContextManager[tuple[Mapping[str, str], bool]]:
    return nullcontext((variables, False))


class LocalExecutor:
    """Runs each step in a separate process group on this machine."""

    def __init__(
        self,
        job_pool: JobPool | None = None,
        started: StartedProcesses | None = None,
        surroundings: Surroundings | None = None,
        memory: PackageMemory | None = None,
    ) -> None:
        """Store the arguments. Executors of plugins do without them: their steps share no jobs."""
        self.slots = job_pool.local if job_pool else 1
        self._job_pool = job_pool
        self._started = started
        self._surroundings: Surroundings = surroundings or _unchanged
        self._memory = memory
        self._stopping = threading.Event()
        self._groups: set[int] = set()
        self._lock = threading.Lock()
        self._last_signal: signal.Signals | None = None
        self._installing: Counter[Path] = Counter()
        self._installations: Counter[Path] = Counter()

    def run(
        self,
        task: Task,
        environment: Mapping[str, str],
        put: Callable[[Event], None],
        _restart: Callable[[], Mapping[str, str]] | None = None,
    ) -> Finished | Aborted | None:
        """Run the steps of `task` in order, until one fails or the build is stopped; see Executor."""
        tests = StepCondition.TESTS_PASSED
        for step in task.steps:
            if step.condition not in {StepCondition.ALWAYS, tests}:
                continue
            if self._stopping.is_set():
                return Aborted(task.name, 0.0)
            # In a merged prefix, an install step that failed while another one ran is repeated: CMake creates
            # folders and replaces files of other packages in several system calls.
            installs = step.kind is StepKind.INSTALL
            for _ in range(_INSTALLATIONS if installs else 1):
                with self._installation(task.prefix) if installs else nullcontext(bool) as disturbed:
                    code, killed = self._run_step(task, step, environment, put)
                    if not code or self._stopping.is_set() or not disturbed():
                        break
            if code and killed and step.kind in _COMPILES and not self._stopping.is_set():
                code = self._repeat_alone(task, step, environment, put, killed)
            if code and self._stopping.is_set() and code < 0:
                return Aborted(task.name, 0.0)
            if code and step.meaning(code) is None:
                return Finished(task.name, code, 0.0, step)
            failed = step.meaning(code) == TEST_FAILURES
            tests = StepCondition.TESTS_FAILED if failed else StepCondition.TESTS_PASSED
        return None

    def _repeat_alone(
        self,
        task: Task,
        step: Step,
        environment: Mapping[str, str],
        put: Callable[[Event], None],
        killed: str,
    ) -> int:
        """Repeat a build step whose compiler ran out of memory, with one job and nothing else running."""

        def say(text: str) -> None:
            put(Output(task.name, f"forge: {text}\n".encode(), stderr=True))

        say(f"{killed} was killed, probably for lack of memory; {REPEATED_ALONE}")
        with self._job_pool.alone() if self._job_pool else nullcontext():
            if self._stopping.is_set():
                return -signal.SIGKILL
            code, again = self._run_step(task, step, environment, put, alone=True)
        if code and again:
            say(f"{again} {KILLED_ALONE}")
        return code

    @contextlib.contextmanager
    def _installation(self, prefix: Path) -> Iterator[Callable[[], bool]]:
        """Count an install step; yield a function that returns whether another one has disturbed it."""
        removed = removed_folders(prefix)
        with self._lock:
            others = self._installing[prefix]
            self._installing[prefix] += 1
            self._installations[prefix] += 1
            number = self._installations[prefix]
        try:
            yield lambda: bool(
                others or self._installations[prefix] > number or removed != removed_folders(prefix)
            )
        finally:
            with self._lock:
                self._installing[prefix] -= 1

    def finish_steps(self) -> None:
        self._stopping.set()
        if self._job_pool:
            self._job_pool.stop()

    def interrupt(self, *, kill: bool) -> None:
        """Interrupt every process group; those that do not end are terminated, then killed."""
        self.finish_steps()
        if self._started and self._last_signal is None:
            self._started.note_descendants()
        self._signal(signal.SIGKILL if kill else signal.SIGINT)

        def escalate() -> None:
            for signal_number in (signal.SIGTERM, signal.SIGKILL):
                time.sleep(GRACE_SECONDS)
                self._signal(signal_number)

        if not kill:
            threading.Thread(target=escalate, daemon=True).start()

    def _signal(self, number: signal.Signals) -> None:
        with self._lock:
            self._last_signal = number
            for group in self._groups:
                _signal_group(group, number)

    def _run_step(
        self,
        task: Task,
        step: Step,
        environment: Mapping[str, str],
        put: Callable[[Event], None],
        *,
        alone: bool = False,
    ) -> tuple[int, str | None]:
        """Run a step; return its exit code, and the program that was killed, if any."""
        killed = None
        last: deque[bytes] = deque(maxlen=_LAST_PIECES)
        if step.record:
            if has_text(*step.record):
                return 0, None
            step.record[0].unlink(missing_ok=True)
        if step.kind is StepKind.INSTALL:
            from forge.build.staging import next_install

            # Files of the last build still exist if other packages have installed them as well, or if they
            # are outside the prefix. CMake would write through a link to the file in the sources.
            for path in filter(os.path.islink, () if step.stage else task.earlier):
                Path(path).unlink()
            step = next_install(step, task)
        line = step_line(step, environment_file(task))
        write_if_changed(task.build_dir / task.scratch_dir / LAST_COMMAND, line + "\n")
        variables: Mapping[str, str] = {**environment, **dict(step.env)}
        put(StepStarted(task.name, step, changed_variables(variables)))

        def put_output(text: bytes, stderr: bool) -> None:
            if step.kind in _COMPILES:
                last.append(text)
            if step.stage:  # show the prefix to users
                text = text.replace(os.fsencode(step.stage), os.fsencode(task.prefix))
            if step.tests_at_once:  # while it runs, its folder links to that of the results
                text = text.replace(os.fsencode(step.cwd), os.fsencode(task.build_dir))
            put(Output(task.name, text, stderr=stderr))

        tools = self._job_pool.tools(step, variables, alone=alone) if self._job_pool else None
        with (
            tools or nullcontext((variables, ())) as (for_tools, descriptors),
            self._surroundings(task, step, for_tools, self._stopping.is_set) as (variables, logs),
        ):
            token = self._started.announce() if self._started else ""
            try:
                process = subprocess.Popen(
                    step.argv,
                    cwd=step.cwd,
                    env={**variables, START_VARIABLE: token} if token else variables,
                    pass_fds=descriptors,
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.PIPE,
                    start_new_session=True,
                )
            except OSError as error:
                reason = error.strerror if step.cwd.is_dir() else "its working directory no longer exists"
                message = f"forge: cannot start '{step.argv[0]}': {reason}\n"
                put(Output(task.name, message.encode(), stderr=True))
                code = _NOT_STARTED
            else:
                if self._started:
                    self._started.note(process.pid, token)
                with self._lock:
                    self._groups.add(process.pid)
                    if self._last_signal is not None:  # it started during an interrupt
                        _signal_group(process.pid, self._last_signal)
                if logs:
                    note_step(variables, process.pid, step)
                watching = self._memory.watching(task.name, process.pid) if self._memory else nullcontext()
                try:
                    with process, watching, _deadline(process, step.seconds) as is_late:
                        _read_lines(process, put_output)
                        if step.kind in TEST_STEPS:
                            # Processes left by tests would disturb others, and write into the build folder.
                            os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
                            _signal_group(process.pid, signal.SIGKILL)
                        if self._memory:
                            # Wait as Popen does, but learn the use of memory.
                            with contextlib.suppress(ChildProcessError):
                                _, status, usage = os.wait4(process.pid, 0)
                                process.returncode = os.waitstatus_to_exitcode(status)
                                self._memory.note_usage(task.name, usage)
                    code = process.returncode
                    if is_late():
                        code = TIMED_OUT
                        text = f"forge: stopped, because it took longer than {step.seconds:g} s\n"
                        put_output(text.encode(), stderr=True)
                    elif code:
                        own = Path(step.argv[0]).name if code in SIGKILL_CODES else None
                        killed = next(filter(None, map(killed_program, last)), own)
                finally:
                    with self._lock:
                        self._groups.discard(process.pid)
        if step.record and code == 0:
            if step.kind is StepKind.CONFIGURE:
                from forge.build.build_dir import restore_outputs

                restore_outputs(step.cwd)
            write_if_changed(*step.record)
        put(StepFinished(task.name, step, code))
        return code, killed


def _signal_group(group: int, number: signal.Signals) -> None:
    # forge may not signal a program of another user, such as sudo.
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(group, number)


@contextlib.contextmanager
def _deadline(process: subprocess.Popen[bytes], seconds: float) -> Iterator[Callable[[], bool]]:
    """Stop the group of a process after a time limit, unless that is 0.

    Yield a function that returns whether this happened.
    """
    ended, late = threading.Event(), threading.Event()

    def stop() -> None:
        late.set()
        for number in (signal.SIGTERM, signal.SIGKILL):
            _signal_group(process.pid, number)
            if ended.wait(GRACE_SECONDS):
                break

    timer = threading.Timer(seconds, stop) if seconds else None
    if timer:
        timer.daemon = True
        timer.start()
    try:
        yield late.is_set
    finally:
        ended.set()
        if timer:
            timer.cancel()


def _read_lines(process: subprocess.Popen[bytes], put: Callable[[bytes, bool], None]) -> None:
    """Put the lines of both pipes as they arrive, until both are closed.

    A daemon started by the program may hold the pipes open; it is not waited for.
    """
    with contextlib.ExitStack() as stack:
        selector = stack.enter_context(selectors.DefaultSelector())
        for pipe, stderr in ((process.stdout, False), (process.stderr, True)):
            assert pipe is not None
            selector.register(pipe, selectors.EVENT_READ, stderr)
        with contextlib.suppress(AttributeError, OSError):  # not available in old kernels
            end = os.pidfd_open(process.pid)
            stack.callback(os.close, end)
            selector.register(end, selectors.EVENT_READ)
        partial_lines = {False: b"", True: b""}
        timeout, latest = None, float("inf")
        while any(key.data is not None for key in selector.get_map().values()) and time.monotonic() < latest:
            ready = selector.select(timeout)
            if not ready:
                break
            for key, _ in ready:
                if key.data is None:
                    selector.unregister(key.fileobj)
                    timeout, latest = _LINGER_SECONDS, time.monotonic() + _LONGEST_LINGER
                    continue
                chunk = os.read(key.fd, _LONGEST_LINE)
                if not chunk:
                    selector.unregister(key.fileobj)
                lines, newline, partial_line = (partial_lines[key.data] + chunk).rpartition(b"\n")
                if lines := without_jobserver_notices(lines + newline):
                    put(lines, key.data)
                if len(partial_line) >= _LONGEST_LINE:
                    put(partial_line, key.data)
                    partial_line = b""
                partial_lines[key.data] = partial_line
        for stderr, partial_line in partial_lines.items():
            if partial_line:
                put(partial_line + b"\n", stderr)


def changed_variables(variables: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    """Return the variables that differ from forge's own environment and that are valid after this build."""
    own_variables = dict(os.environ)  # lookups in os.environ encode and decode
    changed = {name: value for name, value in variables.items() if own_variables.get(name) != value}
    own = {name for name in changed if name.startswith(_OWN_PREFIX)} - _VALID_LATER
    return tuple(sorted((name, value) for name, value in changed.items() if name not in own))
