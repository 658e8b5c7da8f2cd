"""Measure C++'s wire format beside Fast-CDR, in turns, in one process; print JSON.

python -m tests.bench.cdr_cpp [--turns N] [--compiler g++]

Needs a compiler and Fast-CDR (Debian: libfastcdr-dev), which is driven as ROS's type support drives it, both
compiled with -O2. Each figure is the median time for one message, in nanoseconds; each case has messages
whose strings differ in length. Reading is measured into a message that has been used and into a new one.
Nothing is asserted, but both sides must write the same bytes.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from forge.files import write_if_changed
from forge.interfaces import cpp
from forge.interfaces.showing import parse_type_name
from forge.interfaces.sources import EMBEDDED
from tests import fastcdr
from tests.generated import embedded_catalog

if TYPE_CHECKING:
    from forge.interfaces.model import Message, TypeName

PACKAGES = ("builtin_interfaces", "geometry_msgs", "nav_msgs", "sensor_msgs", "std_msgs")
TYPES = (
    "geometry_msgs/msg/Polygon",
    "geometry_msgs/msg/PoseStamped",
    "nav_msgs/msg/Path",
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/Imu",
    "sensor_msgs/msg/JointState",
    "sensor_msgs/msg/LaserScan",
    "sensor_msgs/msg/PointCloud2",
    "std_msgs/msg/String",
)
OPERATIONS = ("write", "read, used", "read, fresh")


def main() -> int:
    """Compile, measure all cases and print one JSON document."""
    parser = argparse.ArgumentParser(description="Measure the wire format in C++ beside Fast-CDR.")
    parser.add_argument("--turns", type=int, default=61, help="how often each variant runs (default: 61)")
    parser.add_argument("--compiler", default="g++", help="default: g++")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="forge-bench-") as folder:
        program = _compiled(Path(folder), options.compiler)
        ran = subprocess.run([program, str(options.turns)], check=True, capture_output=True, text=True)
    figures = json.loads(ran.stdout)
    for case in figures.values():
        for word in OPERATIONS:
            case[f"times faster, {word}"] = round(case[f"Fast-CDR {word}"] / case[f"forge {word}"], 2)
    version = subprocess.run([options.compiler, "--version"], check=True, capture_output=True, text=True)
    report = {"on": version.stdout.splitlines()[0], "turns": options.turns, "nanoseconds": figures}
    print(json.dumps(report, indent=2))
    return 0


def _compiled(folder: Path, compiler: str) -> Path:
    """Generate what is measured and return the program."""
    known: dict[TypeName, Message] = {}
    for catalog in map(embedded_catalog, PACKAGES):
        known.update(catalog.known)
        for file in cpp.files(catalog):
            write_if_changed(folder / file.path, file.text)
    names = [parse_type_name(name) for name in TYPES]
    write_if_changed(folder / "peer.hpp", fastcdr.declarations(names, known))
    write_if_changed(folder / "peer.cpp", fastcdr.definitions(names, known, "peer.hpp"))
    sources = (Path(__file__).parent / "cpp" / "cdr.cpp", folder / "peer.cpp")
    folders = ("-I", folder, "-I", EMBEDDED / "rosidl_default_runtime" / "include")
    program = folder / "bench"
    argv = [compiler, "-std=c++17", "-O2", *folders, *sources, "-o", program, "-lfastcdr"]
    subprocess.run(list(map(str, argv)), check=True)
    return program


if __name__ == "__main__":
    sys.exit(main())
