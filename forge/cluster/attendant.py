"""A program on a worker that runs the steps of one task, and ends them when the worker itself has ended.

It reads an errand from stdin, then words, one a line; the end of stdin means that nobody waits any more. It
writes events to stdout. Each is pickled behind its length: what reads it runs the same forge.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import pickle
import sys
import threading
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from forge.budget import Budget
from forge.capacity import shortage
from forge.cluster.model import FINISH, INTERRUPT
from forge.jobserver import joined_pool
from forge.model import Aborted, Finished, Parts, Record
from forge.runner import Frame, ProcessRunner
from forge.started import VARIABLE, StartedProcesses

if TYPE_CHECKING:
    from collections.abc import Iterator

    from forge.cluster.model import Errand
    from forge.model import Event

LENGTH = 4
"""Bytes in front of each message that say how long it is."""

WORDS = "words"
"""The name of the thread that reads them."""

_PATIENCE_SECONDS = 30.0


def main(argv: list[str]) -> int:
    """Run the errand that stdin brings, as `attend` does."""
    attend(argv, _own_stdin(), _own_stdout())
    return 0


def attend(argv: list[str], source: BinaryIO, target: BinaryIO) -> None:
    """Run the errand that `source` brings with jobs as `argv` says: number, address, tools that share."""
    jobs, auth, *fluent = argv
    # Of the client, which may run anything here.
    errand: Errand = pickle.loads(received(source))  # noqa: S301
    pool = joined_pool(auth) if auth else None
    short = partial(shortage, errand.terms.memory, errand.terms.load)
    budget = Budget(int(jobs), pool, frozenset(fluent), short=short)
    # What surrounds the steps is done by the client.
    frame = Frame(lambda _: errand.environment, lambda _task, _variables: None, lambda _: Record(Parts()))
    folder = errand.environment.get(VARIABLE) if errand.lock else None
    runner = ProcessRunner(frame, budget, StartedProcesses(Path(folder)) if folder else None)
    gently = errand.parcel is not None
    heed = partial(_heed, source, runner, gently=gently)
    threading.Thread(target=heed, name=WORDS, daemon=True).start()
    put = partial(_write, target, threading.Lock())
    name, begun = errand.task.name, time.monotonic()
    if errand.parcel is not None:
        from forge.cluster.sources import lay_out  # noqa: PLC0415  (only where folders are not shared)

        lay_out(errand.parcel)
    with contextlib.closing(budget), _held(errand.lock), budget.package() as has_begun:
        stopped = None if has_begun else Aborted(name, 0.0)
        failure = stopped or runner.run_steps(errand.task, errand.environment, put, begun)
        put(failure or Finished(name, 0, time.monotonic() - begun))


def framed(content: bytes) -> bytes:
    """Return a message as it goes through a pipe."""
    return len(content).to_bytes(LENGTH, "big") + content


def received(stream: BinaryIO) -> bytes:
    """Return the next message; raises EOFError where there is none."""
    return _exactly(stream, int.from_bytes(_exactly(stream, LENGTH), "big"))


def _exactly(stream: BinaryIO, size: int) -> bytes:
    content = b""
    while len(content) < size:
        more = stream.read(size - len(content))
        if not more:
            raise EOFError
        content += more
    return content


def _own_stdin() -> BinaryIO:
    """Return stdin without a buffer: its lock would be in the way of our end, while a thread still reads."""
    return os.fdopen(os.dup(0), "rb", buffering=0)


def _own_stdout() -> BinaryIO:
    """Return stdout for us alone: whatever else prints there reaches stderr."""
    own = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return own


def _write(target: BinaryIO, lock: threading.Lock, event: Event) -> None:
    # Nobody reads it when the worker is gone; then the steps are ended by that.
    with lock, contextlib.suppress(OSError):
        target.write(framed(pickle.dumps(event)))
        target.flush()


def _heed(source: BinaryIO, runner: ProcessRunner, *, gently: bool) -> None:
    """Do as the words say, until there are no more; `gently` with a forge, which must end what it started."""
    for line in source:
        word = line.decode().strip()
        if word == FINISH:
            runner.finish_steps()
        else:
            runner.interrupt(kill=word != INTERRUPT and not gently)
    runner.interrupt(kill=not gently)


@contextlib.contextmanager
def _held(lock: Path | None) -> Iterator[None]:
    """Hold a lock, so that whoever begins the same task again knows when we have ended."""
    if lock is None:
        yield
        return
    with lock.open("w") as stream:
        until = time.monotonic() + _PATIENCE_SECONDS
        while not taken(stream.fileno()):
            if time.monotonic() > until:
                raise TimeoutError(f"'{lock}' is still held by an earlier attempt")
            time.sleep(0.05)
        yield


def taken(descriptor: int) -> bool:
    """Lock a file if nobody else has, and tell."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
