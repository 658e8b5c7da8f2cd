"""The scheduler decides which task starts next; it uses neither threads nor a clock."""

from __future__ import annotations

from heapq import heappop, heappush
from typing import TYPE_CHECKING

from forge.base.graph import closures, reduced, reverse
from forge.build.events import Aborted, Finished, Fresh, Skipped, Started

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.build.events import Event
    from forge.build.tasks import BuildPlan


class Scheduler:
    """The waiting, running and finished tasks of a build; owned by the build loop.

    At most `limit` tasks run at a time (0: any number). Ready tasks on the critical path start first,
    according to the durations in `seconds`, then those with more dependents; with `in_order`, tasks start in
    plan order. After a failure no task starts, or with `continue_on_error` no task that needs the failed
    package.
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
        # Tasks list their transitive dependencies: millions of entries for a chain of thousands. Reduce them,
        # since they are visited whenever a task ends.
        direct = reduced(
            {name: (*task.needs, *task.after) for name, task in plan.tasks.items()}, [*plan.tasks]
        )
        self._needs = {name: frozenset(needs) for name, needs in direct.items()}
        self._dependents = reverse(self._needs)
        self._unfinished_needs = {name: len(needs) for name, needs in direct.items()}
        self._limit = limit or len(plan.tasks) + 1
        self._continue = continue_on_error
        self._running: set[str] = set()
        self._failed: dict[str, str] = {}
        self._stopped_by: str | None = None
        ordered = [*self._needs]
        if not in_order:
            weights = _weights(self._dependents, seconds or {})
            # Sorting is stable, so ties keep the plan's topological order.
            ordered.sort(key=weights.__getitem__, reverse=True)
        self._position = {name: position for position, name in enumerate(ordered)}
        self._waiting = dict.fromkeys(ordered)
        # Heaps of tasks that are ready, and of tasks that will never start because a dependency failed.
        self._ready = [
            (position, name) for position, name in enumerate(ordered) if not self._unfinished_needs[name]
        ]
        self._blocked: list[tuple[int, str]] = []

    @property
    def running(self) -> frozenset[str]:
        return frozenset(self._running)

    @property
    def stopped(self) -> bool:
        """Return True if no further task will start."""
        return self._stopped_by is not None

    def advance(self) -> list[Started | Skipped]:
        """Return the tasks that are skipped and the tasks that start now."""
        if self._stopped_by is not None:
            events: list[Started | Skipped] = [Skipped(name, self._stopped_by) for name in self._waiting]
            self._waiting.clear()
            return events
        events = []
        while self._blocked:
            _, name = heappop(self._blocked)
            if name in self._waiting:
                del self._waiting[name]
                because = min(self._failed[need] for need in self._needs[name] if need in self._failed)
                self._fail(name, because)
                events.append(Skipped(name, because))
        while self._ready and len(self._running) < self._limit:
            _, name = heappop(self._ready)
            del self._waiting[name]
            self._running.add(name)
            events.append(Started(name))
        return events

    def note(self, event: Event) -> None:
        """Record how a task ended; other events are ignored."""
        match event:
            case Finished(task, 0) | Fresh(task):
                self._running.discard(task)
                for dependent in self._dependents[task]:
                    self._unfinished_needs[dependent] -= 1
                    if not self._unfinished_needs[dependent]:
                        heappush(self._ready, (self._position[dependent], dependent))
            case Finished(task):
                self._fail(task, task)
                if not self._continue:
                    self.stop(task)
            case Aborted(task):
                self._fail(task, task)
            case _:
                pass

    def stop(self, because: str) -> None:
        """Start no further task; the first reason is kept."""
        self._stopped_by = self._stopped_by or because

    def _fail(self, name: str, because: str) -> None:
        self._running.discard(name)
        self._failed[name] = because
        for dependent in self._dependents[name]:
            heappush(self._blocked, (self._position[dependent], dependent))


def _weights(
    dependents: Mapping[str, frozenset[str]], seconds: Mapping[str, float]
) -> dict[str, tuple[float, int]]:
    """Return for each task the length of its critical path to the end and its number of dependents.

    `dependents` is in topological order. A task of unknown duration counts as the median; if no duration is
    known, all paths have length 0.
    """
    known = sorted(seconds[name] for name in dependents if name in seconds)
    typical = known[len(known) // 2] if known else 0.0
    backwards = [*dependents][::-1]
    waiting = closures(dependents, backwards)
    chain: dict[str, float] = {}
    for name in backwards:
        longest = max((chain[dependent] for dependent in dependents[name]), default=0.0)
        chain[name] = longest + seconds.get(name, typical)
    return {name: (chain[name], len(waiting[name])) for name in dependents}
