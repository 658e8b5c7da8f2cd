"""Workspaces of any size, kind and shape, the same for the same seed."""

import random
from collections.abc import Callable
from pathlib import Path

from tests.bench.definitions import write_definitions
from tests.packages import write_files

MANIFEST = """<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>1.0.0</version>
  <description>Package {name} of a generated workspace</description>
  <maintainer email="bench@example.com">Bench</maintainer>
  <license>Apache-2.0</license>
  <buildtool_depend>cmake</buildtool_depend>
{depends}  <export><build_type>cmake</build_type></export>
</package>
"""

CMAKELISTS = """cmake_minimum_required(VERSION 3.22)
project({name} NONE)
install(FILES package.xml DESTINATION share/{name})
"""

SHAPES = ("wide", "deep", "real")
"""All need the first and nobody else; each needs the one before; each needs a few earlier ones."""


def needs_of(shape: str, earlier: list[str], most: int, chance: random.Random) -> list[str]:
    """Return what the next package needs of the earlier ones."""
    match shape:
        case "wide":
            return earlier[:1]
        case "deep":
            return earlier[-1:]
        case _:
            return sorted(chance.sample(earlier, min(len(earlier), chance.randrange(most + 1))))


def _write(
    packages: int, most: int, write: Callable[[int, str, list[str]], None], *, seed: int, shape: str
) -> None:
    """Let `write` write each package: its number, its name and what it needs."""
    chance = random.Random(seed)
    names: list[str] = []
    for number in range(packages):
        name = f"bench_{number:04}"
        write(number, name, needs_of(shape, names, most, chance))
        names.append(name)


def write_workspace(root: Path, packages: int, files: int = 18, seed: int = 1, shape: str = "real") -> Path:
    """Write `packages` packages of `files` sources each; every one needs up to three earlier ones."""

    def write(number: int, name: str, needs: list[str]) -> None:
        _write_package(root / "src" / f"group_{number % 10}" / name, name, needs, files)

    _write(packages, 3, write, seed=seed, shape=shape)
    return root


def _write_package(folder: Path, name: str, needs: list[str], files: int) -> None:
    texts = {f"src/part_{number}.cpp": f"int part_{number};\n" for number in range(files)}
    manifest = MANIFEST.format(name=name, depends=_depends(needs))
    write_files(folder, {"package.xml": manifest, "CMakeLists.txt": CMAKELISTS.format(name=name), **texts})


AMENT_CMAKELISTS = """cmake_minimum_required(VERSION 3.22)
project({name} CXX)
find_package(ament_cmake REQUIRED)
{find}
add_library({name} SHARED src/library.cpp)
target_include_directories({name} PUBLIC
  $<BUILD_INTERFACE:${{CMAKE_CURRENT_SOURCE_DIR}}/include> $<INSTALL_INTERFACE:include/{name}>)
add_executable({name}_main src/main.cpp)
target_link_libraries({name}_main {name}{libraries})
install(DIRECTORY include/ DESTINATION include/{name})
install(TARGETS {name} EXPORT {name}_targets LIBRARY DESTINATION lib)
install(TARGETS {name}_main DESTINATION lib/{name})
ament_export_targets({name}_targets)
ament_package()
"""

LIBRARY = """#include "{name}/library.hpp"

namespace {name} {{

{functions}
}}  // namespace {name}
"""


def write_linked_workspace(root: Path, packages: int) -> Path:
    """Write ament_cmake packages of which all link the library of the first."""
    return write_ament_workspace(root, packages, shape="wide", linked=True)


def write_ament_workspace(
    root: Path, packages: int, seed: int = 1, shape: str = "real", *, linked: bool = False
) -> Path:
    """Write ament_cmake packages, each a library of 20 lines and a program, that need up to two others.

    With `linked` their programs also link what they need.
    """

    def write(number: int, name: str, needs: list[str]) -> None:
        del number
        _write_ament_package(root / "src" / name, name, needs, linked=linked)

    _write(packages, 2, write, seed=seed, shape=shape)
    return root


def _write_ament_package(folder: Path, name: str, needs: list[str], *, linked: bool = False) -> None:
    functions = "".join(f"int sum_{n}(int a, int b) {{ return a + {n} * b; }}\n" for n in range(12))
    declared = "".join(f"int sum_{n}(int a, int b);\n" for n in range(12))
    finds = "\n".join(f"find_package({need} REQUIRED)" for need in needs)
    texts = {
        "package.xml": _manifest(name, ["ament_cmake", *needs], "ament_cmake"),
        "CMakeLists.txt": AMENT_CMAKELISTS.format(
            name=name, find=finds, libraries="".join(f" {need}::{need}" for need in needs if linked)
        ),
        f"include/{name}/library.hpp": f"#pragma once\nnamespace {name} {{\n{declared}}}\n",
        "src/library.cpp": LIBRARY.format(name=name, functions=functions),
        "src/main.cpp": f'#include "{name}/library.hpp"\nint main() {{ return {name}::sum_0(0, 1); }}\n',
    }
    write_files(folder, texts)


SETUP = """from setuptools import setup

setup(
    name="{name}",
    version="1.0.0",
    packages=["{name}"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/{name}"]),
        ("share/{name}", ["package.xml"]),
    ],
    entry_points={{"console_scripts": ["{name} = {name}.part_0:main"]}},
)
"""

SETUP_CFG = """[develop]
script_dir=$base/lib/{name}
[install]
install_scripts=$base/lib/{name}
"""


def write_python_workspace(root: Path, packages: int, seed: int = 1, shape: str = "real") -> Path:
    """Write ament_python packages of eight modules and a program, that need up to two others."""

    def write(number: int, name: str, needs: list[str]) -> None:
        del number
        modules = {f"{name}/part_{n}.py": f"def main():\n    print({n})\n" for n in range(8)}
        texts = {
            "package.xml": _manifest(name, needs, "ament_python"),
            "setup.py": SETUP.format(name=name),
            "setup.cfg": SETUP_CFG.format(name=name),
            f"resource/{name}": "",
            f"{name}/__init__.py": "",
        }
        write_files(root / "src" / name, {**texts, **modules})

    _write(packages, 2, write, seed=seed, shape=shape)
    return root


INTERFACES_CMAKELISTS = """cmake_minimum_required(VERSION 3.22)
project({name} C CXX)
find_package(ament_cmake REQUIRED)
{find}
file(GLOB messages RELATIVE ${{CMAKE_CURRENT_SOURCE_DIR}} CONFIGURE_DEPENDS msg/*.msg)
rosidl_generate_interfaces(${{PROJECT_NAME}} ${{messages}} DEPENDENCIES {depends})
ament_package()
"""
EVERY_GENERATOR = ("rosidl_default_generators",)
DEBIANS_GENERATORS = ("rosidl_cmake", "rosidl_generator_c", "rosidl_generator_cpp")
"""Debian has those of C and C++, and no package that stands for all."""

_REFERRED = ("builtin_interfaces", "geometry_msgs", "std_msgs")


def write_interface_workspace(
    root: Path,
    packages: int,
    messages: int = 5,
    generators: tuple[str, ...] = EVERY_GENERATOR,
    *,
    referring: bool = True,
) -> Path:
    """Write packages of messages, which nobody needs, `referring` to standard packages or not."""

    def write(number: int, name: str, needs: list[str]) -> None:
        del needs
        depends = _REFERRED if referring else ()
        finds = "\n".join(f"find_package({each} REQUIRED)" for each in (*generators, *depends))
        listed = INTERFACES_CMAKELISTS.format(name=name, find=finds, depends=" ".join(depends))
        group = "  <member_of_group>rosidl_interface_packages</member_of_group>\n"
        manifest = _manifest(name, ["ament_cmake", *generators, *depends], "ament_cmake", group)
        folder = write_definitions(root / "src" / name, messages, number, others=referring)
        write_files(
            folder, {"package.xml": manifest, "CMakeLists.txt": listed.replace(" DEPENDENCIES )", ")")}
        )

    _write(packages, 0, write, seed=1, shape="real")
    return root


def _manifest(name: str, needs: list[str], build_type: str, more: str = "") -> str:
    text = MANIFEST.format(name=name, depends=_depends(needs) + more)
    return text.replace("<build_type>cmake</build_type>", f"<build_type>{build_type}</build_type>")


def _depends(needs: list[str]) -> str:
    return "".join(f"  <depend>{need}</depend>\n" for need in needs)
