"""Code that runs inside a Dask worker: a task requests its RemoteTask and starts a step runner for it.

The step runner is a separate program that terminates the steps if the worker is killed, so that no compiler
outlives its build. Everything here runs in the worker's event loop without concurrency.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import pickle
import socket
import sys
import threading
import uuid
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from forge.execution.jobserver import TOKEN, TokenPool, common_style, create_pool, supported_styles
from forge.plugins.dask.messages import ACK_INTERVAL, INTERRUPT, TaskRequest
from forge.plugins.dask.step_runner import LENGTH, with_length
from forge.toolchain.interpreter import own_command
from forge.toolchain.programs import find_ninja, find_program
from forge.toolchain.resources import processors

if TYPE_CHECKING:
    from distributed import Scheduler, Worker

    from forge.plugins.dask.messages import RemoteTask


_POLL_SECONDS = 0.5
"""How often a task checks whether its result is still needed."""
_END_SECONDS = 10.0

_MAX_PENDING = 2 * ACK_INTERVAL
"""The number of unacknowledged messages after which programs with much output are blocked."""

_attempts: dict[str, Attempt] = {}
_jobs: dict[str, WorkerJobs] = {}


class Attempt:
    """One attempt of a task on this worker."""

    def __init__(self, worker: Worker, topic: str, key: str) -> None:
        self.name = uuid.uuid4().hex
        self.topic = topic
        self.remote_task: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()
        self.commands: asyncio.Queue[str] = asyncio.Queue()
        self.may_send = asyncio.Event()
        self.may_send.set()
        self._pending = 0
        self._worker = worker
        self._key = key
        self._sent = 0

    @property
    def is_wanted(self) -> bool:
        """Return False if the client has cancelled the task or disconnected."""
        state = self._worker.state.tasks.get(self._key)
        return state is not None and state.state not in {"cancelled", "released", "forgotten"}

    def send(self, message: bytes) -> None:
        """Send a numbered message to the client."""
        self._worker.log_event(self.topic, {"attempt": self.name, "number": self._sent, "content": message})
        self._sent += 1
        self._pending += 1
        if self._pending >= _MAX_PENDING and self.is_wanted:
            self.may_send.clear()

    def acknowledge(self) -> None:
        """Continue after the client has acknowledged ACK_INTERVAL messages."""
        self._pending -= ACK_INTERVAL
        self.may_send.set()


async def run_remote_task(topic: str, key: str) -> None:
    """Run one task in Dask: request the RemoteTask, wait for it, forward its events."""
    from distributed import get_worker

    worker = get_worker()
    attempt = Attempt(worker, topic, key)
    _attempts[attempt.name] = attempt
    watch = asyncio.ensure_future(_interrupt_when_unwanted(attempt))
    try:
        request = TaskRequest(attempt.name, worker.address, socket.gethostname())
        attempt.send(pickle.dumps((key, request)))
        waiting: set[asyncio.Future[Any]] = {attempt.remote_task, watch}
        await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
        if attempt.remote_task.done() and not watch.done():
            remote_task: RemoteTask = pickle.loads(attempt.remote_task.result())  # noqa: S301  (a client may run anything here)
            await _run(attempt, remote_task, worker)
    finally:
        watch.cancel()
        del _attempts[attempt.name]


async def deliver_task(attempt: str, remote_task: bytes) -> None:
    """Deliver a pickled RemoteTask unless the attempt has ended. Called by the client."""
    running_attempt = _attempts.get(attempt)
    if running_attempt is not None and not running_attempt.remote_task.done():
        running_attempt.remote_task.set_result(remote_task)


async def acknowledge(attempt: str) -> None:
    """Acknowledge messages of an attempt. Called by the client."""
    running_attempt = _attempts.get(attempt)
    if running_attempt is not None:
        running_attempt.acknowledge()


async def send_command(topic: str, command: str) -> None:
    """Send a command to all attempts of a build. Called by the client."""
    for attempt in _attempts.values():
        if attempt.topic == topic:
            attempt.commands.put_nowait(command)


def forget(topic: str, dask_scheduler: Scheduler) -> None:
    """Remove the messages of an ended build from the scheduler."""
    with contextlib.suppress(AttributeError):
        dask_scheduler._broker.truncate(topic)


async def _interrupt_when_unwanted(attempt: Attempt) -> None:
    """Interrupt the step runner when the result is no longer needed."""
    while attempt.is_wanted:
        await asyncio.sleep(_POLL_SECONDS)
    attempt.commands.put_nowait(INTERRUPT)
    # There will be no further acknowledgements.
    attempt.may_send.set()


async def _run(attempt: Attempt, remote_task: RemoteTask, worker: Worker) -> None:
    jobs = _jobs.setdefault(attempt.topic, WorkerJobs(remote_task.jobs.jobs, worker.state.nthreads))
    styles = await asyncio.to_thread(jobs.prepare, remote_task.environment)
    with jobs.slot() as (number, auth, descriptors):
        argv = own_command("-m", "forge.plugins.dask.step_runner", number, auth, *styles)
        process = await asyncio.create_subprocess_exec(
            *argv,
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            pass_fds=descriptors,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            start_new_session=True,
        )
        assert process.stdin is not None
        process.stdin.write(with_length(pickle.dumps(remote_task)))
        passing = asyncio.ensure_future(_forward_commands(attempt, process.stdin))
        try:
            await _forward_messages(attempt, process)
        finally:
            passing.cancel()
            process.stdin.close()
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(process.wait(), _END_SECONDS)
    if process.returncode:
        raise RuntimeError(f"the step runner on {socket.gethostname()} exited with code {process.returncode}")


async def _forward_commands(attempt: Attempt, stdin: asyncio.StreamWriter) -> None:
    while True:
        command = await attempt.commands.get()
        with contextlib.suppress(OSError):
            stdin.write(f"{command}\n".encode())
            await stdin.drain()


async def _forward_messages(attempt: Attempt, process: asyncio.subprocess.Process) -> None:
    assert process.stdout is not None
    with contextlib.suppress(asyncio.IncompleteReadError):
        while True:
            size = int.from_bytes(await process.stdout.readexactly(LENGTH), "big")
            message = await process.stdout.readexactly(size)
            await attempt.may_send.wait()
            attempt.send(message)


class WorkerJobs:
    """The token pool of a worker: each slot has an implicit job, and the remaining tokens are in the pool.

    Therefore no step runner waits for another. If no tool supports a jobserver, each slot gets a fixed share.
    """

    def __init__(self, jobs: int | None, slots: int) -> None:
        self._jobs = max(jobs or processors(), slots)
        self._slots = slots
        self._pool: TokenPool | None = None
        self._styles: tuple[str, ...] | None = None
        self._active = 0
        self._lock = threading.Lock()

    def prepare(self, variables: Mapping[str, str]) -> tuple[str, ...]:
        """Return the names of the tools with jobserver support; create the pool at the first call."""
        with self._lock:
            if self._styles is None:
                tools = {"ninja": find_ninja(variables), "make": find_program("make", variables)}
                styles_of = {
                    name: supported_styles(name, tool, variables) for name, tool in tools.items() if tool
                }
                style = common_style(styles_of)
                self._pool = create_pool(style, self._jobs) if style else None
                self._jobs = min(self._jobs, self._pool.room) if self._pool else self._jobs
                self._styles = tuple(name for name, styles in styles_of.items() if style in styles)
            return self._styles

    @contextlib.contextmanager
    def slot(self) -> Iterator[tuple[str, str, tuple[int, ...]]]:
        """Occupy a slot for a step runner; yield its number of jobs, the jobserver and its descriptors."""
        if self._pool is None:
            yield str(max(1, self._jobs // self._slots)), "", ()
            return
        if not self._active:
            # Restore tokens lost by killed tools, while no task runs.
            while self._pool.take_now():
                pass
            self._pool.give(TOKEN * (self._jobs - self._slots))
        self._active += 1
        try:
            yield str(self._jobs), self._pool.auth, self._pool.descriptors
        finally:
            self._active -= 1
