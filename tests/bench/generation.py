"""Measure the interface compiler on one processor, sizes in turns; print JSON.

python -m tests.bench.generation [--runs N] [--sizes 250 1000 5000] [--langs python cpp]

For each size: a first run, one with nothing changed, and one with one file changed, each with the start of
the interpreter. `touched` says which files the last one wrote. Nothing is asserted.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

from forge import __version__
from tests.bench.definitions import write_definitions

KINDS = ("first", "unchanged", "one_changed")


@dataclass(slots=True)
class Package:
    """A generated package, and what its runs took."""

    source: Path
    languages: tuple[str, ...]
    output: Path = field(default_factory=Path)
    seconds: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    busy: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    """The processor's time of the same runs, which other programs do not lengthen."""
    touched: tuple[str, ...] = ()

    def turn(self, number: int) -> None:
        """Run all three kinds once, into a new folder.

        Nothing is deleted before all is measured: for five seconds afterwards ext4 takes three times as long
        to make a file.
        """
        self.output = self.source.with_name(f"{self.source.name}-out-{number}")
        self.run("first")
        self.run("unchanged")
        changed = max(self.source.glob("msg/*.msg"))
        with changed.open("a", encoding="utf-8") as stream:
            stream.write(f"int32 added_{number}\n")
        before = self.marks()
        self.run("one_changed")
        after = self.marks()
        self.touched = tuple(sorted(path for path in after if after[path] != before.get(path)))

    def run(self, kind: str) -> None:
        """Run the compiler; raises CalledProcessError when it fails."""
        languages = [word for language in self.languages for word in ("--lang", language)]
        argv = [sys.executable, "-m", "forge", "interface", "generate", "--package", "bench_msgs", *languages]
        start, before = time.perf_counter(), _children()
        subprocess.run([*argv, "--output", self.output, self.source], check=True, capture_output=True)
        self.seconds[kind].append(time.perf_counter() - start)
        self.busy[kind].append(_children() - before)

    def marks(self) -> dict[str, int]:
        """Return the time of each output's last change."""
        paths = (path for path in self.output.rglob("*") if path.is_file() and ".forge" not in path.parts)
        return {path.relative_to(self.output).as_posix(): path.stat().st_mtime_ns for path in paths}


def main() -> int:
    """Measure and print one JSON document."""
    options = _parser().parse_args()
    processor = min(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {processor})
    with tempfile.TemporaryDirectory(prefix="forge-bench-") as folder:
        root = Path(folder)
        packages = {
            size: Package(write_definitions(root / f"{size}", size), tuple(options.langs))
            for size in options.sizes
        }
        for turn in range(options.runs):
            for package in packages.values():
                package.turn(turn)
    machine = {"python": platform.python_version(), "machine": platform.machine(), "forge": __version__}
    results = {str(size): _summary(size, package) for size, package in packages.items()}
    print(json.dumps({"on": machine, "runs": options.runs, "messages": results}, indent=2))
    return 0


def _summary(size: int, package: Package) -> dict[str, object]:
    medians = {f"{kind}_ms": round(1000 * median(package.seconds[kind]), 1) for kind in KINDS}
    medians |= {f"{kind}_busy_ms": round(1000 * median(package.busy[kind]), 1) for kind in KINDS}
    each = {"first_ms_per_message": round(1000 * median(package.seconds["first"]) / size, 2)}
    return {**medians, **each, "touched": package.touched}


def _children() -> float:
    """Return the seconds that the processor has worked for children so far."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m tests.bench.generation", description="Measure the interface compiler; print JSON."
    )
    parser.add_argument("--runs", type=int, default=5, help="how often each size has its turn (default: 5)")
    parser.add_argument("--sizes", type=int, nargs="+", default=[250, 1000, 5000], metavar="N")
    parser.add_argument("--langs", nargs="+", default=["python", "cpp"], metavar="LANG")
    return parser


if __name__ == "__main__":
    sys.exit(main())
