"""`python -m tests.bench.messages`: measure generated Python, importing and constructing, and print JSON.

Constructing is compared with plain classes whose properties check (tests/bench/plain.py), importing with an
interpreter that imports numpy and nothing else. Variants run in turn, A B A B; figures are medians.
"""

from __future__ import annotations

import argparse
import json
import platform
import sys
import tempfile
import timeit
from compileall import compile_dir
from importlib import import_module
from math import prod
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

from forge import __version__
from forge.cli import main as forge
from forge.interfaces.resolution import messages_below
from forge.interfaces.showing import parse_type_name
from forge.interfaces.sources import Library
from tests.bench.plain import plain_class
from tests.bench.timing import Variant, compare

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

IMPORTS = {
    "numpy": "",
    "sensor_msgs.msg": "import sensor_msgs.msg",
    "Image, Imu, PointCloud2": "from sensor_msgs.msg import Image, Imu, PointCloud2",
    "all of sensor_msgs": "from sensor_msgs.msg import *",
}
"""What is imported after numpy."""

MESSAGES: Mapping[str, Mapping[str, Any]] = {
    "std_msgs/msg/String": {"data": "hello"},
    "std_msgs/msg/Header": {"frame_id": "map"},
    "geometry_msgs/msg/Point": {"x": 1.0, "y": 2.0, "z": 3.0},
    "geometry_msgs/msg/PoseStamped": {},
    "geometry_msgs/msg/TransformStamped": {"child_frame_id": "base_link"},
    "sensor_msgs/msg/Imu": {},
    "sensor_msgs/msg/Image": {"height": 1, "width": 4, "encoding": "mono8", "step": 4, "data": b"1234"},
    "sensor_msgs/msg/JointState": {"name": ["a", "b"], "position": [0.0, 1.0]},
    "sensor_msgs/msg/LaserScan": {"ranges": [1.0] * 360},
    "nav_msgs/msg/Odometry": {},
}
"""The messages to construct, with keywords for a second measurement."""


def main() -> int:
    """Measure and print one JSON document."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench.messages", description=__doc__)
    parser.add_argument("--runs", type=int, default=11, help="how often each variant runs (default: 11)")
    runs: int = parser.parse_args().runs
    with tempfile.TemporaryDirectory(prefix="forge-bench-") as folder:
        generated = _generate(Path(folder))
        imports = _imports(generated, runs)
        sys.path.insert(0, str(generated))
        constructing = {
            f"{name} {_shown(words)}": _construct(name, words, runs)
            for name, given in MESSAGES.items()
            for words in ({}, given)[: 1 + bool(given)]
        }
    ratios = [float(figures["times_faster"]) for figures in constructing.values()]
    mean = round(prod(ratios) ** (1 / len(ratios)), 2)
    machine = {"python": platform.python_version(), "machine": platform.machine(), "forge": __version__}
    results = {"import": imports, "construct": constructing, "construct_geometric_mean": mean}
    print(json.dumps({"on": machine, "runs": runs, **results}, indent=2))
    return 0


def _generate(out: Path) -> Path:
    """Generate the Python of what is measured and return the folder to import it from."""
    library = Library()
    for package in sorted({name.partition("/")[0] for name in MESSAGES}):
        words = ("--package", package, "--output", str(out), "--lang", "python", str(library.folder(package)))
        if forge(("interface", "generate", *words)):
            raise SystemExit(1)
    compile_dir(out, quiet=1)  # as after a first import, even where Python is told to write no bytecode
    return out / "python"


def _imports(generated: Path, runs: int) -> dict[str, object]:
    """Return the milliseconds that each import takes beyond numpy's own."""
    start = f"import sys; sys.path.insert(0, {str(generated)!r}); import numpy\n"
    variants = [
        Variant(name, (sys.executable, "-c", start + code), generated) for name, code in IMPORTS.items()
    ]
    timings = compare(variants, runs)
    numpy = median(timings[0].seconds)
    beyond = {timing.name: round(1000 * (median(timing.seconds) - numpy), 1) for timing in timings[1:]}
    return {"numpy_ms": round(1000 * numpy, 1), "beyond_numpy_ms": beyond}


def _construct(name: str, words: Mapping[str, Any], runs: int) -> dict[str, float]:
    """Return the microseconds of a construction by the generated and by the plain class."""
    utilities: Any = import_module("rosidl_runtime_py.utilities")  # generated a moment ago
    type_name, library = parse_type_name(name), Library()
    parsed = library.find(type_name)
    assert parsed
    known = messages_below(parsed, library)
    variants = {"generated": utilities.get_message(name), "plain": plain_class(known[type_name], known)}
    seconds = _in_turn(variants, words, runs)
    figures = {f"{variant}_us": round(1e6 * taken, 3) for variant, taken in seconds.items()}
    return {**figures, "times_faster": round(seconds["plain"] / seconds["generated"], 2)}


def _in_turn(
    variants: Mapping[str, Callable[..., object]], words: Mapping[str, Any], runs: int
) -> dict[str, float]:
    """Return the median seconds of one call of each variant."""
    written = f"call({', '.join(f'{word}={word}' for word in words)})"
    timers = {name: timeit.Timer(written, globals={**words, "call": call}) for name, call in variants.items()}
    number = max(10, timers["plain"].autorange()[0] // 10)
    taken: dict[str, list[float]] = {name: [] for name in variants}
    for _ in range(runs):
        for name, timer in timers.items():
            taken[name].append(timer.timeit(number) / number)
    return {name: median(seconds) for name, seconds in taken.items()}


def _shown(words: Mapping[str, Any]) -> str:
    return f"({', '.join(words)})"


if __name__ == "__main__":
    sys.exit(main())
