"""The progress of a build, according to its events and the duration of earlier builds."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import field, replace
from statistics import mean

from forge.base.frozen import frozen
from forge.build.events import Aborted, Event, Finished, Fresh, Output, Skipped, Started, StepStarted

_EARLY = 2.0
"""Seconds before the first estimate."""
_LONGEST_SECONDS = 1e7
"""An estimate above this comes from a damaged record of durations."""
_NEWEST_LINES = 8
"""The number of lines at the end of output that are searched for a count."""
_ALMOST = 0.99
_COUNT = re.compile(
    rb"^\[\s*(?P<done>\d{1,9})/(?P<all>\d{1,9})\b"  # ninja: [3/12] Building
    rb"|^\s*(?P<test>\d{1,9})/(?P<tests>\d{1,9}) Test\s+#"  # ctest: 1/4 Test #1: talk
    rb"|^\[\s*(?P<make>\d{1,3})%\]"  # make: [ 25%] Building
    rb"|\[\s*(?P<pytest>\d{1,3})%\]\s*$"  # pytest: test_talk.py ..F [ 25%]
)


@frozen
class Running:
    """A package that is being built: its start time, its current step, and the completed share of both."""

    name: str
    begun: float
    step: str = ""
    share: float | None = None
    """The completed share of the step, from 0 to 1, as reported by its program; None if it reports none."""
    made: float = 0.0
    """The completed share of the package as far as it is known."""


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
        name = event.task
        match event:
            case Started():
                running = (*self.running, Running(name, now))
                return replace(self, running=running, unsure=self.unsure - {name})
            case StepStarted(_, step):
                return self._with(name, step=step.label, share=None)
            case Output(_, lines, stderr):
                share = None if stderr else counted_share(lines)
                return self if share is None else self._with(name, share=share, made=share)
            case Finished() | Aborted():
                fails = isinstance(event, Finished) and event.code != 0
                failed = (*self.failed, name) if fails else self.failed
                return replace(
                    self,
                    running=tuple(running for running in self.running if running.name != name),
                    done=self.done | {name},
                    failed=failed,
                )
            case Fresh() | Skipped():
                unsure = self.unsure - {name}
                return replace(self, done=self.done | {name}, needless=self.needless | {name}, unsure=unsure)
            case _:
                return self

    def share(self, now: float) -> float:
        """Return the completed share of all packages, from 0 to 1; 1 only if none is left."""
        if len(self.done) >= self.total:
            return 1.0
        total, done = self._work(now, self.needless)
        if total <= 0:
            total, done = self.total, len(self.done) + sum(each.made for each in self.running)
        return min(_ALMOST, done / total)

    def left(self, now: float) -> float | None:
        """Estimate the remaining seconds from the pace so far; None while an estimate is impossible.

        Packages that may turn out to be up to date do not count: if there are any, the estimate is a lower
        bound.
        """
        passed = now - self.begun
        total, done = self._work(now, self.needless | self.unsure)
        if passed < _EARLY or done <= 0:
            return None
        left = (total - done) * passed / done
        return max(0.0, left) if left < _LONGEST_SECONDS else None

    def _work(self, now: float, left_out: frozenset[str]) -> tuple[float, float]:
        """Return the expected seconds of the packages not `left_out`, and how many of these are done."""
        worth = {name: cost for name, cost in self.expected.items() if name not in left_out}
        done_seconds = sum(cost for name, cost in worth.items() if name in self.done)
        for running in self.running:
            cost = worth.get(running.name, 0.0)
            done_seconds += cost * running.made if running.made else min(now - running.begun, cost)
        return sum(worth.values()), done_seconds

    def _with(self, name: str, *, made: float = 0.0, **changes: object) -> Progress:
        """Return the progress with changes of a running package, whose completed share never decreases."""
        running = (
            replace(each, made=max(each.made, made), **changes) if each.name == name else each  # type: ignore[arg-type]
            for each in self.running
        )
        return replace(self, running=tuple(running))


def counted_share(output: bytes) -> float | None:
    """Return the completed share according to the newest count of a build or test tool, None if unknown."""
    for line in reversed(output.rsplit(b"\n", _NEWEST_LINES)[-_NEWEST_LINES:]):
        match = _COUNT.search(line)
        if match is None:
            continue
        percent = match["make"] or match["pytest"]
        done, every = (
            (percent, 100) if percent else (match["done"] or match["test"], match["all"] or match["tests"])
        )
        if int(every):
            return min(1.0, int(done) / int(every))
    return None


def expectations(names: Iterable[str], seconds: Mapping[str, float]) -> Mapping[str, float]:
    """Return the expected duration of each package: that of its last build, else the average of the others.

    Empty if no duration is known.
    """
    durations = {name: seconds[name] for name in names if name in seconds}
    if not durations:
        return {}
    usual = mean(durations.values())
    return {name: durations.get(name, usual) for name in names}
