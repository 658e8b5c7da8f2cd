"""Looking up programs and config files, and identifying programs."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from forge.build.up_to_date import relevant_environment
from forge.toolchain.config_search import ConfigSearch
from forge.toolchain.programs import ProgramLookup, Tools, cmake_root, identities, programs_in
from tests.conftest import Tree

PROGRAM = "#!/bin/true\n"


def lookup(*folders: Path) -> ProgramLookup:
    return ProgramLookup({"PATH": os.pathsep.join(map(str, folders))})


def path_of(identity: str) -> str:
    return identity.rsplit(" ", 2)[0]


def test_a_replaced_program_has_another_identity(tree: Tree) -> None:
    root = tree({"a/tool": PROGRAM})
    before = lookup(root / "a").identity("tool")
    tree({"a/tool": f"{PROGRAM}# longer\n"})
    assert lookup(root / "a").identity("tool") != before


def test_identities_of_wrappers_include_the_programs_they_start(tree: Tree) -> None:
    root = tree({"opt/cc1": '#!/bin/sh\nexec realcc -DV=1 "$@"\n', "bin/realcc": "binary"})
    (root / "bin/realcc").chmod(0o755)
    found = [path_of(identity) for identity in lookup(root / "bin").resolve(str(root / "opt/cc1"))]
    assert found[0] == str(root / "opt/cc1")
    assert str(root / "bin/realcc") in found


def test_a_launcher_named_like_a_compiler_starts_the_next_one_on_path(tree: Tree) -> None:
    root = tree({"usr/ccache": "binary", "lib/x": "", "bin/cc": "compiler", "bin2/cc": "another"})
    for path in ("usr/ccache", "bin/cc", "bin2/cc"):
        (root / path).chmod(0o755)
    (root / "lib/cc").symlink_to(root / "usr/ccache")
    found = lookup(root / "lib", root / "bin", root / "bin2").resolve("cc")
    assert [path_of(identity) for identity in found] == [str(root / "lib/cc"), str(root / "bin/cc")]


def test_programs_named_by_arguments_and_variables_are_identified(tree: Tree) -> None:
    names = ("gcc", "ar", "ld", "ccache", "ld.gold", "mycc")
    root = tree({f"bin/{name}": "binary" for name in names})
    for name in names:
        (root / "bin" / name).chmod(0o755)
    said = {
        "PATH": str(root / "bin"),
        "CC": "ccache gcc -m32",
        "LDFLAGS": "-fuse-ld=gold",
        "LDSHARED": "gcc -s",
    }
    found = dict(identities(Tools(root / "bin/cmake"), root / "bin/python", said))
    there = {
        name: path_of(value).rpartition("/")[2] for name, value in found.items() if "not there" not in value
    }
    assert there == {
        "cc": "ccache",
        "cc 2": "gcc",
        "ar": "ar",
        "ld": "ld",
        "ld.gold": "ld.gold",
        "LDSHARED": "gcc",
    }
    arguments = ("-DCMAKE_C_COMPILER=mycc", "-D", f"CMAKE_AR:FILEPATH={root}/bin/ar", "-DOTHER=ar")
    assert [name for name, _ in programs_in(arguments, ProgramLookup(said))] == [
        "CMAKE_AR",
        "CMAKE_C_COMPILER",
    ]


def test_the_modules_of_cmake_are_found_next_to_it(tree: Tree) -> None:
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
def test_config_files_below_a_prefix(tree: Tree, place: str) -> None:
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
