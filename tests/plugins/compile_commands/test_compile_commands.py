"""compile_commands.json for the whole workspace."""

import json
import shutil
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text

LIBRARY = """cmake_minimum_required(VERSION 3.18)
project({name} CXX)
add_library({name} SHARED {name}.cpp)
install(TARGETS {name})
"""


def library(name: str) -> dict[str, str]:
    """Return a package that compiles one file."""
    return {
        f"src/{name}/package.xml": manifest_text(name, build_type="cmake"),
        f"src/{name}/CMakeLists.txt": LIBRARY.format(name=name),
        f"src/{name}/{name}.cpp": f"int {name}() {{ return 1; }}\n",
    }


def compiled(root: Path) -> list[str]:
    """Return the names of the files that the workspace's own list has."""
    listed = json.loads((root / "build/compile_commands.json").read_text())
    return [entry["file"].rpartition("/")[2] for entry in listed]


@pytest.mark.needs("cmake", "ninja", "g++")
def test_compile_commands_are_written_unless_disabled(forge: Forge, built: Tree) -> None:
    root = built({**library("a"), **library("b")})
    assert compiled(root) == ["a.cpp", "b.cpp"]
    stamp = (root / "build/compile_commands.json").stat().st_mtime_ns
    assert forge("build", cwd=root).code == 0
    assert (root / "build/compile_commands.json").stat().st_mtime_ns == stamp
    off = "-DCMAKE_EXPORT_COMPILE_COMMANDS=OFF"
    shutil.rmtree(root / "build")
    assert forge("build", "--cmake-args", off, cwd=root).code == 0
    assert not (root / "build/compile_commands.json").exists()


@pytest.mark.needs("cmake", "ninja", "g++")
def test_the_environment_can_disable_compile_commands(forge: Forge, tree: Tree) -> None:
    root = tree(library("a"))
    assert forge("build", cwd=root, env={"CMAKE_EXPORT_COMPILE_COMMANDS": "OFF"}).code == 0
    assert not (root / "build/a/compile_commands.json").exists()
