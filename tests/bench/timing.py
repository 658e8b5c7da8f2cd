"""Run command lines in turn, A B A B, and report what they took; nothing is asserted."""

from __future__ import annotations

import os
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

    def run(self) -> float:
        """Run the command line once and return the seconds; raises CalledProcessError when it fails."""
        environment = {**os.environ, **self.env}
        if self.before:
            subprocess.run(self.before, cwd=self.cwd, env=environment, check=True, capture_output=True)
        start = time.perf_counter()
        subprocess.run(self.argv, cwd=self.cwd, env=environment, check=True, capture_output=True)
        return time.perf_counter() - start


@dataclass(frozen=True, slots=True)
class Timing:
    """The seconds of a variant's runs, in the order in which they ran."""

    name: str
    seconds: tuple[float, ...]

    def as_json(self) -> dict[str, object]:
        """Return the numbers a reader wants, in milliseconds."""
        rounded = [round(1000 * second, 1) for second in self.seconds]
        return {
            "median_ms": round(1000 * median(self.seconds), 1),
            "min_ms": min(rounded),
            "runs_ms": rounded,
        }


def compare(variants: Sequence[Variant], runs: int) -> tuple[Timing, ...]:
    """Run all variants `runs` times in turn, after one turn that warms caches and does not count.

    Raises subprocess.CalledProcessError when a command line fails.
    """
    seconds: dict[str, list[float]] = {variant.name: [] for variant in variants}
    for turn in range(runs + 1):
        for variant in variants:
            taken = variant.run()
            if turn:
                seconds[variant.name].append(taken)
    return tuple(Timing(name, tuple(taken)) for name, taken in seconds.items())
