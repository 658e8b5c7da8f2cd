"""`python -m tests.bench`: measure forge and print JSON."""

from __future__ import annotations

import argparse
import json
import platform
import sys
import tempfile
from pathlib import Path

from forge import __version__
from tests.bench.scenarios import SCENARIOS, Peers
from tests.bench.timing import compare


def main() -> int:
    """Run the chosen scenarios and print one JSON document."""
    options = _parser().parse_args()
    results = {}
    for name in options.only or SCENARIOS:
        with tempfile.TemporaryDirectory(prefix="forge-bench-") as folder:
            variants = SCENARIOS[name](Path(folder), Peers(colcon=options.colcon))
            timings = compare(variants, options.runs)
        results[name] = {timing.name: timing.as_json() for timing in timings}
    machine = {"python": platform.python_version(), "machine": platform.machine(), "forge": __version__}
    print(json.dumps({"on": machine, "runs": options.runs, "scenarios": results}, indent=2))
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description="Measure forge; print JSON.")
    parser.add_argument("--only", action="append", choices=SCENARIOS, help="a scenario; may be repeated")
    parser.add_argument("--runs", type=int, default=11, help="how often each command line runs (default: 11)")
    parser.add_argument("--colcon", metavar="PATH", help="a colcon to measure beside forge")
    return parser


if __name__ == "__main__":
    sys.exit(main())
