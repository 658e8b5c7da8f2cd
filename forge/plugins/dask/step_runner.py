"""A program on a worker that runs the steps of one task, and terminates them when the worker ends.

It reads a RemoteTask from stdin, followed by commands, one per line; the end of stdin means that the result
is no longer needed. It writes events to stdout, each pickled and preceded by its length; the reader runs the
same forge.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import pickle
import sys
import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import BinaryIO

from forge.build.events import Aborted, Event, Finished
from forge.execution.job_pool import JobPool
from forge.execution.jobserver import join_pool
from forge.execution.runner import LocalExecutor
from forge.execution.started import BUILD_FOLDER_VARIABLE, StartedProcesses
from forge.plugins.dask.messages import FINISH, INTERRUPT, RemoteTask
from forge.toolchain.resources import is_overloaded

LENGTH = 4
"""The size in bytes of the length in front of each message."""

COMMANDS_THREAD = "commands"
"""The name of the thread that reads commands."""

_PATIENCE_SECONDS = 30.0


def main(argv: list[str]) -> int:
    """Run the task in stdin; see `run_task`."""
    # Unbuffered: the lock of a buffer would block the exit while a thread still reads.
    source = os.fdopen(os.dup(0), "rb", buffering=0)
    target = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # output of the task must not mix with the messages
    run_task(argv, source, target)
    return 0


def run_task(argv: list[str], source: BinaryIO, target: BinaryIO) -> None:
    """Run the task in `source`; `argv` is the number of jobs, the jobserver address and supporting tools."""
    jobs, auth, *jobserver_tools = argv
    # The client is trusted: it may run anything here.
    remote_task: RemoteTask = pickle.loads(read_message(source))  # noqa: S301
    pool = join_pool(auth) if auth else None
    overloaded = partial(is_overloaded, remote_task.jobs.memory_limit, remote_task.jobs.load_limit)
    job_pool = JobPool(int(jobs), pool, frozenset(jobserver_tools), is_overloaded=overloaded)
    folder = remote_task.environment.get(BUILD_FOLDER_VARIABLE)
    executor = LocalExecutor(job_pool, StartedProcesses(Path(folder)) if folder else None)
    threading.Thread(target=_listen, args=(source, executor), name=COMMANDS_THREAD, daemon=True).start()
    put = partial(_write, target, threading.Lock())
    with (
        contextlib.closing(job_pool),
        locked(remote_task.lock, _PATIENCE_SECONDS),
        job_pool.package() as has_begun,
    ):
        task = remote_task.task
        stopped = None if has_begun else Aborted(task.name, 0.0)
        put(stopped or executor.run(task, remote_task.environment, put) or Finished(task.name, 0, 0.0))


def with_length(content: bytes) -> bytes:
    return len(content).to_bytes(LENGTH, "big") + content


def read_message(stream: BinaryIO) -> bytes:
    """Return the next message; raises EOFError at the end."""
    return _exactly(stream, int.from_bytes(_exactly(stream, LENGTH), "big"))


def _exactly(stream: BinaryIO, size: int) -> bytes:
    content = b""
    while len(content) < size:
        more = stream.read(size - len(content))
        if not more:
            raise EOFError
        content += more
    return content


def _write(target: BinaryIO, lock: threading.Lock, event: Event) -> None:
    # Fails if the worker has ended; then the steps are terminated at the end of stdin.
    with lock, contextlib.suppress(OSError):
        target.write(with_length(pickle.dumps(event)))
        target.flush()


def _listen(source: BinaryIO, executor: LocalExecutor) -> None:
    """Execute the commands in `source`; kill the steps at its end."""
    for line in source:
        command = line.decode().strip()
        if command == FINISH:
            executor.finish_steps()
        else:
            executor.interrupt(kill=command != INTERRUPT)
    executor.interrupt(kill=True)


@contextlib.contextmanager
def locked(lock: Path, seconds: float) -> Iterator[None]:
    """Hold a lock, waiting for an earlier attempt of the same task to release it; raises TimeoutError."""
    until = time.monotonic() + seconds
    with lock.open("a") as stream:
        while True:
            try:
                fcntl.flock(stream.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() > until:
                    raise TimeoutError(f"'{lock}' is still held by an earlier attempt") from None
                time.sleep(0.05)
        yield


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
