"""Run command lines in turn, A B A B, and report what they took; nothing is asserted."""

import os
import resource
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.bench.figures import Series
from tests.bench.trees import watched

_MILLI = 1000


@dataclass(frozen=True, slots=True)
class Taken:
    """What one run took: seconds, those that processors worked, and megabytes where these were looked at."""

    seconds: float
    worked: float
    peak_mb: float | None = None


@dataclass(frozen=True, slots=True)
class Variant:
    """One of the command lines that a case compares."""

    name: str
    argv: tuple[str, ...]
    cwd: Path
    before: tuple[str, ...] = ()
    """What is run before each of its runs and does not count."""
    env: Mapping[str, str] = field(default_factory=dict)
    """Variables on top of those of this process."""

    def run(self, *, look: bool = False) -> Taken:
        """Run the command line once; `look` at its memory, which slows it a little.

        Raises CalledProcessError when it fails.
        """
        environment = {**os.environ, **self.env}
        if self.before:
            subprocess.run(self.before, cwd=self.cwd, env=environment, check=True, capture_output=True)
        start, worked = time.perf_counter(), _worked()
        peak = None
        if look:
            peak = self._look_at(environment)
        else:
            subprocess.run(self.argv, cwd=self.cwd, env=environment, check=True, capture_output=True)
        return Taken(time.perf_counter() - start, _worked() - worked, peak)

    def _look_at(self, environment: Mapping[str, str]) -> float | None:
        pipe = subprocess.PIPE
        with subprocess.Popen(
            self.argv, cwd=self.cwd, env=environment, stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe
        ) as process:
            with watched(process.pid) as peak:
                out, err = process.communicate()
            if process.returncode:
                raise subprocess.CalledProcessError(process.returncode, self.argv, out, err)
        return peak.megabytes


def compare(variants: Sequence[Variant], runs: int) -> dict[str, Series]:
    """Run all variants `runs` times in turn, after one turn that warms caches and does not count.

    In that first turn memory is looked at, so that looking slows nothing that counts. With one run only
    that turn is all there is, and counts. Raises subprocess.CalledProcessError when a command line fails.
    """
    first = {variant.name: variant.run(look=True) for variant in variants}
    taken: dict[str, list[Taken]] = {name: [] if runs > 1 else [once] for name, once in first.items()}
    for _ in range(runs if runs > 1 else 0):
        for variant in variants:
            taken[variant.name].append(variant.run())
    return {
        name: Series(
            tuple(_MILLI * each.seconds for each in turns),
            tuple(_MILLI * each.worked for each in turns),
            first[name].peak_mb,
        )
        for name, turns in taken.items()
    }


def _worked() -> float:
    """Return what processors have worked for the children of this process."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
