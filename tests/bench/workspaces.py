"""Workspaces of any size, the same for the same seed."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

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


def write_workspace(root: Path, packages: int, files: int = 18, seed: int = 1) -> Path:
    """Write `packages` packages of `files` sources each; every one needs up to three earlier ones."""
    chance = random.Random(seed)  # noqa: S311  (a reproducible shape, not a secret)
    names: list[str] = []
    for number in range(packages):
        name = f"bench_{number:04}"
        needs = sorted(chance.sample(names, min(len(names), chance.randrange(4))))
        _write_package(root / "src" / f"group_{number % 10}" / name, name, needs, files)
        names.append(name)
    return root


AMENT_CMAKELISTS = """cmake_minimum_required(VERSION 3.22)
project({name} CXX)
find_package(ament_cmake REQUIRED)
{find}
add_library({name} SHARED src/library.cpp)
target_include_directories({name} PUBLIC
  $<BUILD_INTERFACE:${{CMAKE_CURRENT_SOURCE_DIR}}/include> $<INSTALL_INTERFACE:include/{name}>)
add_executable({name}_main src/main.cpp)
target_link_libraries({name}_main {name})
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


def write_ament_workspace(root: Path, packages: int, seed: int = 1) -> Path:
    """Write ament_cmake packages, each a library of 20 lines and a program, that need up to two others."""
    chance = random.Random(seed)  # noqa: S311  (a reproducible shape, not a secret)
    names: list[str] = []
    for number in range(packages):
        name = f"bench_{number:04}"
        needs = sorted(chance.sample(names, min(len(names), chance.randrange(3))))
        _write_ament_package(root / "src" / name, name, needs)
        names.append(name)
    return root


def _write_ament_package(folder: Path, name: str, needs: list[str]) -> None:
    functions = "".join(f"int sum_{n}(int a, int b) {{ return a + {n} * b; }}\n" for n in range(12))
    declared = "".join(f"int sum_{n}(int a, int b);\n" for n in range(12))
    depends = "".join(f"  <depend>{need}</depend>\n" for need in ("ament_cmake", *needs))
    texts = {
        "package.xml": MANIFEST.format(name=name, depends=depends).replace(
            "<build_type>cmake</build_type>", "<build_type>ament_cmake</build_type>"
        ),
        "CMakeLists.txt": AMENT_CMAKELISTS.format(
            name=name, find="\n".join(f"find_package({need} REQUIRED)" for need in needs)
        ),
        f"include/{name}/library.hpp": f"#pragma once\nnamespace {name} {{\n{declared}}}\n",
        "src/library.cpp": LIBRARY.format(name=name, functions=functions),
        "src/main.cpp": f'#include "{name}/library.hpp"\nint main() {{ return {name}::sum_0(0, 1); }}\n',
    }
    for path, text in texts.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")


def _write_package(folder: Path, name: str, needs: list[str], files: int) -> None:
    depends = "".join(f"  <depend>{need}</depend>\n" for need in needs)
    (folder / "src").mkdir(parents=True)
    (folder / "package.xml").write_text(MANIFEST.format(name=name, depends=depends), encoding="utf-8")
    (folder / "CMakeLists.txt").write_text(CMAKELISTS.format(name=name), encoding="utf-8")
    for number in range(files):
        (folder / "src" / f"part_{number}.cpp").write_text(f"int part_{number};\n", encoding="utf-8")
