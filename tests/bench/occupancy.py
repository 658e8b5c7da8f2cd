"""How full a cold build of compile-heavy packages keeps its jobs."""

import os
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from tests.bench.commands import forge
from tests.bench.figures import Case, Series
from tests.bench.sitting import Sitting
from tests.packages import manifest_text

GENERATORS = {"Ninja": {}, "Makefiles": {"CMAKE_GENERATOR": "Unix Makefiles"}}
IN_USE, READY, MOST = "processors in use", "jobs ready to run", "most compilers at a time"
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


def occupancy(sitting: Sitting) -> Iterator[Case]:
    """Measure the share of the budget in use until the last chain of packages."""
    jobs = len(os.sched_getaffinity(0))
    for generator, variables in GENERATORS.items():
        found = [_built(sitting, jobs, variables) for _ in range(sitting.runs(2))]
        most = max(count for _, _, count in found)
        for word, column in ((IN_USE, 0), (READY, 1)):
            series = {"forge": Series(tuple(each[column] for each in found))}
            yield Case(f"{word}, {generator}", series, unit="%", counts={"jobs": jobs, MOST: most})


def _built(sitting: Sitting, jobs: int, variables: dict[str, str]) -> tuple[float, float, int]:
    """Build once and return what was seen; raises CalledProcessError when it fails."""
    root = sitting.new_folder("occupancy")
    _write_workspace(root, sitting.size(9), 1 if sitting.quick else 4)
    argv = forge("build", "--jobs", str(jobs))
    with (root / "out").open("w") as out:
        process = subprocess.Popen(
            argv, cwd=root, env={**os.environ, **variables}, stdin=subprocess.DEVNULL, stdout=out, stderr=out
        )
        watch = Watch(process.pid)
        while process.poll() is None:
            watch.look()
            time.sleep(0.02)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, argv, (root / "out").read_bytes())
    return _findings(watch, jobs)


def _findings(watch: Watch, jobs: int) -> tuple[float, float, int]:
    """Return per cent of the budget in use until the last time that all jobs were compilers, and the most.

    On a machine that others use too, processors cannot be full; there jobs count that were ready to run.
    """
    counts = [compilers for _, _, compilers, _ in watch.seen]
    full = max((index for index, count in enumerate(counts) if count >= jobs), default=len(counts) - 1)
    seconds, used, _, _ = watch.seen[full]
    ready = [min(jobs, ready) for _, _, _, ready in watch.seen[: full + 1]]
    share = 100 / jobs
    return share * used / seconds, share * sum(ready) / len(ready), max(counts)


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
