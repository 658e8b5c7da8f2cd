"""`python -m tests.bench`: measure forge beside its peers and write JSON.

`python -m tests.bench.page` makes docs/benchmarks.md of what this writes.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path

from tests.bench.figures import Result, Results, as_json, from_json
from tests.bench.machine import described
from tests.bench.peers import DEBIAN, ENVIRONMENT, Peers, find_peers
from tests.bench.scenarios import SCENARIOS
from tests.bench.sitting import Sitting

FOREIGN = ("AMENT_", "CMAKE_", "COLCON_", "FORGE_", "ROS_", "MAKEFLAGS", "CCACHE_")
"""Variables of a shell that has sourced something, or of a make above, which no measurement may see."""


def main(argv: Sequence[str] | None = None) -> int:
    """Measure the chosen scenarios and write one JSON document."""
    options = _parser().parse_args(argv)
    chosen = list(options.only or SCENARIOS)
    if options.list:
        print("\n".join(f"{name:16} {scenario.title}" for name, scenario in SCENARIOS.items()))
        return 0
    _clean_environment()
    peers = find_peers(options.peers, options.debian)
    minutes = sum(SCENARIOS[name].minutes for name in chosen)
    _tell(f"{len(chosen)} scenarios, " + ("quick" if options.quick else f"about {minutes:.0f} minutes"))
    for name, version in peers.told().items():
        _tell(f"  {name}: {version}")
    results = _before(options.output, peers)
    with tempfile.TemporaryDirectory(prefix="forge-bench-") as folder:
        sitting = Sitting(Path(folder).resolve(), peers, options.quick, options.runs)
        for name in chosen:
            measured = _measured(name, sitting)
            results = replace(results, scenarios=_in_order({**results.scenarios, name: measured}))
            if options.output:
                _write(results, options.output)
    if not options.output:
        print(json.dumps(as_json(results), indent=1))
    return 0


def _measured(name: str, sitting: Sitting) -> Result:
    """Measure a scenario; raises CalledProcessError, with what the program said, when one fails."""
    sitting.missing.clear()
    date = datetime.now(timezone.utc).strftime("%Y-%m-%d %H:%M UTC")
    load, start = os.getloadavg()[0], time.monotonic()
    _tell(f"{name}: {SCENARIOS[name].title}")
    try:
        cases = tuple(SCENARIOS[name].measure(sitting))
    except subprocess.CalledProcessError as error:
        _tell(f"failed: {shlex.join(map(str, error.cmd))}\n{_said(error.stdout)}{_said(error.stderr)}")
        raise
    seconds = time.monotonic() - start
    _tell(f"  {seconds:.0f} s")
    return Result(cases, date, seconds, load, sitting.quick, tuple(sitting.missing))


def _said(output: bytes | str | None) -> str:
    return output.decode(errors="replace") if isinstance(output, bytes) else output or ""


def _before(output: Path | None, peers: Peers) -> Results:
    """Return what the file holds already, as measured on this machine and with these peers.

    Its command is the one that began it; each scenario on the page has its own, and its date.
    """
    command = shlex.join(["python", "-m", "tests.bench", *sys.argv[1:]])
    fresh = Results(described(), peers.told(), command, {})
    if output is None or not output.is_file():
        return fresh
    known = from_json(json.loads(output.read_text(encoding="utf-8")))
    command = known.command if known.scenarios else fresh.command
    return replace(fresh, command=command, scenarios=known.scenarios, profiles=known.profiles)


def _write(results: Results, output: Path) -> None:
    """Write what there is so far: a run that is interrupted has not been for nothing."""
    output.write_text(json.dumps(as_json(results), indent=1) + "\n", encoding="utf-8")


def _in_order(scenarios: Mapping[str, Result]) -> dict[str, Result]:
    return {name: scenarios[name] for name in SCENARIOS if name in scenarios}


def _clean_environment() -> None:
    """Forget what this shell has sourced; find the tools of this interpreter's environment last."""
    for name in [name for name in os.environ if name.startswith(FOREIGN)]:
        del os.environ[name]
    os.environ["PATH"] = os.pathsep.join(
        (os.environ.get("PATH", os.defpath), str(Path(sys.executable).parent))
    )


def _tell(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description="Measure forge; write JSON.")
    parser.add_argument("--only", action="append", choices=SCENARIOS, help="a scenario; may be repeated")
    parser.add_argument("--list", action="store_true", help="print the scenarios and measure nothing")
    parser.add_argument("--quick", action="store_true", help="one turn and tiny sizes, to see that all runs")
    parser.add_argument("--runs", type=int, help="how many turns each case has, instead of its own number")
    parser.add_argument(
        "--output",
        type=Path,
        metavar="FILE",
        help="the file to write; scenarios that it has and --only leaves stay",
    )
    parser.add_argument(
        "--peers", type=Path, default=ENVIRONMENT, metavar="FOLDER", help="virtual environment of the peers"
    )
    parser.add_argument(
        "--debian", type=Path, default=DEBIAN, metavar="FOLDER", help="prefix of Debian's ament and rosidl"
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
