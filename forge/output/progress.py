"""The progress of a build: running and completed packages, and an estimate of the remaining time."""

from __future__ import annotations

from dataclasses import field, replace
from statistics import mean
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.build.events import Aborted, Finished, Fresh, Skipped, Started, StepStarted

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from forge.build.events import Event

_EARLY = 2.0
"""Seconds before the first estimate."""
_LONGEST_SECONDS = 1e7
"""An estimate above this comes from a damaged record of durations."""


@frozen
class Running:
    """A package that is being built: its current step and its start time."""

    name: str
    begun: float
    step: str = ""


@frozen
class Progress:
    """The progress of a build; all times are seconds of one clock.

    `expected` contains the expected duration of each package; it is empty if no duration is known.
    """

    begun: float
    expected: Mapping[str, float] = field(default_factory=dict)
    total: int = 0
    running: tuple[Running, ...] = ()
    done: frozenset[str] = frozenset()
    failed: tuple[str, ...] = ()
    unsure: frozenset[str] = frozenset()
    """Packages that are built only if one of their dependencies changes."""
    needless: frozenset[str] = frozenset()
    """Packages that turned out to be up to date, or that will not be started."""

    def after(self, event: Event, now: float) -> Progress:
        """Return the progress after an event."""
        name = event.task
        match event:
            case Started():
                running = (*self.running, Running(name, now))
                return replace(self, running=running, unsure=self.unsure - {name})
            case StepStarted(_, step):
                steps = (replace(r, step=step.label) if r.name == name else r for r in self.running)
                return replace(self, running=tuple(steps))
            case Finished(_, code):
                failed = (*self.failed, name) if code else self.failed
                return replace(self, running=self._without(name), done=self.done | {name}, failed=failed)
            case Aborted():
                return replace(self, running=self._without(name), done=self.done | {name})
            case Fresh() | Skipped():
                unsure = self.unsure - {name}
                return replace(self, done=self.done | {name}, needless=self.needless | {name}, unsure=unsure)
            case _:
                return self

    def left(self, now: float) -> float | None:
        """Estimate the remaining seconds from the pace so far; None while an estimate is impossible.

        Packages that may turn out to be up to date do not count: if there are any, it takes at least as long.
        """
        passed = now - self.begun
        left_out = self.needless | self.unsure
        worth = {name: cost for name, cost in self.expected.items() if name not in left_out}
        made = sum(cost for name, cost in worth.items() if name in self.done)
        made += sum(min(now - r.begun, worth.get(r.name, 0.0)) for r in self.running)
        if passed < _EARLY or made <= 0:
            return None
        left = (sum(worth.values()) - made) * passed / made
        return max(0.0, left) if left < _LONGEST_SECONDS else None

    def _without(self, name: str) -> tuple[Running, ...]:
        return tuple(running for running in self.running if running.name != name)


def expectations(names: Iterable[str], seconds: Mapping[str, float]) -> Mapping[str, float]:
    """Return the expected duration of each package: that of its last build, else the average of the others.

    Empty if no duration is known.
    """
    known = {name: seconds[name] for name in names if name in seconds}
    if not known:
        return {}
    usual = mean(known.values())
    return {name: known.get(name, usual) for name in names}
