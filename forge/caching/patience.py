"""How long to wait for others: a deadline that moves with the bytes, and threads that may be left behind.

No setting of a socket bounds a whole request: names are looked up without any bound, and a server that
sends one byte a second is never late for a single byte. So what may hang is done by a thread, and whoever
needs the answer stops waiting for it in time. A thread that was left behind ends by itself, or with forge.
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
"""Bytes for each of which a deadline moves, by a second for so many: what is slower is too slow."""

LONGEST: Final = 1e6
"""Seconds, more than any clock of the system needs to count; twelve days are for ever."""


class Overdue(Exception):  # noqa: N818  (callers turn it into a fault of their store)
    """The deadline is over, or nobody waits any more."""


class Patience:
    """So many seconds from now, and one more for each mebibyte that moved."""

    def __init__(self, seconds: float) -> None:
        """Begin to wait."""
        self.seconds = seconds
        self._end = time.monotonic() + seconds

    def moved(self, count: int) -> None:
        """Grant the time for bytes that came or went; Overdue when they came too late."""
        if self.left() <= 0:
            raise Overdue
        self._end += count / RATE

    def counted(self, blocks: Iterable[bytes]) -> Iterator[bytes]:
        """Yield blocks that come or go, and grant their time."""
        for block in blocks:
            self.moved(len(block))
            yield block

    def left(self) -> float:
        """Return how many seconds are left, below zero when it is over."""
        return self._end - time.monotonic()

    def stop(self) -> None:
        """Let nothing more be waited for."""
        self._end = 0.0


class _Errand(Generic[_Answer]):
    """Something that a thread does, and what came of it."""

    def __init__(self, job: Callable[[], _Answer]) -> None:
        self.job = job
        self.done = threading.Event()
        self.answer: list[_Answer] = []
        self.error: BaseException | None = None

    def run(self) -> None:
        """Do it, and keep what it gives or raises."""
        try:
            self.answer.append(self.job())
        except BaseException as error:  # noqa: BLE001  (raised again where the answer is awaited)
            self.error = error
        self.done.set()


class Errands:
    """Runs what may hang in threads of its own, as many as callers; those that are idle are used again."""

    def __init__(self) -> None:
        """Start no thread yet."""
        self._idle: list[SimpleQueue[_Errand[Any] | None]] = []
        self._waiting: set[threading.Event] = set()
        self._closed = False

    def run(self, patience: Patience, job: Callable[[], _Answer]) -> _Answer:
        """Return what the job returns, or raise what it raises; Overdue when that takes too long."""
        inbox, errand = self._thread(), _Errand(job)
        self._waiting.add(errand.done)
        inbox.put(errand)
        try:
            self._wait(errand.done, patience)
        except BaseException:
            patience.stop()
            inbox.put(None)
            raise
        finally:
            self._waiting.discard(errand.done)
        if not errand.answer and errand.error is None:
            patience.stop()
            inbox.put(None)
            raise Overdue
        if self._closed:
            inbox.put(None)
        else:
            self._idle.append(inbox)
        if errand.error is not None:
            raise errand.error
        return errand.answer[0]

    def _wait(self, done: threading.Event, patience: Patience) -> None:
        while not self._closed and (left := patience.left()) > 0 and not done.wait(left):
            pass

    def _thread(self) -> SimpleQueue[_Errand[Any] | None]:
        """Return the inbox of an idle thread, or of a new one."""
        if self._closed:
            raise Overdue
        with contextlib.suppress(IndexError):
            return self._idle.pop()
        inbox: SimpleQueue[_Errand[Any] | None] = SimpleQueue()
        threading.Thread(target=_serve, args=(inbox,), name="forge-cache", daemon=True).start()
        return inbox

    def close(self) -> None:
        """Let everybody stop waiting, and idle threads end."""
        self._closed = True
        for done in tuple(self._waiting):
            done.set()
        while self._idle:
            with contextlib.suppress(IndexError):
                self._idle.pop().put(None)


def _serve(inbox: SimpleQueue[_Errand[Any] | None]) -> None:
    while (errand := inbox.get()) is not None:
        errand.run()
