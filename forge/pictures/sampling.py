"""How much of the machine is in use while something goes on: a look at /proc a few times a second.

All programs count, those of others too: what makes a build slow may be none of its own.
"""

from __future__ import annotations

import os
import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

from forge.capacity import ROOT, memory
from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

PERIOD_SECONDS = 0.2
_MOST = 1500
"""More samples than a picture has pixels would be of no use: then every other one goes."""


@frozen
class Usage:
    """What there is of processors and bytes of memory, and what was in use.

    Samples are a time of the monotonic clock, how many processors were busy since the one before, and how
    many bytes were in use.
    """

    processors: int
    memory: int
    samples: tuple[tuple[float, float, int], ...]


class Watch:
    """Nobody looks, and there is nothing to tell."""

    def usage(self) -> Usage | None:
        """Return what was seen, or None where nothing could be."""
        return None


@contextmanager
def watched(*, wanted: bool, period: float = PERIOD_SECONDS) -> Iterator[Watch]:
    """Look at the machine in a thread of its own, if that is wanted and there is a /proc."""
    if not wanted or processor_times() is None:
        yield Watch()
        return
    sampler = Sampler(period)
    sampler.start()
    try:
        yield sampler
    finally:
        sampler.stop()


class Sampler(Watch):
    """Takes samples until it is stopped; the period doubles whenever there are too many."""

    def __init__(self, period: float, most: int = _MOST) -> None:
        """Begin with a first look."""
        self._period = period
        self._most = most
        self._samples: list[tuple[float, float, int]] = []
        self._before = (time.monotonic(), processor_times() or (0, 0))
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._look_on, name="sampling", daemon=True)

    def start(self) -> None:
        """Begin to look."""
        self._thread.start()

    def stop(self) -> None:
        """Look no more."""
        self._stopped.set()
        self._thread.join()

    def usage(self) -> Usage | None:
        """Look for the last time, and return what was seen."""
        self.stop()
        self.look()
        found = memory()
        return Usage(os.cpu_count() or 1, found.total if found else 0, tuple(self._samples))

    def look(self) -> None:
        """Take a sample, of the time since the one before."""
        now, times, found = time.monotonic(), processor_times(), memory()
        (_, (busy, whole)) = self._before
        if times is None or found is None or times[1] == whole:
            return
        share = (times[0] - busy) / (times[1] - whole)
        self._samples.append((now, share * (os.cpu_count() or 1), found.total - found.available))
        self._before = (now, times)
        if len(self._samples) > self._most:
            self._samples = [
                _joined(*pair) for pair in zip(self._samples[::2], self._samples[1::2], strict=False)
            ]
            self._period *= 2

    def _look_on(self) -> None:
        while not self._stopped.wait(self._period):
            self.look()


def processor_times(root: Path = ROOT) -> tuple[int, int] | None:
    """Return for how long the processors were busy, and how long in all, in ticks since the machine began.

    None where nobody says.
    """
    try:
        first, _, _ = (root / "proc/stat").read_text(encoding="ascii").partition("\n")
    except OSError:
        return None
    # user nice system idle iowait irq softirq steal; guests are in user and nice already
    word, *numbers = first.split()[:9]
    ticks = [int(number) for number in numbers]
    return (sum(ticks) - sum(ticks[3:5]), sum(ticks)) if word == "cpu" else None


def _joined(first: tuple[float, float, int], second: tuple[float, float, int]) -> tuple[float, float, int]:
    """Return two samples as one, of the time of both."""
    return second[0], (first[1] + second[1]) / 2, max(first[2], second[2])
