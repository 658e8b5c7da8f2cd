"""A real rosidl for tests: Debian's, unpacked by `make debian-peers`, and both versions of EmPy."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

CHECKOUT = Path(__file__).parents[1]
DEBIAN = CHECKOUT / ".debian-peers/usr"
MODULES = DEBIAN / "lib/python3/dist-packages"
EMPY = {version: CHECKOUT / f".venv-peers/empy-{version}/em.py" for version in ("3", "4")}

RESOURCES = sorted((DEBIAN / "share").glob("rosidl_*/resource"))
"""The folders with rosidl's own templates."""


def underlay() -> dict[str, str]:
    """Return the variables that make Debian's rosidl and ament an underlay."""
    return {
        "AMENT_PREFIX_PATH": str(DEBIAN),
        "CMAKE_PREFIX_PATH": str(DEBIAN),
        "LD_LIBRARY_PATH": str(DEBIAN / "lib/x86_64-linux-gnu"),
        "PYTHONPATH": os.pathsep.join((str(MODULES), *os.environ.get("PYTHONPATH", "").split(os.pathsep))),
    }


@contextmanager
def imported_anew(*packages: str) -> Iterator[None]:
    """Let packages be imported from MODULES for a while; other tests use those that forge brings along."""

    def forget() -> dict[str, ModuleType]:
        names = [name for name in sys.modules if name.partition(".")[0] in packages]
        return {name: sys.modules.pop(name) for name in names}

    before, path = forget(), list(sys.path)
    others = [entry for entry in path if not any(Path(entry, package).exists() for package in packages)]
    sys.path[:] = [*others, str(MODULES)]
    try:
        yield
    finally:
        forget()
        sys.modules.update(before)
        sys.path[:] = path


CMAKE = """cmake_minimum_required(VERSION 3.10)
project({name} C CXX)
find_package(ament_cmake REQUIRED)
find_package(rosidl_cmake REQUIRED)
find_package(rosidl_adapter REQUIRED)
find_package(rosidl_generator_c REQUIRED)
find_package(rosidl_generator_cpp REQUIRED)
find_package(rosidl_typesupport_introspection_c REQUIRED)
find_package(rosidl_typesupport_introspection_cpp REQUIRED)
{before}
rosidl_generate_interfaces(${{PROJECT_NAME}} {files})
{after}
ament_package()
"""


def interface_package(
    name: str, files: dict[str, str], *, before: str = "", after: str = ""
) -> dict[str, str]:
    """Return the files of a package below src/NAME that generates interfaces with rosidl.

    `files` are its definitions by relative path; `before` and `after` are CMake code around the generation.
    """
    manifest = f"""<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>1.2.3</version>
  <description>Interfaces of a test</description>
  <maintainer email="tests@example.com">The tests</maintainer>
  <license>Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_cmake</buildtool_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export><build_type>ament_cmake</build_type></export>
</package>
"""
    cmake = CMAKE.format(name=name, files=" ".join(files), before=before, after=after)
    return {
        f"src/{name}/package.xml": manifest,
        f"src/{name}/CMakeLists.txt": cmake,
        **{f"src/{name}/{path}": text for path, text in files.items()},
    }
