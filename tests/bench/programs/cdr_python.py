"""Time Python's wire format beside rosbags and mcap-ros2-support, in turns, in one process: RUNS SCHEMAS.

Run by an interpreter that has the peers, with forge's generated Python on PYTHONPATH. Prints a JSON object:
case, operation, variant, the microseconds for one message in each turn. Each case has messages whose strings
differ in length; all sides read `bytes`, and write the same bytes. SCHEMAS is a JSON file of each type's text
as recordings have it, which mcap-ros2-support reads.
"""

import json
import math
import sys
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from itertools import repeat
from pathlib import Path
from typing import Any

PACKAGES = ("std_msgs", "sensor_msgs", "geometry_msgs", "nav_msgs")
LENGTHS = (3, 9, 4, 17, 8, 31, 12, 5)
"""How long the strings of a case's messages are."""

LOOP_SECONDS = 0.005
MEGABYTE = 1_000_000

WRITE, READ, LAZY = "write", "read", "read lazily"


@dataclass(frozen=True)
class Cases:
    """A type, and messages of it that differ in their strings."""

    name: str
    type: type
    messages: Sequence[Any]


def cases() -> list[Cases]:
    """Return what is measured: small, nested, repeated and large messages."""
    std, sensor, geometry, nav = (import_module(f"{package}.msg") for package in PACKAGES)
    words = [("frame_id_" * 4)[:length] for length in LENGTHS]

    def pose(word: str) -> Any:
        message = geometry.PoseStamped(header=_header(std, word))
        message.pose.position.x, message.pose.position.y = 1.5, -2.5
        return message

    def scan(word: str) -> Any:
        return sensor.LaserScan(header=_header(std, word), ranges=[math.pi] * 720, intensities=[])

    def image(word: str) -> Any:
        return sensor.Image(header=_header(std, word), encoding="rgb8", data=bytes(MEGABYTE))

    makers: Mapping[str, tuple[type, Callable[[str], Any]]] = {
        "String": (std.String, lambda word: std.String(data=word)),
        "Imu": (sensor.Imu, lambda word: sensor.Imu(header=_header(std, word))),
        "PoseStamped": (geometry.PoseStamped, pose),
        "Path of 100": (nav.Path, lambda word: nav.Path(header=_header(std, word), poses=[pose(word)] * 100)),
        "LaserScan 720": (sensor.LaserScan, scan),
        "PointCloud2 1 MB": (sensor.PointCloud2, lambda word: _cloud(sensor, _header(std, word))),
        "Image 1 MB": (sensor.Image, image),
    }
    return [Cases(name, type_, [make(word) for word in words]) for name, (type_, make) in makers.items()]


def _header(std: Any, word: str) -> Any:
    header = std.Header(frame_id=word)
    header.stamp.sec, header.stamp.nanosec = 1_700_000_000, 123_456_789
    return header


def _cloud(sensor: Any, header: Any) -> Any:
    fields = [
        sensor.PointField(name=name, offset=4 * index, datatype=7, count=1)
        for index, name in enumerate(("x", "y", "z", "intensity"))
    ]
    data = bytes(MEGABYTE)
    return sensor.PointCloud2(header=header, width=MEGABYTE // 16, height=1, fields=fields, data=data)


@dataclass(frozen=True)
class Call:
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


def calls(case: Cases, schemas: Mapping[str, str]) -> dict[str, dict[str, Call]]:
    """Return what runs in turns for a case, by operation and variant."""
    forge_cdr: Any = import_module("forge_cdr")
    package, kind, _ = case.type.__module__.split(".")
    name = f"{package}/{kind}/{case.type.__name__}"
    data = [forge_cdr.serialize(message) for message in case.messages]
    found = {
        WRITE: {"forge": Call(forge_cdr.serialize, case.messages)},
        READ: {"forge": Call(forge_cdr.deserialize, data, (case.type,))},
        LAZY: {"forge": Call(forge_cdr.deserialize, data, (case.type, False))},
    }
    if find_spec("rosbags"):
        _add_rosbags(found, name, data)
    if find_spec("mcap_ros2"):
        _add_mcap(found, name, schemas[name], data)
    return found


def _add_rosbags(found: dict[str, dict[str, Call]], name: str, data: list[bytes]) -> None:
    typesys: Any = import_module("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    messages = [store.deserialize_cdr(each, name) for each in data]
    if [bytes(store.serialize_cdr(message, name)) for message in messages] != data:
        raise SystemExit(f"{name}: rosbags writes different bytes")
    found[WRITE]["rosbags"] = Call(store.serialize_cdr, messages, (name,))
    for operation in (READ, LAZY):
        found[operation]["rosbags"] = Call(store.deserialize_cdr, data, (name,))


def _add_mcap(found: dict[str, dict[str, Call]], name: str, schema: str, data: list[bytes]) -> None:
    dynamic: Any = import_module("mcap_ros2._dynamic")
    read = dynamic.generate_dynamic(name, schema)[name]
    write = dynamic.serialize_dynamic(name, schema)[name]
    messages = [read(each) for each in data]
    if [bytes(write(message)) for message in messages] != data:
        raise SystemExit(f"{name}: mcap-ros2-support writes different bytes")
    found[WRITE]["mcap-ros2-support"] = Call(write, messages)
    for operation in (READ, LAZY):
        found[operation]["mcap-ros2-support"] = Call(read, data)


def measure(case: Cases, runs: int, schemas: Mapping[str, str]) -> dict[str, dict[str, list[float]]]:
    """Return the microseconds of each variant of each operation for one message, turn by turn."""
    chosen = [
        (operation, *each)
        for operation, variants in calls(case, schemas).items()
        for each in variants.items()
    ]
    times = [
        max(1, int(LOOP_SECONDS / min(call.time(1) for _ in range(3)) / len(call.given)))
        for *_, call in chosen
    ]
    found: dict[str, dict[str, list[float]]] = {}
    for _ in range(runs):
        for (operation, variant, call), number in zip(chosen, times, strict=True):
            found.setdefault(operation, {}).setdefault(variant, []).append(1e6 * call.time(number))
    return found


def main(runs: str, schemas: str) -> None:
    """Measure all cases and print one JSON document."""
    texts = json.loads(Path(schemas).read_text(encoding="utf-8"))
    print(json.dumps({case.name: measure(case, int(runs), texts) for case in cases()}))


if __name__ == "__main__":
    main(*sys.argv[1:])
