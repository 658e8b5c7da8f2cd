"""Where the time of the slowest scenarios goes: `python -m tests.bench.profiles --output FILE`.

Of a build from nothing, which programs work and what forge itself does meanwhile; of a build of nothing and
of the compiler of interfaces, what forge itself does. forge is looked at by cProfile, which makes it some two
times slower and calls dearer than they are; programs are looked at in /proc.
"""

import argparse
import json
import os
import pstats
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from tests.bench.builds import ANEW, PLAIN, ament
from tests.bench.commands import QUIET, forge_build
from tests.bench.definitions import write_definitions
from tests.bench.figures import as_json, from_json
from tests.bench.machine import described
from tests.bench.peers import find_peers
from tests.bench.sitting import Sitting, run
from tests.bench.trees import below

WORDS = """\
The longest scenario is the build from nothing. The first table shows the processor time of each program in
it, the second the functions of forge itself. The other tables profile the two scenarios in which forge does
all of the work. Paths, lines and names are those of the commit below each heading.

The profiles led to one change: a tenth of the time for 1,000 messages was spent on reading the names of the
whole package twice for each message; they are collected once now. The time of a build with nothing changed
is spread over manifests, sources and state files, with no function above a few per cent."""

_MOST = 12
_TICK = os.sysconf("SC_CLK_TCK")
_CHECKOUT = Path(__file__).parents[2]


def profiles(sitting: Sitting) -> dict[str, Any]:
    """Return all profiles by their titles."""
    kind, size, large = ament(sitting), sitting.size(100), sitting.size(1000)
    cold = kind.tool(sitting, "forge", forge_build(), size)
    programs = _programs(cold.argv, cold.cwd, cold.env)
    run(ANEW, cold.cwd)
    build, merged = (*QUIET, "build"), (*QUIET, "build", "--merge-install")
    nothing = PLAIN.built(sitting, "forge", forge_build("--merge-install"), large)
    definitions = write_definitions(sitting.new_folder("profiled") / "bench_msgs", large)
    words = ("interface", "generate", "--package", "bench_msgs", "--lang", "python", "--lang", "cpp")
    generate = (*words, "--output", "profiled", str(definitions))
    return {
        f"Build of {size} packages from nothing: programs": programs,
        f"Build of {size} packages from nothing: forge itself": _functions(build, cold.cwd, cold.env),
        f"Build with nothing changed in {large:,} packages": _functions(merged, nothing.cwd, {}),
        f"{large:,} messages to Python and C++": _functions(generate, definitions.parent, {}),
    }


def _programs(argv: Sequence[str], cwd: Path, variables: Mapping[str, str]) -> dict[str, Any]:
    """Run a command line and return the seconds that each program of its tree worked."""
    worked: dict[int, tuple[str, float]] = {}
    start = time.monotonic()
    process = subprocess.Popen(
        argv, cwd=cwd, env={**os.environ, **variables}, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL
    )
    while process.poll() is None:
        worked.update(_worked(process.pid))
        time.sleep(0.002)
    taken = time.monotonic() - start
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, argv)
    by_name: dict[str, float] = {}
    for name, seconds in worked.values():
        by_name[name] = by_name.get(name, 0.0) + seconds
    total = sum(by_name.values())
    jobs = len(os.sched_getaffinity(0))
    words = (
        f"{taken:.1f} s elapsed, {total:.1f} s of processor time on {jobs} processors, sampled every few "
        "milliseconds; processes that ended between two samples are missing."
    )
    return {"words": words, "rows": _rows(by_name, total)}


def _worked(root: int) -> dict[int, tuple[str, float]]:
    """Return the name of each process of a tree, and the seconds that it has worked itself."""
    found = {}
    for number in below(root):
        try:
            text = Path(f"/proc/{number}/stat").read_text(errors="replace")
        except OSError:
            continue
        name, _, rest = text.partition("(")[2].rpartition(")")
        words = rest.split()
        found[number] = (name, (int(words[11]) + int(words[12])) / _TICK)
    return found


def _functions(words: Sequence[str], cwd: Path, variables: Mapping[str, str]) -> dict[str, Any]:
    """Run forge under cProfile and return the functions in which it spends most time themselves."""
    output = cwd / "profile"
    argv = (sys.executable, "-m", "cProfile", "-o", str(output), "-m", "forge", *words)
    environment = {**os.environ, **variables}
    run(argv, cwd, environment)
    table: Any = pstats.Stats(str(output))
    output.unlink()
    own: dict[str, float] = {}
    for (path, line, name), (_, _, seconds, _, _) in table.stats.items():
        place = _place(path, line, name)
        own[place] = own.get(place, 0.0) + seconds
    total = sum(own.values())
    return {
        "words": f"{total:.2f} s under cProfile, including time spent waiting.",
        "rows": _rows(own, total),
    }


def _place(path: str, line: int, name: str) -> str:
    """Return a function as a reader finds it, the same on every machine."""
    if path == "~":
        return f"`{name.strip('<>')}`"
    for beginning in (f"{_CHECKOUT}/", f"{sys.prefix}/", f"{sys.base_prefix}/"):
        path = path.removeprefix(beginning)
    return f"`{path.rpartition('site-packages/')[2]}:{line} {name}`"


def _rows(seconds: Mapping[str, float], total: float) -> list[dict[str, str]]:
    most = sorted(seconds.items(), key=lambda item: -item[1])[:_MOST]
    return [
        {
            "seconds": f"{taken:.3f}",
            "share": f"{100 * taken / total:.0f} %",
            "function": name.replace("|", "\\|"),
        }
        for name, taken in most
    ]


def main(argv: Sequence[str] | None = None) -> int:
    """Look, and put what was seen into a file of results."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench.profiles", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="tiny sizes, to see that it runs")
    parser.add_argument("--output", type=Path, required=True, metavar="FILE", help="the bench's results")
    options = parser.parse_args(argv)
    results = from_json(json.loads(options.output.read_text(encoding="utf-8")))
    with tempfile.TemporaryDirectory(prefix="forge-bench-") as folder:
        seen = profiles(Sitting(Path(folder).resolve(), find_peers(), options.quick))
    forge = described()["forge"]
    found = {title: {"forge": forge, **profile} for title, profile in seen.items()}
    text = json.dumps(as_json(replace(results, profiles=found)), indent=1)
    options.output.write_text(f"{text}\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
