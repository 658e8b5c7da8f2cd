"""Generated Python: importing, and constructing messages, from numpy arrays, too.

Importing is compared with an interpreter that imports numpy and nothing else, and with what rosbags takes to
make its types; constructing with plain classes whose properties check (tests/bench/plain.py).
"""

import sys
import timeit
from collections.abc import Callable, Iterator, Mapping
from compileall import compile_dir
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy

from forge.interfaces.read.sources import Library
from forge.interfaces.resolve.resolution import nested_messages
from forge.interfaces.show import parse_type_name
from tests.bench.cdr_python import generated
from tests.bench.figures import Case, Series
from tests.bench.plain import plain_class
from tests.bench.sitting import Sitting
from tests.bench.timing import Variant
from tests.generated import RUNTIME, importable

NUMPY = "numpy alone"
PLAIN = "plain classes"
_ROSBAGS = "from rosbags.typesys import Stores, get_typestore; get_typestore(Stores.ROS2_HUMBLE)"
IMPORTS = {
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

ARRAYS = (
    ("sensor_msgs/msg/Image", "data", "uint8", 4_000_000),
    ("sensor_msgs/msg/LaserScan", "ranges", "float32", 1_000_000),
    ("sensor_msgs/msg/Imu", "orientation_covariance", "float64", 9),
)
"""The messages to construct from an array: field, type and number of the elements; the last size is fixed."""


def importing(sitting: Sitting) -> Iterator[Case]:
    """Measure an interpreter that imports, numpy's own time included."""
    folder = generated(sitting)
    compile_dir(folder, quiet=1)  # as after a first import, even where Python is told to write no bytecode
    with_rosbags = sitting.wants("rosbags")
    interpreter = sitting.peers.python if with_rosbags else sys.executable
    for name, statement in IMPORTS.items():
        variants = [
            _importing("forge", interpreter, statement, folder),
            _importing(NUMPY, interpreter, "", folder),
        ]
        if with_rosbags:
            variants.append(_importing("rosbags", interpreter, _ROSBAGS, folder))
        yield sitting.turns_of(name, variants, 21)


def _importing(name: str, interpreter: str, statement: str, folder: Path) -> Variant:
    variables = {"PYTHONPATH": f"{folder}:{RUNTIME}"}
    return Variant(name, (interpreter, "-c", f"import numpy\n{statement}"), folder, env=variables)


def constructing(sitting: Sitting) -> Iterator[Case]:
    """Measure the construction of messages, by default values and with keywords."""
    with importable(generated(sitting)):
        for name, given in MESSAGES.items():
            for words in ({}, given)[: 1 + bool(given)]:
                yield _construct(name, words, sitting.runs(11))


def from_numpy(sitting: Sitting) -> Iterator[Case]:
    """Measure the construction of messages from numpy arrays, which are copied."""
    with importable(generated(sitting)):
        for name, field, dtype, full in ARRAYS:
            words = {field: numpy.zeros(full, dtype)}
            case = _construct(name, words, sitting.runs(3))
            yield replace(case, name=f"{case.name}: {full:,} of {dtype}")


def _construct(name: str, words: Mapping[str, Any], runs: int) -> Case:
    """Return the microseconds of a construction by the generated and by the plain class."""
    utilities: Any = import_module("rosidl_runtime_py.utilities")  # generated a moment ago
    type_name, library = parse_type_name(name), Library()
    parsed = library.find(type_name)
    assert parsed
    known = nested_messages(parsed, library)
    variants = {"forge": utilities.get_message(name), PLAIN: plain_class(known[type_name], known)}
    shown = f"{type_name.name}({', '.join(words)})"
    return Case(shown, _in_turn(variants, words, runs), unit="us")


def _in_turn(
    variants: Mapping[str, Callable[..., object]], words: Mapping[str, Any], runs: int
) -> dict[str, Series]:
    """Return the microseconds of one call of each variant."""
    written = f"call({', '.join(f'{word}={word}' for word in words)})"
    timers = {name: timeit.Timer(written, globals={**words, "call": call}) for name, call in variants.items()}
    number = 1 if runs == 1 else max(10, timers[PLAIN].autorange()[0] // 10)
    taken: dict[str, list[float]] = {name: [] for name in variants}
    for _ in range(runs):
        for name, timer in timers.items():
            taken[name].append(1e6 * timer.timeit(number) / number)
    return {name: Series(tuple(values)) for name, values in taken.items()}
