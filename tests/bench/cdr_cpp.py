"""C++'s wire format beside Fast-CDR, in turns, in one process.

Fast-CDR is driven as ROS's type support drives it, both are compiled with -O2. Each case has messages whose
strings differ in length. Reading is measured into a message that has been used and into a new one.
"""

import json
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

from forge.base.distributions import EMBEDDED
from forge.base.files import write_if_changed
from forge.interfaces.cpp import target as cpp
from forge.interfaces.model import Message, TypeName
from forge.interfaces.show import parse_type_name
from tests import fastcdr
from tests.bench.figures import Case, Series
from tests.bench.sitting import Sitting, printed
from tests.generated import embedded_catalog

FAST_CDR = "Fast-CDR"
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


def cpp_cdr(sitting: Sitting) -> Iterator[Case]:
    """Measure writing and reading of small, nested, repeated and large messages."""
    if not sitting.wants(FAST_CDR):
        return
    folder = sitting.new_folder("cdr_cpp")
    program = _compiled(folder, sitting.peers.fast_cdr)
    libraries = os.pathsep.join(map(str, _libraries(sitting.peers.fast_cdr)))
    turns = 2 if sitting.quick else sitting.runs(61)
    said = printed((str(program), str(turns)), folder, {**os.environ, "LD_LIBRARY_PATH": libraries})
    for message, variants in json.loads(said).items():
        for operation in OPERATIONS:
            sides = {"forge": f"forge {operation}", FAST_CDR: f"{FAST_CDR} {operation}"}
            series = {side: Series(tuple(variants[name])) for side, name in sides.items()}
            yield Case(f"{operation}, {message}", series, unit="ns")


def _libraries(prefix: Path) -> list[Path]:
    return sorted({path.parent for path in (prefix / "lib").rglob("libfastcdr.so")})


def _compiled(folder: Path, prefix: Path) -> Path:
    """Generate what is measured and return the program."""
    known: dict[TypeName, Message] = {}
    for catalog in map(embedded_catalog, PACKAGES):
        known.update(catalog.known)
        for file in cpp.files(catalog):
            write_if_changed(folder / file.path, file.text)
    names = [parse_type_name(name) for name in TYPES]
    write_if_changed(folder / "peer.hpp", fastcdr.declarations(names, known))
    write_if_changed(folder / "peer.cpp", fastcdr.definitions(names, known, "peer.hpp"))
    sources = (Path(__file__).parent / "programs" / "cdr.cpp", folder / "peer.cpp")
    folders = ["-I", folder, "-I", EMBEDDED / "rosidl_default_runtime" / "include"]
    if prefix != Path("/usr"):
        folders += ["-I", prefix / "include", *(f"-L{each}" for each in _libraries(prefix))]
    program = folder / "bench"
    argv = ["g++", "-std=c++17", "-O2", *folders, *sources, "-o", program, "-lfastcdr"]
    subprocess.run(list(map(str, argv)), check=True)
    return program
