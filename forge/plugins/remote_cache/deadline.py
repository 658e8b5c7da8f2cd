"""Timeouts for remote stores: deadlines that extend with transferred bytes, and abandonable threads.

No socket option limits a whole request: name resolution has no timeout, and a server that sends one byte per
second never exceeds a read timeout. So blocking calls run in threads, and the caller stops waiting at the
deadline. An abandoned thread ends by itself or with forge.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from queue import Empty, SimpleQueue
from typing import Any, Final, TypeVar

_Answer = TypeVar("_Answer")

RATE: Final = 1 << 20
"""The minimum transfer rate in bytes per second: each transferred byte extends the deadline accordingly."""


class DeadlineExceeded(Exception):
    """The deadline has passed, or the operation was abandoned."""


class Deadline:
    """A deadline some seconds from now, extended by one second for each mebibyte transferred."""

    def __init__(self, seconds: float) -> None:
        self._end = time.monotonic() + seconds

    def metered(self, blocks: Iterable[bytes]) -> Iterator[bytes]:
        """Yield transferred blocks, which extend the deadline; raises DeadlineExceeded if it has passed."""
        for block in blocks:
            if self.remaining() <= 0:
                raise DeadlineExceeded
            self._end += len(block) / RATE
            yield block

    def remaining(self) -> float:
        """Return the remaining seconds, negative after the deadline."""
        return self._end - time.monotonic()

    def stop(self) -> None:
        """Let the deadline pass now."""
        self._end = 0.0


class TimeoutExecutor:
    """Runs blocking calls in threads, which are abandoned at their deadline."""

    def __init__(self) -> None:
        self._waiting: set[SimpleQueue[tuple[Any, BaseException | None]]] = set()
        self._closed = False

    def run(self, seconds: float, job: Callable[[Deadline], _Answer]) -> _Answer:
        """Return the job's result or raise its exception; raises DeadlineExceeded if it takes too long."""
        deadline = Deadline(seconds)
        answers: SimpleQueue[tuple[Any, BaseException | None]] = SimpleQueue()
        self._waiting.add(answers)

        def work() -> None:
            try:
                answers.put((job(deadline), None))
            except BaseException as error:
                answers.put((None, error))

        try:
            if self._closed:
                raise DeadlineExceeded
            threading.Thread(target=work, name="forge-cache", daemon=True).start()
            while (remaining := deadline.remaining()) > 0:
                with contextlib.suppress(Empty):
                    answer, error = answers.get(timeout=remaining)
                    if error is not None:
                        raise error
                    return answer  # type: ignore[no-any-return]
            raise DeadlineExceeded
        finally:
            deadline.stop()
            self._waiting.discard(answers)

    def close(self) -> None:
        """Abort all waiting callers."""
        self._closed = True
        for answers in tuple(self._waiting):
            answers.put((None, DeadlineExceeded()))
