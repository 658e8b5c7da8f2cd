"""Timeouts for remote stores: deadlines that extend with transferred bytes, and abandonable threads.

No socket option limits a whole request: name resolution has no timeout, and a server that sends one byte per
second never exceeds a read timeout. So blocking calls run in threads, and the caller stops waiting at the
deadline. An abandoned thread ends by itself or with forge.
"""

from __future__ import annotations

import contextlib
import threading
import time
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, Final, Generic, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

_Answer = TypeVar("_Answer")

RATE: Final = 1 << 20
"""The minimum transfer rate in bytes per second: each transferred byte extends the deadline accordingly."""

MAX_SECONDS: Final = 1e6
"""The maximum timeout in seconds (twelve days), within the range of all system timers."""


class DeadlineExceeded(Exception):
    """The deadline has passed, or the operation was abandoned."""


class Deadline:
    """A deadline some seconds from now, and one more second for each mebibyte transferred."""

    def __init__(self, seconds: float) -> None:
        """Start the clock."""
        self.seconds = seconds
        self._end = time.monotonic() + seconds

    def extend(self, count: int) -> None:
        """Extend the deadline for transferred bytes; raises DeadlineExceeded if it has passed."""
        if self.remaining() <= 0:
            raise DeadlineExceeded
        self._end += count / RATE

    def metered(self, blocks: Iterable[bytes]) -> Iterator[bytes]:
        """Yield transferred blocks and extend the deadline for each."""
        for block in blocks:
            self.extend(len(block))
            yield block

    def remaining(self) -> float:
        """Return the remaining seconds, negative after the deadline."""
        return self._end - time.monotonic()

    def stop(self) -> None:
        """Let the deadline pass now."""
        self._end = 0.0


class _Job(Generic[_Answer]):
    """A call in a thread, and its result."""

    def __init__(self, job: Callable[[], _Answer]) -> None:
        self.job = job
        self.done = threading.Event()
        self.answer: list[_Answer] = []
        self.error: BaseException | None = None

    def run(self) -> None:
        """Call the function and store its result or exception."""
        try:
            self.answer.append(self.job())
        except BaseException as error:
            self.error = error
        self.done.set()


class TimeoutExecutor:
    """Runs blocking calls in a pool of threads, one per concurrent caller; idle threads are reused."""

    def __init__(self) -> None:
        """Start without threads."""
        self._idle: list[SimpleQueue[_Job[Any] | None]] = []
        self._waiting: set[threading.Event] = set()
        self._closed = False

    def run(self, deadline: Deadline, job: Callable[[], _Answer]) -> _Answer:
        """Return the job's result or raise its exception; raises DeadlineExceeded if it takes too long."""
        inbox, job_state = self._thread(), _Job(job)
        self._waiting.add(job_state.done)
        inbox.put(job_state)
        try:
            self._wait(job_state.done, deadline)
        except BaseException:
            deadline.stop()
            inbox.put(None)
            raise
        finally:
            self._waiting.discard(job_state.done)
        if not job_state.answer and job_state.error is None:
            deadline.stop()
            inbox.put(None)
            raise DeadlineExceeded
        if self._closed:
            inbox.put(None)
        else:
            self._idle.append(inbox)
        if job_state.error is not None:
            raise job_state.error
        return job_state.answer[0]

    def _wait(self, done: threading.Event, deadline: Deadline) -> None:
        while not self._closed and (remaining := deadline.remaining()) > 0 and not done.wait(remaining):
            pass

    def _thread(self) -> SimpleQueue[_Job[Any] | None]:
        """Return the inbox of an idle or new thread."""
        if self._closed:
            raise DeadlineExceeded
        with contextlib.suppress(IndexError):
            return self._idle.pop()
        inbox: SimpleQueue[_Job[Any] | None] = SimpleQueue()
        threading.Thread(target=_serve, args=(inbox,), name="forge-cache", daemon=True).start()
        return inbox

    def close(self) -> None:
        """Abort all waiting callers and end idle threads."""
        self._closed = True
        for done in tuple(self._waiting):
            done.set()
        while self._idle:
            with contextlib.suppress(IndexError):
                self._idle.pop().put(None)


def _serve(inbox: SimpleQueue[_Job[Any] | None]) -> None:
    while (job_state := inbox.get()) is not None:
        job_state.run()
