"""Looking up programs and config files, and identifying programs."""

import os
from pathlib import Path

import pytest

from forge.engine.variables import relevant_environment
from forge.toolchain.programs import ConfigSearch, ProgramLookup, cmake_root
from tests.conftest import Tree

PROGRAM = "#!/bin/true\n"


def lookup(*folders: Path) -> ProgramLookup:
    return ProgramLookup({"PATH": os.pathsep.join(map(str, folders))})


def test_a_replaced_program_has_a_different_identity(tree: Tree) -> None:
    root = tree({"a/tool": PROGRAM})
    before = lookup(root / "a").identity("tool")
    tree({"a/tool": f"{PROGRAM}# longer\n"})
    assert lookup(root / "a").identity("tool") != before


def test_cmake_modules_are_found_next_to_cmake(tree: Tree) -> None:
    root = tree(
        {
            "share/cmake/Modules/FindMine.cmake": "",
            "share/cmake-3.30/Modules/CMakeDetermineSystem.cmake": "",
            "bin/cmake": PROGRAM,
        }
    )
    assert cmake_root(root / "bin/cmake") == root / "share/cmake-3.30"
    assert cmake_root(root / "opt/bin/cmake") is None


@pytest.mark.parametrize(
    "place",
    [
        "share/zed/cmake/zedConfig.cmake",
        "lib/cmake/zed-1.2/zed-config.cmake",
        "lib/x86_64-linux-gnu/cmake/Zed/zedConfig.cmake",
        "zed/zedConfig.cmake",
        "cmake/zedConfig.cmake",
    ],
)
def test_config_files_are_found_below_a_prefix(tree: Tree, place: str) -> None:
    root = tree({place: "", "lib/cmake/zedless/x": ""})
    assert ConfigSearch().folder(str(root), "zed") == str((root / place).parent)
    assert ConfigSearch().folder(str(root), "yam") == ""


def test_only_variables_that_affect_builds_are_inputs() -> None:
    idle = (
        "ROS_DOMAIN_ID ROS_LOG_DIR ROS_LOCALHOST_ONLY RMW_IMPLEMENTATION CUDA_VISIBLE_DEVICES ROS_MASTER_URI"
        " ROS_HOSTNAME PKG_CONFIG_DEBUG_SPEW CUDA_CACHE_PATH AMENT_TRACE_SETUP_FILES CMAKE_COLOR_DIAGNOSTICS"
        " CMAKE_BUILD_PARALLEL_LEVEL PATH HOME"
    )
    busy = (
        "AMENT_PREFIX_PATH CC CMAKE_BUILD_TYPE CMAKE_PREFIX_PATH CUDAARCHS CUDA_HOME CXXFLAGS LDSHARED"
        " LD_RUN_PATH PKG_CONFIG_PATH PYTHONPATH ROS_PYTHON_VERSION ROS_VERSION"
        " SETUPTOOLS_SCM_PRETEND_VERSION STATIC_ROSIDL_TYPESUPPORT_C"
    )
    said = dict.fromkeys((*idle.split(), *busy.split()), "1")
    assert [name for name, _ in relevant_environment(said)] == busy.split()
