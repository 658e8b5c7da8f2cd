"""Packages that register component nodes: the generated programs share a precompiled header."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import Tree
from tests.packages import manifest_text, write_files
from tests.rosidl import DEBIAN, underlay

pytestmark = [pytest.mark.slow, pytest.mark.needs(str(DEBIAN), "g++")]

ENOUGH = 3 * (os.cpu_count() or 1) + 1
COMPONENTS_CMAKE = """cmake_minimum_required(VERSION 3.16)
project(rclcpp_components NONE)
install(FILES rclcpp_componentsConfig.cmake node_main.cpp.in DESTINATION share/rclcpp_components/cmake)
install(DIRECTORY include/ DESTINATION include)
"""
REGISTER_NODE = """set(_template "${CMAKE_CURRENT_LIST_DIR}/node_main.cpp.in")
set(rclcpp_components_INCLUDE_DIRS "${CMAKE_CURRENT_LIST_DIR}/../../../include")
macro(register_node executable)
  set(node ${executable})
  set(generated "${PROJECT_BINARY_DIR}/rclcpp_components/node_main")
  configure_file("${_template}" "${generated}_configured_${node}.cpp.in")
  file(GENERATE OUTPUT "${generated}_${node}.cpp" INPUT "${generated}_configured_${node}.cpp.in")
  add_executable(${node} "${generated}_${node}.cpp")
  target_include_directories(${node} PRIVATE ${rclcpp_components_INCLUDE_DIRS})
  install(TARGETS ${node} DESTINATION lib/${PROJECT_NAME})
endmacro()
"""
MAIN = """// A program in the form of rclcpp_components.

#include <iostream>
#include "greeting/greeting.hpp"

#define NODE "@node@"

int main()
{
  std::cout << GREETING << " from " << NODE << PUNCTUATION << "\\n";
}
"""
NODES_CMAKE = f"""cmake_minimum_required(VERSION 3.16)
project(nodes CXX)
find_package(ament_cmake REQUIRED)
find_package(rclcpp_components REQUIRED)
add_compile_definitions("PUNCTUATION=\\"!\\"")
foreach(index RANGE 1 {ENOUGH})
  register_node(node_${{index}})
endforeach()
register_node(asking)
target_compile_options(asking PRIVATE -UPUNCTUATION "-DPUNCTUATION=\\"?\\"")
register_node(hidden)
set_target_properties(hidden PROPERTIES CXX_VISIBILITY_PRESET hidden)
ament_package()
"""
FILES = {
    "src/rclcpp_components/package.xml": manifest_text("rclcpp_components", build_type="cmake"),
    "src/rclcpp_components/CMakeLists.txt": COMPONENTS_CMAKE,
    "src/rclcpp_components/rclcpp_componentsConfig.cmake": REGISTER_NODE,
    "src/rclcpp_components/node_main.cpp.in": MAIN,
    "src/rclcpp_components/include/greeting/greeting.hpp": '#pragma once\n#define GREETING "Hello"\n',
    "src/nodes/package.xml": manifest_text(
        "nodes",
        "<buildtool_depend>ament_cmake</buildtool_depend>",
        "<depend>rclcpp_components</depend>",
    ),
    "src/nodes/CMakeLists.txt": NODES_CMAKE,
}


def build(root: Path, *options: str) -> str:
    """Build with Debian's ament as the underlay and return the output."""
    environment = {**os.environ, **underlay()}
    argv = [sys.executable, "-m", "forge", "build", "--python", sys.executable, *options]
    done = subprocess.run(argv, cwd=root, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


def said(root: Path, node: str) -> str:
    program = root / "install/nodes/lib/nodes" / node
    return subprocess.run([program], capture_output=True, text=True, check=True).stdout


def precompiled(root: Path) -> list[Path]:
    return list((root / "build/nodes").rglob("*.gch"))


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a workspace that is built once for several tests."""
    folder = write_files(tmp_path_factory.mktemp("nodes"), FILES)
    assert "warning" not in build(folder)
    return folder


def test_component_nodes_share_a_precompiled_header(root: Path) -> None:
    assert len(precompiled(root)) == 1
    assert [said(root, f"node_{index}") for index in (1, ENOUGH)] == [
        "Hello from node_1!\n",
        f"Hello from node_{ENOUGH}!\n",
    ]
    assert said(root, "asking") == "Hello from asking?\n"
    commands = json.loads((root / "build/nodes/compile_commands.json").read_text(encoding="utf-8"))
    apart = [Path(entry["file"]).stem for entry in commands if "cmake_pch" not in entry["command"]]
    assert sorted(apart) == ["node_main_asking", "node_main_hidden"]


def test_a_changed_header_is_recompiled(root: Path) -> None:
    greeting = '#pragma once\n#define GREETING "Bye"\n'
    write_files(root, {"src/rclcpp_components/include/greeting/greeting.hpp": greeting})
    build(root)
    assert said(root, "node_1") == "Bye from node_1!\n"
    assert "2 packages unchanged" in build(root)


def test_the_option_disables_precompiled_headers(root: Path) -> None:
    assert "--no-fast-rosidl" in build(root, "--no-fast-rosidl", "--json")
    assert "cmake_pch" not in (root / "build/nodes/build.ninja").read_text(encoding="utf-8")
    assert said(root, "node_1").endswith(" from node_1!\n")


def test_a_few_component_nodes_do_not_share_a_header(tree: Tree) -> None:
    root = tree(FILES | {"src/nodes/CMakeLists.txt": NODES_CMAKE.replace(f"1 {ENOUGH}", "1 3")})
    build(root)
    assert not precompiled(root)
    assert said(root, "node_3") == "Hello from node_3!\n"


def test_only_leading_includes_are_shared(tree: Tree) -> None:
    """They may depend on it."""
    greeting = '#pragma once\n#ifdef LOUD\n#define GREETING "HELLO"\n#endif\n'
    root = tree(
        FILES
        | {
            "src/rclcpp_components/node_main.cpp.in": f"#define LOUD\n{MAIN}",
            "src/rclcpp_components/include/greeting/greeting.hpp": greeting,
        }
    )
    build(root)
    assert not precompiled(root)
    assert said(root, "node_1") == "HELLO from node_1!\n"
