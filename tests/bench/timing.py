"""Run command lines in turn, A B A B, and report what they took; nothing is asserted."""

from __future__ import annotations

import os
import resource
import subprocess
import time
from dataclasses import dataclass, field
from statistics import median
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path


@dataclass(frozen=True, slots=True)
class Variant:
    """One of the command lines that a scenario compares."""

    name: str
    argv: tuple[str, ...]
    cwd: Path
    before: tuple[str, ...] = ()
    """What is run before each of its runs and does not count."""
    env: Mapping[str, str] = field(default_factory=dict)
    """Variables on top of those of this process."""

    def run(self) -> tuple[float, float]:
        """Run the command line once; return the seconds and how many of them processors worked.

        Raises CalledProcessError when it fails.
        """
        environment = {**os.environ, **self.env}
        if self.before:
            subprocess.run(self.before, cwd=self.cwd, env=environment, check=True, capture_output=True)
        start, worked = time.perf_counter(), _worked()
        subprocess.run(self.argv, cwd=self.cwd, env=environment, check=True, capture_output=True)
        return time.perf_counter() - start, _worked() - worked


@dataclass(frozen=True, slots=True)
class Timing:
    """The seconds of a variant's runs, in the order in which they ran.

    `worked` are those of processors, which say more than the others while a machine is busy.
    """

    name: str
    seconds: tuple[float, ...]
    worked: tuple[float, ...] = ()

    def as_json(self) -> dict[str, object]:
        """Return the numbers a reader wants, in milliseconds."""
        rounded = [round(1000 * second, 1) for second in self.seconds]
        worked = {"worked_median_ms": round(1000 * median(self.worked), 1)} if self.worked else {}
        return {
            "median_ms": round(1000 * median(self.seconds), 1),
            "min_ms": min(rounded),
            **worked,
            "runs_ms": rounded,
        }


def compare(variants: Sequence[Variant], runs: int) -> tuple[Timing, ...]:
    """Run all variants `runs` times in turn, after one turn that warms caches and does not count.

    Raises subprocess.CalledProcessError when a command line fails.
    """
    taken: dict[str, list[tuple[float, float]]] = {variant.name: [] for variant in variants}
    for turn in range(runs + 1):
        for variant in variants:
            both = variant.run()
            if turn:
                taken[variant.name].append(both)
    return tuple(
        Timing(name, tuple(seconds for seconds, _ in both), tuple(worked for _, worked in both))
        for name, both in taken.items()
    )


def _worked() -> float:
    """Return what processors have worked for the children of this process."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
