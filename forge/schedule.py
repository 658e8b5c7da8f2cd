"""What may start next: a board of tasks, without threads and without a clock."""

from __future__ import annotations

from heapq import heappop, heappush
from typing import TYPE_CHECKING

from forge.graph import closures, reduced, reverse
from forge.model import Aborted, Finished, Fresh, Skipped, Started

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from forge.model import BuildPlan, Event


class Board:
    """The state of a build: what waits, what runs, what ended; owned by the one loop.

    At most `limit` tasks run at a time (0: any number). Among ready tasks those go first from which the
    longest chain of work leads to the end, as far as `seconds` says how long tasks take, then those that
    more others wait for; `in_order` the first of the plan goes first. After a failure nothing starts any
    more, or with `continue_on_error` nothing that needs the failed package.
    """

    def __init__(
        self,
        plan: BuildPlan,
        limit: int,
        seconds: Mapping[str, float] | None = None,
        *,
        continue_on_error: bool = False,
        in_order: bool = False,
    ) -> None:
        """Put every task of the plan on the board, waiting."""
        # A task has all that it needs, however deep: of a chain of thousands, millions of entries that would
        # be looked at whenever anything ends.
        direct = reduced(
            {name: (*task.needs, *task.after) for name, task in plan.tasks.items()}, [*plan.tasks]
        )
        self._needs = {name: frozenset(needs) for name, needs in direct.items()}
        self._dependents = reverse(self._needs)
        self._open = {name: len(needs) for name, needs in direct.items()}
        self._limit = limit or len(plan.tasks) + 1
        self._continue = continue_on_error
        self._running: set[str] = set()
        self._failed: dict[str, str] = {}
        self._stopped_by: str | None = None
        ordered = [*self._needs]
        if not in_order:
            weights = _weights(self._dependents, seconds or {})
            # Sorting is stable: ties keep the plan's topological order.
            ordered.sort(key=weights.__getitem__, reverse=True)
        self._place = {name: place for place, name in enumerate(ordered)}
        self._waiting = dict.fromkeys(ordered)
        # Heaps, whose first comes first: what could start, and what never will since a need of it failed.
        self._ready = [(place, name) for place, name in enumerate(ordered) if not self._open[name]]
        self._blocked: list[tuple[int, str]] = []

    @property
    def running(self) -> frozenset[str]:
        """The tasks that began and did not end."""
        return frozenset(self._running)

    @property
    def stopped(self) -> bool:
        """Tell if nothing will start any more."""
        return self._stopped_by is not None

    def advance(self) -> list[Started | Skipped]:
        """Return what happens now: tasks that never will start, and tasks that do."""
        if self._stopped_by is not None:
            skipped = [Skipped(name, self._stopped_by) for name in self._waiting]
            self._waiting.clear()
            return [*skipped]
        return [*self._skip(), *self._start()]

    def note(self, event: Event) -> None:
        """Take note of how a task ended; other events change nothing."""
        match event:
            case Finished(task, 0) | Fresh(task):
                self._running.discard(task)
                for dependent in self._dependents[task]:
                    self._open[dependent] -= 1
                    if not self._open[dependent]:
                        heappush(self._ready, (self._place[dependent], dependent))
            case Finished(task):
                self._fail(task, task)
                if not self._continue:
                    self.stop(task)
            case Aborted(task):
                self._fail(task, task)
            case _:
                pass

    def stop(self, because: str) -> None:
        """Start nothing any more; the first reason counts."""
        self._stopped_by = self._stopped_by or because

    def _start(self) -> Iterator[Started]:
        while self._ready and len(self._running) < self._limit:
            _, name = heappop(self._ready)
            del self._waiting[name]
            self._running.add(name)
            yield Started(name)

    def _skip(self) -> Iterator[Skipped]:
        while self._blocked:
            _, name = heappop(self._blocked)
            if name in self._waiting:
                del self._waiting[name]
                because = min(self._failed[need] for need in self._needs[name] if need in self._failed)
                self._fail(name, because)
                yield Skipped(name, because)

    def _fail(self, name: str, because: str) -> None:
        self._running.discard(name)
        self._failed[name] = because
        for dependent in self._dependents[name]:
            heappush(self._blocked, (self._place[dependent], dependent))


def _weights(
    dependents: Mapping[str, frozenset[str]], seconds: Mapping[str, float]
) -> dict[str, tuple[float, int]]:
    """Return for each task how long the longest chain from it to the end takes, and how many wait for it.

    `dependents` is in topological order. A task of which nothing is known takes as long as the usual one;
    where nothing is known of any, chains count nothing.
    """
    known = sorted(seconds[name] for name in dependents if name in seconds)
    usual = known[len(known) // 2] if known else 0.0
    backwards = [*dependents][::-1]
    waiting = closures(dependents, backwards)
    chain: dict[str, float] = {}
    for name in backwards:
        behind = max((chain[dependent] for dependent in dependents[name]), default=0.0)
        chain[name] = behind + seconds.get(name, usual)
    return {name: (chain[name], len(waiting.below(name))) for name in dependents}
