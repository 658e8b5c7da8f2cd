"""compile_commands.json for the whole workspace."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING

import pytest

from forge.build.compile_commands import merge_compile_commands
from tests.packages import manifest_text

if TYPE_CHECKING:
    from pathlib import Path

    from tests.conftest import Forge, Tree

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


def test_lists_become_one_list_and_odd_files_are_left_out(tree: Tree) -> None:
    root = tree(
        {
            "a/compile_commands.json": '[\n{"file": "1"},\n{"file": "2"}\n]\n',
            "b/compile_commands.json": "[]\n",
            "c/compile_commands.json": '[{"file": "3"}]',
            "d/compile_commands.json": '[{"fi',
        }
    )
    assert merge_compile_commands(root)
    assert json.loads((root / "compile_commands.json").read_text()) == [
        {"file": "1"},
        {"file": "2"},
        {"file": "3"},
    ]


def test_it_is_written_only_when_a_part_changed(tree: Tree) -> None:
    root = tree({"a/compile_commands.json": '[{"file": "1"}]', "b/compile_commands.json": "[]"})
    assert merge_compile_commands(root)
    assert not merge_compile_commands(root)
    later = (root / "compile_commands.json").stat().st_mtime_ns + 10**9
    os.utime(root / "a/compile_commands.json", ns=(later, later))
    assert not merge_compile_commands(root)
    (root / "a/compile_commands.json").write_text('[{"file": "2"}]')
    os.utime(root / "a/compile_commands.json", ns=(later, later))
    assert merge_compile_commands(root)
    (root / "a/compile_commands.json").unlink()
    (root / "b/compile_commands.json").unlink()
    assert not merge_compile_commands(root)
    assert not (root / "compile_commands.json").exists()


@pytest.mark.needs("cmake", "ninja", "g++")
def test_a_build_leaves_it_unless_told_otherwise(forge: Forge, tree: Tree) -> None:
    root = tree({**library("a"), **library("b")})
    assert forge("build", cwd=root).code == 0
    assert compiled(root) == ["a.cpp", "b.cpp"]
    stamp = (root / "build/compile_commands.json").stat().st_mtime_ns
    assert forge("build", cwd=root).code == 0
    assert (root / "build/compile_commands.json").stat().st_mtime_ns == stamp
    assert forge("clean", "packages", "a", "-y", cwd=root).code == 0
    assert compiled(root) == ["b.cpp"]
    off = "-DCMAKE_EXPORT_COMPILE_COMMANDS=OFF"
    assert forge("clean", "workspace", "-y", cwd=root).code == 0
    assert forge("build", "--cmake-args", off, cwd=root).code == 0
    assert not (root / "build/compile_commands.json").exists()


@pytest.mark.needs("cmake", "ninja", "g++")
def test_the_environment_may_say_otherwise(forge: Forge, tree: Tree) -> None:
    root = tree(library("a"))
    assert forge("build", cwd=root, env={"CMAKE_EXPORT_COMPILE_COMMANDS": "OFF"}).code == 0
    assert not (root / "build/a/compile_commands.json").exists()
