"""`python -m tests.bench.occupancy`: how full a cold build of compile-heavy packages keeps its jobs; JSON."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from tests.packages import manifest_text

ROOT = Path(__file__).parents[2]
COMPILERS = frozenset({"cc1plus", "cc1", "as", "ld"})
CMAKE = """cmake_minimum_required(VERSION 3.18)
project({name} CXX)
add_library({name} SHARED {sources})
install(TARGETS {name})
"""
SOURCE = """#include <map>
#include <regex>
#include <string>
std::map<std::string, std::regex> {name} = {{{{"{name}", std::regex("{name}+")}}}};
"""
_TICK = os.sysconf("SC_CLK_TCK")


@dataclass
class Watch:
    """What was seen of a tree of processes, again and again.

    Seconds, processor seconds so far, compilers, and programs that ran or would have with a processor free.
    """

    root: int
    begun: float = field(default_factory=time.monotonic)
    seen: list[tuple[float, float, int, int]] = field(default_factory=list)

    def look(self) -> None:
        """Look once. What ended counts with its parent, so the sum over the living is all there was."""
        table = {int(p.name): p for p in Path("/proc").iterdir() if p.name.isdigit()}
        stats = {}
        for number, process in table.items():
            try:
                name, _, rest = (process / "stat").read_text().partition("(")[2].rpartition(")")
            except OSError:
                continue
            words = rest.split()
            stats[number] = (name, int(words[1]), sum(map(int, words[11:15])) / _TICK, words[0] in "RD")
        tree, more = {self.root}, True
        while more:
            found = {n for n, (_, parent, _, _) in stats.items() if parent in tree and n not in tree}
            tree |= found
            more = bool(found)
        used = sum(stats[n][2] for n in tree if n in stats)
        compilers = sum(stats[n][0] in COMPILERS for n in tree if n in stats)
        ready = sum(stats[n][3] for n in tree - {self.root} if n in stats)
        self.seen.append((time.monotonic() - self.begun, used, compilers, ready))


def main() -> int:
    """Build once and print what was seen."""
    options = _parser().parse_args()
    with tempfile.TemporaryDirectory(prefix="forge-bench-") as folder:
        root = Path(folder)
        _write_workspace(root, options.packages, options.files)
        variables = {**os.environ, "PYTHONPATH": str(ROOT)}
        if options.generator:
            variables["CMAKE_GENERATOR"] = options.generator
        argv = (sys.executable, "-m", "forge", "build", "--jobs", str(options.jobs))
        with (root / "out").open("w") as out:
            process = subprocess.Popen(argv, cwd=root, env=variables, stdout=out, stderr=out)
            watch = Watch(process.pid)
            while process.poll() is None:
                watch.look()
                time.sleep(0.02)
        if process.returncode:
            print((root / "out").read_text(), file=sys.stderr)
            return process.returncode
        print(json.dumps(_findings(watch, options.jobs), indent=2))
    return 0


def _findings(watch: Watch, jobs: int) -> dict[str, object]:
    """Return the share of the budget in use until the last time that all jobs were compilers.

    On a machine that others use too, processors cannot be full; there jobs count that were ready to run.
    """
    full = max(index for index, (_, _, compilers, _) in enumerate(watch.seen) if compilers == jobs)
    seconds, used, _, _ = watch.seen[full]
    ready = [min(jobs, ready) for _, _, _, ready in watch.seen[: full + 1]]
    counts = Counter(compilers for _, _, compilers, _ in watch.seen)
    return {
        "jobs": jobs,
        "seconds": round(watch.seen[-1][0], 2),
        "processors in use until the last chain": round(used / seconds / jobs, 3),
        "jobs ready to run until then": round(sum(ready) / len(ready) / jobs, 3),
        "seconds until then": round(seconds, 2),
        "compilers at a time": {str(number): counts[number] for number in sorted(counts)},
        "load": os.getloadavg()[0],
    }


def _write_workspace(root: Path, packages: int, files: int) -> None:
    """Write packages of which every third needs the one three before it."""
    for number in range(packages):
        name = f"heavy_{number:02}"
        needs = f"<depend>heavy_{number - 3:02}</depend>" if number % 3 == 0 and number else ""
        sources = [f"part_{number}_{part}" for part in range(files)]
        folder = root / "src" / name
        folder.mkdir(parents=True)
        (folder / "package.xml").write_text(manifest_text(name, needs, build_type="cmake"))
        listed = " ".join(f"{source}.cpp" for source in sources)
        (folder / "CMakeLists.txt").write_text(CMAKE.format(name=name, sources=listed))
        for source in sources:
            (folder / f"{source}.cpp").write_text(SOURCE.format(name=source))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.occupancy", description=__doc__)
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--packages", type=int, default=9)
    parser.add_argument("--files", type=int, default=4)
    parser.add_argument("--generator", help="CMake's, such as 'Unix Makefiles'")
    return parser


if __name__ == "__main__":
    sys.exit(main())
