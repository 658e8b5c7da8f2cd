"""Python's wire format beside rosbags and mcap-ros2-support, in turns, in one process."""

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path

from tests.bench.commands import forge
from tests.bench.figures import Case, Series
from tests.bench.sitting import Sitting, printed
from tests.generated import RUNTIME, generate_embedded

PROGRAM = Path(__file__).parent / "programs" / "cdr_python.py"
PEERS = ("rosbags", "mcap-ros2-support")
TYPES = (
    "std_msgs/msg/String",
    "sensor_msgs/msg/Imu",
    "geometry_msgs/msg/PoseStamped",
    "nav_msgs/msg/Path",
    "sensor_msgs/msg/LaserScan",
    "sensor_msgs/msg/PointCloud2",
    "sensor_msgs/msg/Image",
)


def generated(sitting: Sitting) -> Path:
    """Return a folder with the Python of all interfaces that forge brings along."""
    return sitting.made("generated_python", generate_embedded)


def python_cdr(sitting: Sitting) -> Iterator[Case]:
    """Measure writing, reading and lazy reading of small, nested, repeated and large messages."""
    found = [sitting.wants(peer) for peer in PEERS]
    interpreter = sitting.peers.python if any(found) else sys.executable
    folder = sitting.new_folder("cdr_python")
    schemas = folder / "schemas.json"
    texts = {name: printed(forge("interface", "schema", name), folder) for name in TYPES}
    schemas.write_text(json.dumps(texts), encoding="utf-8")
    variables = {**os.environ, "PYTHONPATH": f"{generated(sitting)}:{RUNTIME}"}
    argv = (interpreter, str(PROGRAM), str(sitting.runs(11)), str(schemas))
    figures = json.loads(printed(argv, folder, variables))
    for message, operations in figures.items():
        for operation, variants in operations.items():
            series = {name: Series(tuple(values)) for name, values in variants.items()}
            yield Case(f"{operation}, {message}", series, unit="us")
