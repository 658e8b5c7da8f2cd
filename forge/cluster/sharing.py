"""The jobs of one worker, shared by the packages that it builds at a time."""

from __future__ import annotations

import contextlib
import threading
from pathlib import Path
from typing import TYPE_CHECKING

from forge.capacity import processors
from forge.frozen import frozen
from forge.jobserver import TOKEN, common_style, own_pool, spoken
from forge.tools import find_ninja, find_program

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from forge.jobserver import Pool


@frozen
class Ticket:
    """What an attendant is told of jobs: words for its command line, and descriptors that it inherits."""

    words: tuple[str, str]
    descriptors: tuple[int, ...] = ()


class Share:
    """One pool of tokens for a worker: a job for each of its slots, and in the pool what is left.

    Every attendant has the job of its slot unasked, so that none ever waits for another. Where no tool takes
    tokens from a pool, each gets its part.
    """

    def __init__(self, jobs: int | None, slots: int) -> None:
        """Begin with as many jobs as were asked for, else as many as there are processors."""
        self._jobs = max(jobs or processors(), slots)
        self._slots = slots
        self._pool: Pool | None = None
        self._styles: tuple[str, ...] | None = None
        self._at_work = 0
        self._lock = threading.Lock()

    def prepare(self, variables: Mapping[str, str]) -> tuple[str, ...]:
        """Find out, once, which tools take jobs from a pool; return their names."""
        with self._lock:
            if self._styles is None:
                tools = {"ninja": find_ninja(variables), "make": find_program("make", variables)}
                found = {name: spoken(name, Path(tool), variables) for name, tool in tools.items() if tool}
                style = common_style(found)
                self._pool = own_pool(style, self._jobs) if style else None
                self._jobs = min(self._jobs, self._pool.room) if self._pool else self._jobs
                self._styles = tuple(name for name, styles in found.items() if style in styles)
            return self._styles

    @contextlib.contextmanager
    def taken(self) -> Iterator[Ticket]:
        """Give a slot to an attendant."""
        if self._pool is None:
            yield Ticket((str(max(1, self._jobs // self._slots)), ""))
            return
        if not self._at_work:
            self._refill(self._pool)
        self._at_work += 1
        try:
            yield Ticket((str(self._jobs), self._pool.auth), self._pool.descriptors)
        finally:
            self._at_work -= 1

    def _refill(self, pool: Pool) -> None:
        """Put back what a killed tool took along, now that nobody has any."""
        while pool.take_now():
            pass
        pool.give(TOKEN * (self._jobs - self._slots))
