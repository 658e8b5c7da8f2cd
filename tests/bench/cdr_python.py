"""Measure Python's wire format beside rosbags, in turns, in one process; print JSON.

python -m tests.bench.cdr_python [--runs N]

Each figure is the median time for one message, in microseconds; each case has messages whose strings
differ in length. Both sides read `bytes`. Nothing is asserted.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import subprocess
import sys
import tempfile
import time
from collections import deque
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from itertools import repeat
from pathlib import Path
from statistics import geometric_mean, median
from typing import TYPE_CHECKING, Any

from tests.generated import RUNTIME, generate_embedded, importable

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

PACKAGES = ("std_msgs", "sensor_msgs", "geometry_msgs", "nav_msgs")
LENGTHS = (3, 9, 4, 17, 8, 31, 12, 5)
"""How long the strings of a case's messages are."""

LOOP_SECONDS = 0.005
MEGABYTE = 1_000_000


@dataclass(frozen=True, slots=True)
class Case:
    """A type, and messages of it that differ in their strings."""

    name: str
    type: type
    messages: Sequence[Any]


def cases() -> list[Case]:
    """Return what is measured: small, nested, repeated and large messages."""
    std, sensor, geometry, nav = (import_module(f"{package}.msg") for package in PACKAGES)
    words = ["frame_id_" * 4] * len(LENGTHS)
    words = [word[:length] for word, length in zip(words, LENGTHS, strict=True)]

    def pose(word: str) -> Any:  # noqa: ANN401  (classes that were generated a moment ago)
        message = geometry.PoseStamped(header=_header(std, word))
        message.pose.position.x, message.pose.position.y = 1.5, -2.5
        return message

    def field(name: str, offset: int) -> Any:  # noqa: ANN401
        return sensor.PointField(name=name, offset=offset, datatype=7, count=1)

    makers: Mapping[str, tuple[type, Callable[[str], Any]]] = {
        "String": (std.String, lambda word: std.String(data=word)),
        "Imu": (sensor.Imu, lambda word: sensor.Imu(header=_header(std, word))),
        "PoseStamped": (geometry.PoseStamped, pose),
        "Path of 100": (nav.Path, lambda word: nav.Path(header=_header(std, word), poses=[pose(word)] * 100)),
        "LaserScan 720": (
            sensor.LaserScan,
            lambda word: sensor.LaserScan(header=_header(std, word), ranges=[math.pi] * 720, intensities=[]),
        ),
        "PointCloud2 1 MB": (
            sensor.PointCloud2,
            lambda word: sensor.PointCloud2(
                header=_header(std, word),
                width=MEGABYTE // 16,
                height=1,
                fields=[field(name, 4 * index) for index, name in enumerate(("x", "y", "z", "intensity"))],
                data=bytes(MEGABYTE),
            ),
        ),
        "Image 1 MB": (
            sensor.Image,
            lambda word: sensor.Image(header=_header(std, word), encoding="rgb8", data=bytes(MEGABYTE)),
        ),
    }
    return [Case(name, type_, [make(word) for word in words]) for name, (type_, make) in makers.items()]


def _header(std: Any, word: str) -> Any:  # noqa: ANN401
    header = std.Header(frame_id=word)
    header.stamp.sec, header.stamp.nanosec = 1_700_000_000, 123_456_789
    return header


@dataclass(frozen=True, slots=True)
class Variant:
    """A function, what it is called with in turn, and what comes second and third in each call."""

    function: Callable[..., object]
    given: Sequence[Any]
    more: tuple[Any, ...] = ()

    def time(self, times: int) -> float:
        """Return the seconds that one call takes, when all are made that many times."""
        calls = map(self.function, [*self.given] * times, *map(repeat, self.more))
        start = time.perf_counter()
        deque(calls, maxlen=0)
        return (time.perf_counter() - start) / (times * len(self.given))


def variants(case: Case) -> dict[str, Variant]:
    """Return what runs in turns for a case."""
    from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415  (only this program needs it)

    forge_cdr: Any = import_module("forge_cdr")
    store = get_typestore(Stores.ROS2_HUMBLE)
    package, kind, _ = case.type.__module__.split(".")
    name = f"{package}/{kind}/{case.type.__name__}"
    data = [forge_cdr.serialize(message) for message in case.messages]
    peers = [store.deserialize_cdr(each, name) for each in data]
    if [bytes(store.serialize_cdr(peer, name)) for peer in peers] != data:
        raise SystemExit(f"{name}: the two sides write different bytes")
    return {
        "rosbags write": Variant(store.serialize_cdr, peers, (name,)),
        "forge write": Variant(forge_cdr.serialize, case.messages),
        "rosbags read": Variant(store.deserialize_cdr, data, (name,)),
        "forge read": Variant(forge_cdr.deserialize, data, (case.type,)),
        "forge read lazily": Variant(forge_cdr.deserialize, data, (case.type, False)),
    }


def measure(case: Case, runs: int) -> dict[str, float]:
    """Return the median microseconds of each variant for one message."""
    chosen = variants(case)
    once = {name: min(variant.time(1) for _ in range(3)) for name, variant in chosen.items()}
    seconds: dict[str, list[float]] = {name: [] for name in chosen}
    for _ in range(runs):
        for name, variant in chosen.items():
            seconds[name].append(variant.time(max(1, int(LOOP_SECONDS / once[name] / len(variant.given)))))
    return {name: round(1e6 * median(taken), 3) for name, taken in seconds.items()}


def importing(folder: Path, runs: int) -> dict[str, float]:
    """Return the median milliseconds of importing sensor_msgs.msg, and all in it, beyond numpy's."""
    code = "import time, numpy; t = time.perf_counter(); {}; print(time.perf_counter() - t)"
    everything = "from sensor_msgs.msg import *"
    variables = {"PYTHONPATH": f"{folder}:{RUNTIME}"}
    taken: dict[str, list[float]] = {"import sensor_msgs.msg": [], everything: []}
    for _ in range(runs):
        for statement, seconds in taken.items():
            argv = [sys.executable, "-c", code.format(statement)]
            ran = subprocess.run(argv, env=variables, check=True, capture_output=True, text=True)
            seconds.append(float(ran.stdout))
    return {statement: round(1000 * median(seconds), 1) for statement, seconds in taken.items()}


def main() -> int:
    """Measure all cases and print one JSON document."""
    parser = argparse.ArgumentParser(description="Measure the wire format in Python beside rosbags.")
    parser.add_argument("--runs", type=int, default=11, help="how often each variant runs (default: 11)")
    runs = parser.parse_args().runs
    with tempfile.TemporaryDirectory(prefix="forge-bench-") as name:
        folder = Path(name)
        generate_embedded(folder)
        with importable(folder):
            figures = {case.name: measure(case, runs) for case in cases()}
        imports = importing(folder, runs)
    peers = {"python": platform.python_version(), "numpy": version("numpy"), "rosbags": version("rosbags")}
    means = {
        f"{mine} against {theirs}": round(geometric_mean([f[theirs] / f[mine] for f in figures.values()]), 2)
        for mine, theirs in (
            ("forge write", "rosbags write"),
            ("forge read", "rosbags read"),
            ("forge read lazily", "rosbags read"),
        )
    }
    report = {"on": peers, "runs": runs, "microseconds": figures, "geometric_means": means}
    print(json.dumps({**report, "import_milliseconds": imports}, indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main())
