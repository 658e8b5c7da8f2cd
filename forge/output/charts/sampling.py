"""Samples the use of processors and memory during a build from /proc.

Includes all processes of the machine, because others may slow down a build.
"""

from __future__ import annotations

import os
import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.toolchain.resources import ROOT, memory

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

PERIOD_SECONDS = 0.2
_MOST = 1500
"""Maximum number of samples, more than a chart has pixels; beyond it, pairs of samples are merged."""


@frozen
class Usage:
    """The number of processors, the bytes of memory, and samples of their use.

    A sample is a time of the monotonic clock, the number of busy processors since the previous sample, and
    the bytes in use.
    """

    processors: int
    memory: int
    samples: tuple[tuple[float, float, int], ...]


class NoSampler:
    """A sampler that takes no samples."""

    def usage(self) -> Usage | None:
        """Return None."""
        return None


@contextmanager
def sample_usage(*, wanted: bool, period: float = PERIOD_SECONDS) -> Iterator[NoSampler]:
    """Sample in a background thread, if requested and /proc is available."""
    if not wanted or processor_times() is None:
        yield NoSampler()
        return
    sampler = Sampler(period)
    sampler.start()
    try:
        yield sampler
    finally:
        sampler.stop()


class Sampler(NoSampler):
    """Takes samples until stopped; the period doubles whenever there are too many."""

    def __init__(self, period: float, most: int = _MOST) -> None:
        """Store the initial counters."""
        self._period = period
        self._most = most
        self._samples: list[tuple[float, float, int]] = []
        self._before = (time.monotonic(), processor_times() or (0, 0))
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._sample_periodically, name="sampling", daemon=True)

    def start(self) -> None:
        """Start sampling."""
        self._thread.start()

    def stop(self) -> None:
        """Stop sampling."""
        self._stopped.set()
        self._thread.join()

    def usage(self) -> Usage | None:
        """Take a last sample and return all samples."""
        self.stop()
        self.sample()
        found = memory()
        return Usage(os.cpu_count() or 1, found.total if found else 0, tuple(self._samples))

    def sample(self) -> None:
        """Take a sample of the time since the previous one."""
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

    def _sample_periodically(self) -> None:
        while not self._stopped.wait(self._period):
            self.sample()


def processor_times(root: Path = ROOT) -> tuple[int, int] | None:
    """Return the busy and the total time of all processors, in ticks since boot; None if unavailable."""
    try:
        first, _, _ = (root / "proc/stat").read_text(encoding="ascii").partition("\n")
    except OSError:
        return None
    # user nice system idle iowait irq softirq steal; guests are in user and nice already
    word, *numbers = first.split()[:9]
    ticks = [int(number) for number in numbers]
    return (sum(ticks) - sum(ticks[3:5]), sum(ticks)) if word == "cpu" else None


def _joined(first: tuple[float, float, int], second: tuple[float, float, int]) -> tuple[float, float, int]:
    """Merge two consecutive samples."""
    return second[0], (first[1] + second[1]) / 2, max(first[2], second[2])
