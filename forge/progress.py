"""How far a build is: what runs, what is done, and about how long the rest takes; frozen and pure."""

from __future__ import annotations

from dataclasses import field, replace
from statistics import mean
from typing import TYPE_CHECKING

from forge.frozen import frozen
from forge.model import Aborted, Finished, Fresh, Skipped, Started, StepStarted

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from forge.model import Event

_EARLY = 2.0
"""Seconds before which no estimate is worth its line."""


@frozen
class Running:
    """A package that is being built: its step, and when it began."""

    name: str
    begun: float
    step: str = ""


@frozen
class Progress:
    """Where a build stands. All times are seconds of one clock.

    `expected` says how long each package is likely to take; it is empty where nothing is known.
    """

    begun: float
    expected: Mapping[str, float] = field(default_factory=dict)
    total: int = 0
    running: tuple[Running, ...] = ()
    done: frozenset[str] = frozenset()
    failed: tuple[str, ...] = ()
    needless: frozenset[str] = frozenset()
    """Those that turned out fresh, or that do not start any more: nothing is to be done for them."""

    def after(self, event: Event, now: float) -> Progress:
        """Return where the build stands after an event."""
        name = event.task
        match event:
            case Started():
                return replace(self, running=(*self.running, Running(name, now)))
            case StepStarted(_, step):
                steps = (replace(r, step=step.label) if r.name == name else r for r in self.running)
                return replace(self, running=tuple(steps))
            case Finished(_, code):
                failed = (*self.failed, name) if code else self.failed
                return replace(self, running=self._without(name), done=self.done | {name}, failed=failed)
            case Aborted():
                return replace(self, running=self._without(name), done=self.done | {name})
            case Fresh() | Skipped():
                return replace(self, done=self.done | {name}, needless=self.needless | {name})
            case _:
                return self

    def left(self, now: float) -> float | None:
        """Return about how many seconds the rest takes at the pace until now; None while that is a guess."""
        passed = now - self.begun
        worth = {name: cost for name, cost in self.expected.items() if name not in self.needless}
        made = sum(cost for name, cost in worth.items() if name in self.done)
        made += sum(min(now - r.begun, worth.get(r.name, 0.0)) for r in self.running)
        if passed < _EARLY or made <= 0:
            return None
        return max(0.0, (sum(worth.values()) - made) * passed / made)

    def _without(self, name: str) -> tuple[Running, ...]:
        return tuple(running for running in self.running if running.name != name)


def expectations(names: Iterable[str], seconds: Mapping[str, float]) -> Mapping[str, float]:
    """Return how long each package is likely to take: as the last time, else as the others on average.

    Empty where nothing is known of any.
    """
    known = {name: seconds[name] for name in names if name in seconds}
    if not known:
        return {}
    usual = mean(known.values())
    return {name: known.get(name, usual) for name in names}
