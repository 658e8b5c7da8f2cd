"""What it costs to compile generated headers beside rosidl's own, in turns.

Debian's rosidl generates headers from the same definitions. Each figure is the processor time of a compiler's
run. A unit that writes ROS's bytes has no peer: rosidl's headers leave that to a library.
"""

import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from forge.base.distributions import EMBEDDED
from forge.base.files import write_if_changed
from forge.interfaces.cpp import target as cpp
from forge.interfaces.cpp.headers import main_path
from tests.bench.figures import Case, Series
from tests.bench.generation import DEBIAN_PYTHON, ROSIDL, ROSIDL_PROGRAM, rosidl_variables
from tests.bench.sitting import Sitting
from tests.bench.timing import Variant
from tests.generated import embedded_catalog

PACKAGES = ("std_msgs", "geometry_msgs", "sensor_msgs", "nav_msgs")
NEEDED = ("builtin_interfaces", *PACKAGES)
UNITS: Mapping[str, tuple[str, ...] | None] = {
    "all headers, included": None,
    "PointCloud2 and Path, included": ("sensor_msgs/msg/point_cloud2.hpp", "nav_msgs/msg/path.hpp"),
}
"""What a unit includes; None stands for the headers of all 92 messages of the packages."""

USE = """
std::size_t use()
{
  nav_msgs::msg::Path path;
  path.poses.resize(2);
  sensor_msgs::msg::PointCloud2 cloud;
  cloud.set__height(1).set__width(2);
  return path.poses.size() + cloud.height;
}
"""
CODEC = """
#include "forge_cdr/forge_cdr.hpp"
std::vector<std::uint8_t> to_bytes(const nav_msgs::msg::Path & path) { return forge_cdr::serialize(path); }
void from_bytes(const std::vector<std::uint8_t> & data, sensor_msgs::msg::PointCloud2 & cloud)
{
  forge_cdr::deserialize(data, cloud);
}
"""


def compile_cost(sitting: Sitting) -> Iterator[Case]:
    """Measure units that include generated headers."""
    folder = sitting.new_folder("compile_cost")
    includes = {"forge": _forge(folder / "forge")}
    if sitting.wants(ROSIDL):
        includes[ROSIDL] = _rosidl(folder / "rosidl", sitting.peers.debian)
    for number, (unit, text, level) in enumerate(_units()):
        source = folder / f"{number}.cpp"
        source.write_text(text, encoding="utf-8")
        variants = [
            Variant(side, _compiler(source, level, folders), folder)
            for side, folders in includes.items()
            if side == "forge" or "forge_cdr" not in text
        ]
        case = sitting.turns_of(unit, variants, 5)
        worked = {name: Series(each.worked, (), each.peak_mb) for name, each in case.series.items()}
        yield replace(case, series=worked)


def _compiler(source: Path, level: str, folders: tuple[str, ...]) -> tuple[str, ...]:
    flags = (word for each in folders for word in ("-I", each))
    return ("g++", "-std=c++17", level, *flags, "-c", str(source), "-o", f"{source}.o")


def _forge(folder: Path) -> tuple[str, ...]:
    """Generate forge's headers and return the include folders."""
    for catalog in map(embedded_catalog, NEEDED):
        for file in cpp.files(catalog):
            write_if_changed(folder / file.path, file.text)
    return str(folder), str(EMBEDDED / "rosidl_default_runtime" / "include")


def _rosidl(folder: Path, prefix: Path) -> tuple[str, ...]:
    """Let rosidl generate its headers and return the include folders."""
    folder.mkdir()
    argv = [DEBIAN_PYTHON, str(ROSIDL_PROGRAM), str(prefix), str(EMBEDDED), str(folder), *NEEDED]
    subprocess.run(argv, check=True, env=rosidl_variables(prefix), stdout=subprocess.DEVNULL)
    own = (path for path in (prefix / "include").iterdir() if path.name.startswith(("ros", "rcutils")))
    return str(folder / "cpp"), *map(str, sorted(own))


def _units() -> list[tuple[str, str, str]]:
    """Return the name of each unit, its text, and how much the compiler is to optimize."""
    catalogs = map(embedded_catalog, PACKAGES)
    every = [main_path(name, "hpp") for each in catalogs for name in each.interfaces if name.kind == "msg"]
    units = []
    for unit, headers in UNITS.items():
        text = "".join(f"#include <{header}>\n" for header in headers or every)
        units.append((unit, text, "-O0"))
        if unit.startswith("PointCloud2"):
            units.append(("PointCloud2 and Path, used", text + USE, "-O2"))
            units.append(("PointCloud2 and Path, used, to bytes and back", text + USE + CODEC, "-O2"))
    return units
