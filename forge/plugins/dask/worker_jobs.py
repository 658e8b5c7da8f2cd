"""Share the jobs of one worker between the packages that it builds concurrently."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator, Mapping

from forge.base.frozen import frozen
from forge.execution.jobserver import TOKEN, TokenPool, common_style, create_pool, supported_styles
from forge.toolchain.programs import find_ninja, find_program
from forge.toolchain.resources import processors


@frozen
class JobSettings:
    """The job settings of a step runner: arguments, and descriptors that it inherits."""

    arguments: tuple[str, str]
    descriptors: tuple[int, ...] = ()


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
    def slot(self) -> Iterator[JobSettings]:
        """Occupy a slot for a step runner."""
        if self._pool is None:
            yield JobSettings((str(max(1, self._jobs // self._slots)), ""))
            return
        if not self._active:
            # Restore tokens lost by killed tools, while no task runs.
            while self._pool.take_now():
                pass
            self._pool.give(TOKEN * (self._jobs - self._slots))
        self._active += 1
        try:
            yield JobSettings((str(self._jobs), self._pool.auth), self._pool.descriptors)
        finally:
            self._active -= 1
