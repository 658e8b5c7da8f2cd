"""Samples the use of processors and memory during a build from /proc.

Includes all processes of the machine, because others may slow down a build.
"""

from __future__ import annotations

import os
import threading
import time
from typing import TYPE_CHECKING

from forge.toolchain.resources import ROOT, memory

if TYPE_CHECKING:
    from pathlib import Path

PERIOD_SECONDS = 0.2
_MOST = 1500
"""Maximum number of samples, more than a chart has pixels; beyond it, pairs of samples are merged."""


class Sampler:
    """Takes samples in a thread until stopped; the period doubles whenever there are too many.

    A sample is a time of the monotonic clock, the number of busy processors since the previous sample, and
    the bytes in use.
    """

    def __init__(self, period: float = PERIOD_SECONDS, most: int = _MOST) -> None:
        self._period = period
        self._most = most
        self.samples: list[tuple[float, float, int]] = []
        self._before = (time.monotonic(), processor_times() or (0, 0))
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._sample_periodically, name="sampling", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Take a last sample."""
        if not self._stopped.is_set():
            self._stopped.set()
            self._thread.join()
            self._sample()

    def _sample(self) -> None:
        """Take a sample of the time since the previous one."""
        now, times, found = time.monotonic(), processor_times(), memory()
        (_, (busy, whole)) = self._before
        if times is None or found is None or times[1] == whole:
            return
        share = (times[0] - busy) / (times[1] - whole)
        self.samples.append((now, share * (os.cpu_count() or 1), found.total - found.available))
        self._before = (now, times)
        if len(self.samples) > self._most:
            self.samples = [
                _joined(*pair) for pair in zip(self.samples[::2], self.samples[1::2], strict=False)
            ]
            self._period *= 2

    def _sample_periodically(self) -> None:
        while not self._stopped.wait(self._period):
            self._sample()


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
