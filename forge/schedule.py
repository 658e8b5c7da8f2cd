"""What may start next: a board of tasks, without threads and without a clock."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.graph import reduced
from forge.model import Aborted, Finished, Fresh, Skipped, Started

if TYPE_CHECKING:
    from collections.abc import Mapping

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
        direct = reduced({name: task.needs for name, task in plan.tasks.items()}, [*plan.tasks])
        self._needs = {name: frozenset(needs) for name, needs in direct.items()}
        self._limit = limit or len(plan.tasks) + 1
        self._continue = continue_on_error
        self._done: set[str] = set()
        self._running: set[str] = set()
        self._failed: dict[str, str] = {}
        self._stopped_by: str | None = None
        self._waiting = list(self._needs)
        if not in_order:
            weights = _weights(plan, seconds or {})
            # Sorting is stable: ties keep the plan's topological order.
            self._waiting.sort(key=weights.__getitem__, reverse=True)

    @property
    def running(self) -> frozenset[str]:
        """The tasks that began and did not end."""
        return frozenset(self._running)

    @property
    def stopped(self) -> bool:
        """Tell if nothing will start any more."""
        return self._stopped_by is not None

    def advance(self) -> list[Started | Skipped]:
        """Return what happens now: tasks that start, and tasks that never will."""
        events: list[Started | Skipped] = []
        left: list[str] = []
        if self._idle():
            return events
        for name in self._waiting:
            because = self._stopped_by or self._blocker(name)
            if because is not None:
                self._failed[name] = because
                events.append(Skipped(name, because))
            elif self._may_start(name):
                self._running.add(name)
                events.append(Started(name))
            else:
                left.append(name)
        self._waiting = left
        return events

    def note(self, event: Event) -> None:
        """Take note of how a task ended; other events change nothing."""
        match event:
            case Finished(task, 0) | Fresh(task):
                self._running.discard(task)
                self._done.add(task)
            case Finished(task):
                self._running.discard(task)
                self._failed[task] = task
                if not self._continue:
                    self.stop(task)
            case Aborted(task):
                self._running.discard(task)
                self._failed[task] = task
            case _:
                pass

    def stop(self, because: str) -> None:
        """Start nothing any more; the first reason counts."""
        self._stopped_by = self._stopped_by or because

    def _idle(self) -> bool:
        """Tell if nothing can happen: all that may run does, and nothing went wrong."""
        return not self._failed and self._stopped_by is None and len(self._running) >= self._limit

    def _blocker(self, name: str) -> str | None:
        """Return the package whose failure keeps a task from ever starting, if there is one."""
        blockers = self._needs[name].intersection(self._failed) if self._failed else ()
        return min((self._failed[need] for need in blockers), default=None)

    def _may_start(self, name: str) -> bool:
        return len(self._running) < self._limit and self._needs[name] <= self._done


def _weights(plan: BuildPlan, seconds: Mapping[str, float]) -> dict[str, tuple[float, int]]:
    """Return for each task how long the longest chain from it to the end takes, and how many wait for it.

    A task of which nothing is known takes as long as the usual one; where nothing is known of any, chains
    count nothing.
    """
    needs = {name: task.needs for name, task in plan.tasks.items()}
    known = sorted(seconds[name] for name in needs if name in seconds)
    usual = known[len(known) // 2] if known else 0.0
    chain = dict.fromkeys(needs, 0.0)
    waiting = dict.fromkeys(needs, 0)
    for name in reversed(list(needs)):
        chain[name] += seconds.get(name, usual)
        for need in needs[name]:
            if need in chain:
                chain[need] = max(chain[need], chain[name])
                waiting[need] += 1
    return {name: (chain[name], waiting[name]) for name in needs}
