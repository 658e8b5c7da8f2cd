"""Measure what it costs to compile generated headers beside rosidl's own, in turns; print JSON.

python -m tests.bench.compile_cost [--runs N] [--rosidl PREFIX] [--compiler g++]

Without a PREFIX (/usr, where Debian's rosidl-generator-c-cpp is installed) forge's headers are measured
alone. With one, rosidl generates headers from the same definitions, by the Python that it was installed
for. Each figure is the median processor time of a compiler's run, in milliseconds. Nothing is asserted.

Debian's packages need not be installed: dpkg -x unpacks them and what they depend on (rosidl-cmake,
python3-rosidl, librosidl-runtime-c-cpp-dev, librosidl-typesupport-interface-dev, librcutils-dev,
python3-empy, python3-lark) into a folder; its usr is the PREFIX.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

from forge.files import write_if_changed
from forge.interfaces import cpp
from forge.interfaces.headers import main_path
from forge.interfaces.sources import EMBEDDED
from tests.generated import embedded_catalog

if TYPE_CHECKING:
    from collections.abc import Mapping

PACKAGES = ("std_msgs", "geometry_msgs", "sensor_msgs", "nav_msgs")
NEEDED = ("builtin_interfaces", *PACKAGES)
UNITS = {
    "92 headers, included": None,
    "PointCloud2 and Path, included": ("sensor_msgs/msg/point_cloud2.hpp", "nav_msgs/msg/path.hpp"),
    "standard library only": ("array", "cstdint", "memory", "string", "vector"),
}
"""What a unit includes; None stands for the headers of all messages of the packages."""

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
_GENERATOR = """
import json, pathlib, sys
prefix, definitions, out, *packages = sys.argv[1:]
sys.path.insert(0, prefix + "/lib/python3/dist-packages")
from rosidl_adapter.msg import convert_msg_to_idl
from rosidl_generator_cpp import generate_cpp
for package in packages:
    source, idl = pathlib.Path(definitions) / package, pathlib.Path(out) / "idl" / package
    names = sorted(path.name for path in (source / "msg").glob("*.msg"))
    for name in names:
        convert_msg_to_idl(source, package, pathlib.Path("msg") / name, idl / "msg")
    arguments = {
        "package_name": package,
        "output_dir": f"{out}/cpp/{package}",
        "template_dir": f"{prefix}/share/rosidl_generator_cpp/resource",
        "idl_tuples": [f"{idl}:msg/{name[:-4]}.idl" for name in names],
        "ros_interface_dependencies": [],
        "target_dependencies": [],
    }
    (pathlib.Path(out) / "cpp" / package).mkdir(parents=True)
    path = pathlib.Path(out) / f"{package}.json"
    path.write_text(json.dumps(arguments))
    generate_cpp(str(path))
"""


def main() -> int:
    """Generate, compile in turns and print one JSON document."""
    parser = argparse.ArgumentParser(description="Measure the compile time of generated headers.")
    parser.add_argument("--runs", type=int, default=5, help="how often each unit is compiled (default: 5)")
    parser.add_argument("--rosidl", metavar="PREFIX", help="where rosidl's generators are")
    parser.add_argument(
        "--python", default="/usr/bin/python3", help="what runs them (default: /usr/bin/python3)"
    )
    parser.add_argument("--compiler", default="g++", help="default: g++")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="forge-bench-") as name:
        folder = Path(name)
        includes = {"forge": _forge(folder / "forge")}
        if options.rosidl:
            includes = {"rosidl": _rosidl(folder / "rosidl", options.rosidl, options.python), **includes}
        commands = _commands(folder, options.compiler, includes)
        figures = _measured(commands, options.runs)
    if options.rosidl:
        for unit, sides in figures.items():
            if {"forge", "rosidl"} <= sides.keys():
                figures[unit]["of rosidl's"] = round(sides["forge"] / sides["rosidl"], 3)
    version = subprocess.run([options.compiler, "--version"], check=True, capture_output=True, text=True)
    print(json.dumps({"on": version.stdout.splitlines()[0], "runs": options.runs, "ms": figures}, indent=2))
    return 0


def _forge(folder: Path) -> tuple[str, ...]:
    """Generate forge's headers and return the include folders."""
    for catalog in map(embedded_catalog, NEEDED):
        for file in cpp.files(catalog):
            write_if_changed(folder / file.path, file.text)
    return str(folder), str(EMBEDDED / "rosidl_default_runtime" / "include")


def _rosidl(folder: Path, prefix: str, python: str) -> tuple[str, ...]:
    """Let rosidl generate its headers and return the include folders."""
    folder.mkdir()
    variables = {**os.environ, "AMENT_PREFIX_PATH": prefix}
    argv = [python, "-c", _GENERATOR, prefix, str(EMBEDDED), str(folder), *NEEDED]
    subprocess.run(argv, check=True, env=variables, stdout=subprocess.DEVNULL)
    own = sorted(
        path for path in Path(prefix, "include").iterdir() if path.name.startswith(("ros", "rcutils"))
    )
    return str(folder / "cpp"), *map(str, own)


def _commands(
    folder: Path, compiler: str, includes: Mapping[str, tuple[str, ...]]
) -> dict[tuple[str, str], list[str]]:
    """Write the units and return the command line for each on each side."""
    found = {}
    for number, (unit, text, level) in enumerate(_units()):
        source = folder / f"{number}.cpp"
        source.write_text(text, encoding="utf-8")
        for side, folders in includes.items():
            if "forge_cdr" in text and side != "forge":
                continue
            flags = [word for each in folders for word in ("-I", each)]
            found[unit, side] = [
                *(compiler, "-std=c++17", level, *flags, "-c", str(source)),
                *("-o", str(folder / f"{number}.o")),
            ]
    return found


def _units() -> list[tuple[str, str, str]]:
    """Return the name of each unit, its text, and how much the compiler is to optimize."""
    catalogs = map(embedded_catalog, PACKAGES)
    all_headers = [
        main_path(name, "hpp") for each in catalogs for name in each.interfaces if name.kind == "msg"
    ]
    units = []
    for unit, headers in UNITS.items():
        text = "".join(f"#include <{header}>\n" for header in headers or all_headers)
        units.append((unit.replace("92", str(len(all_headers))), text, "-O0"))
        if unit.startswith("PointCloud2"):
            units.append(("PointCloud2 and Path, used", text + USE, "-O2"))
            units.append(("PointCloud2 and Path, used, to bytes and back", text + USE + CODEC, "-O2"))
    return units


def _measured(commands: Mapping[tuple[str, str], list[str]], runs: int) -> dict[str, dict[str, float]]:
    """Return the median milliseconds of each command line; the first turn warms caches."""
    taken: dict[tuple[str, str], list[float]] = {key: [] for key in commands}
    for turn in range(runs + 1):
        for key, argv in commands.items():
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run(argv, check=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            if turn:
                taken[key].append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    figures: dict[str, dict[str, float]] = {}
    for (unit, side), seconds in taken.items():
        figures.setdefault(unit, {})[side] = round(1000 * median(seconds), 1)
    return figures


if __name__ == "__main__":
    sys.exit(main())
