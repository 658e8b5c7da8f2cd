"""`forge build --audit`: it names what forge does not track, and finds nothing in our own packages."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.cmake.test_shapes import copy_shapes
from tests.conftest import Forge, Ran, Tree

pytestmark = [pytest.mark.slow, pytest.mark.needs("strace", "cmake", "g++")]

MINIMUM = "cmake_minimum_required(VERSION 3.16)\n"
OUTSIDE = """\
cmake_minimum_required(VERSION 3.16)
project(a C)
file(READ {outside}/configured.txt text)
add_custom_command(OUTPUT made.h DEPENDS {depends} COMMAND sh ${{CMAKE_CURRENT_SOURCE_DIR}}/make.sh made.h)
add_executable(x x.c made.h)
target_include_directories(x PRIVATE ${{CMAKE_CURRENT_BINARY_DIR}})
install(TARGETS x DESTINATION bin)
"""


def package(name: str, build_type: str = "cmake", more: str = "") -> str:
    return (
        f'<?xml version="1.0"?><package format="3"><name>{name}</name><version>0.1.0</version>'
        '<description>d</description><maintainer email="a@b.org">m</maintainer><license>x</license>'
        f"{more}<export><build_type>{build_type}</build_type></export></package>\n"
    )


def outside(root: Path, depends: str = "") -> Mapping[str, str]:
    """Return a package that reads two files elsewhere, one of them in a script."""
    folder = root / "outside"
    return {
        "ws/src/a/package.xml": package("a"),
        "ws/src/a/CMakeLists.txt": OUTSIDE.format(outside=folder, depends=depends),
        "ws/src/a/make.sh": f"cat {folder}/made.txt > $1\n",
        "ws/src/a/x.c": '#include "made.h"\nint main(void) { return MADE; }\n',
        "outside/made.txt": "#define MADE 0\n",
        "outside/configured.txt": "text\n",
    }


def audit(forge: Forge, root: Path, *options: str) -> tuple[Ran, list[str]]:
    """Run an audit; return it and its report."""
    ran = forge("build", "--audit", *options, cwd=root)
    return ran, ran.out.partition("Summary: ")[2].splitlines()[1:]


def test_files_that_nobody_declared_are_named(forge: Forge, tree: Tree, tmp_path: Path) -> None:
    root = tree(outside(tmp_path)) / "ws"
    ran, lines = audit(forge, root)
    assert ran.code == 1, ran.err
    assert lines == [
        f"a: read {tmp_path}/outside/configured.txt (cmake step, by cmake)",
        "  hint: set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS FILE) lets forge track it",
        f"a: read {tmp_path}/outside/made.txt (build step, by cat)",
        "  hint: add_custom_command(... DEPENDS FILE) lets forge track it",
        "audit: 1 of 1 package uses 2 paths that forge does not track",
    ]
    assert not (root / "build/.forge_audit").exists()


@pytest.mark.parametrize("generator", ["Ninja", "Unix Makefiles"])
def test_following_the_hints_resolves_the_findings(
    forge: Forge, tree: Tree, tmp_path: Path, generator: str
) -> None:
    folder = tmp_path / "outside"
    files = dict(outside(tmp_path, f"{folder}/made.txt"))
    files["ws/src/a/CMakeLists.txt"] += (
        f"set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS {folder}/configured.txt)\n"
    )
    ran, lines = audit(forge, tree(files) / "ws", "--cmake-args", f"-G{generator}")
    assert lines == ["audit: 1 package, no unexpected inputs"]
    assert ran.code == 0


def test_an_audit_builds_what_is_up_to_date_from_nothing(forge: Forge, tree: Tree, tmp_path: Path) -> None:
    root = tree(outside(tmp_path)) / "ws"
    assert forge("build", cwd=root).code == 0
    left = root / "build/a/left_over"
    left.touch()
    assert audit(forge, root)[0].code == 1
    assert not left.exists()
    assert "Starting" not in forge("build", cwd=root).out


def test_failing_packages_are_reported_as_in_a_build(forge: Forge, tree: Tree, tmp_path: Path) -> None:
    files = {**outside(tmp_path), "ws/src/a/x.c": "nonsense\n"}
    ran, _ = audit(forge, tree(files) / "ws")
    assert ran.code == 1
    assert ran.out.endswith("audit: 0 packages, no unexpected inputs\n")


def test_untracked_inputs_of_setup_py_and_linked_libraries_are_reported(
    forge: Forge, tree: Tree, tmp_path: Path
) -> None:
    """What the build backend reports is tracked, and so is the library in the folder that a link names."""
    setup = (
        "from setuptools import setup\n"
        f"setup(name='py', version=open('{tmp_path}/VERSION').read().strip(), py_modules=['m'],\n"
        "data_files=[('share/ament_index/resource_index/packages', ['r/py']),\n"
        "            ('share/py', ['package.xml'])])\n"
    )
    root = tree(
        {
            "VERSION": "1.0\n",
            "ws/src/py/package.xml": package("py", "ament_python"),
            "ws/src/py/setup.py": setup,
            "ws/src/py/r/py": "",
            "ws/src/py/m.py": "",
            "vendor/CMakeLists.txt": f"{MINIMUM}project(v C)\nadd_library(v v.c)\n",
            "vendor/v.c": "int v(void) { return 0; }\n",
            "ws/src/l/package.xml": package("l"),
            "ws/src/l/CMakeLists.txt": (
                f"{MINIMUM}project(l C)\nadd_executable(x x.c)\n"
                f"target_link_options(x PRIVATE -L{tmp_path}/vendor/out)\n"
                "target_link_libraries(x PRIVATE v m)\n"
                "install(TARGETS x DESTINATION bin)\n"
            ),
            "ws/src/l/x.c": "int v(void);\nint main(void) { return v(); }\n",
        }
    )
    subprocess.run(["cmake", "-S", "vendor", "-B", "vendor/out"], cwd=root, check=True, capture_output=True)
    subprocess.run(["cmake", "--build", "vendor/out"], cwd=root, check=True, capture_output=True)
    _, lines = audit(forge, root / "ws")
    assert lines == ["audit: 2 packages, no unexpected inputs"]
    (root / "vendor/v.c").write_text("int v(void) { return 1; }\n", encoding="utf-8")
    subprocess.run(["cmake", "--build", "vendor/out"], cwd=root, check=True, capture_output=True)
    assert "Starting >>> l" in forge("build", cwd=root / "ws").out


@pytest.mark.parametrize(
    ("options", "variables"),
    [
        (["--cache"], {}),
        (["--watch"], {}),
        (["--executor", "dask", "--scheduler", "tcp://127.0.0.1:1"], {}),
        (["--compiler-launcher", "ccache"], {}),
        ([], {"FORGE_REMOTE_CACHE": "http://127.0.0.1:1"}),
    ],
)
def test_steps_that_cannot_be_traced_are_rejected(
    forge: Forge, tree: Tree, tmp_path: Path, options: list[str], variables: dict[str, str]
) -> None:
    root = tree(outside(tmp_path)) / "ws"
    ran = forge("build", "--audit", *options, cwd=root, env=variables)
    assert ran.code == 2
    assert "--audit cannot be combined with" in ran.err
    assert not (root / "install/a").exists()


def test_missing_strace_is_reported(forge: Forge, tree: Tree, tmp_path: Path) -> None:
    root = tree(outside(tmp_path)) / "ws"
    programs = tmp_path / "bin"
    programs.mkdir()
    for name in ("cmake", "cc", "c++", "make", "sh", "as", "ld", "cat"):
        (programs / name).symlink_to(shutil.which(name) or name)
    ran = forge("build", "--audit", cwd=root, env={"PATH": str(programs)})
    assert ran.code == 2
    assert "error: '--audit' needs strace, which was not found" in ran.err
    assert "apt install strace" in ran.err


def test_the_shapes_use_nothing_that_is_not_tracked(forge: Forge, tmp_path: Path) -> None:
    """All ten, with a few of the many messages, in the other layout."""
    copy_shapes(tmp_path, 8)
    ran, lines = audit(forge, tmp_path, "--merge-install", "--symlink-install", "--packages-skip", "users")
    assert ran.code == 0, ran.err
    assert lines[-1] == "audit: 23 packages, no unexpected inputs", "\n".join(lines)
