"""Workspaces at unusual paths: they build, or forge reports which tool cannot handle the path."""

import subprocess
import sys
from pathlib import Path

import pytest

from forge.build.folder_marks import path_problems
from tests.e2e.test_scale import surroundings
from tests.packages import manifest_text

_CMAKE = """cmake_minimum_required(VERSION 3.18)
project(c NONE)
add_custom_command(OUTPUT made.txt DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/package.xml
  COMMAND ${CMAKE_COMMAND} -E touch made.txt)
add_custom_target(all_of_it ALL DEPENDS made.txt)
install(FILES package.xml ${CMAKE_CURRENT_BINARY_DIR}/made.txt DESTINATION share/c)
"""


def workspace(root: Path) -> Path:
    """Write a package of CMake and one of Python that needs it."""
    for name, build_type in (("c", "cmake"), ("y", "ament_python")):
        (root / "src" / name).mkdir(parents=True)
        text = manifest_text(name, "<depend>c</depend>" if name == "y" else "", build_type=build_type)
        (root / "src" / name / "package.xml").write_text(text)
    (root / "src" / "c" / "CMakeLists.txt").write_text(_CMAKE)
    (root / "src" / "y" / "setup.py").write_text(
        "from setuptools import setup\nsetup(name='y', py_modules=['y'])\n"
    )
    (root / "src" / "y" / "y.py").touch()
    return root


def build(root: Path) -> subprocess.CompletedProcess[str]:
    argv = [sys.executable, "-m", "forge", "--log-base", "/dev/null", "build"]
    return subprocess.run(argv, cwd=root, env=surroundings(), capture_output=True, text=True, check=False)


@pytest.mark.needs("cmake", "bash")
def test_workspace_paths_with_shell_characters_work(tmp_path: Path) -> None:
    root = workspace(tmp_path / "it's a (`touch sprung`) & 1 [@x@] \u00fc*~=,")
    done = build(root)
    assert done.returncode == 0, done.stderr
    words = ["bash", "-c", "set -e; . install/setup.bash; python3 -c 'import y'"]
    subprocess.run(words, cwd=root, env=surroundings(), check=True)
    assert not list(tmp_path.rglob("sprung"))


def test_workspace_paths_that_tools_cannot_handle_are_rejected_early(tmp_path: Path) -> None:
    root = workspace(tmp_path / "a:b")
    done = build(root)
    assert (done.returncode, (root / "install").exists()) == (2, False)
    assert "contains ':', which is not supported" in done.stderr
    assert "move the workspace" in done.stderr


@pytest.mark.parametrize("sign", [":", ";", '"', "\\", "\n", "$", "%", "{", "}"])
def test_each_unsupported_character_is_named(sign: str) -> None:
    """Some are rejected by setuptools only."""
    (problem,) = path_problems([Path(f"/a{sign}b")], python=True)
    assert f"contains {sign!r}, which is not supported" in problem.message
    assert bool([*path_problems([Path(f"/a{sign}b")], python=False)]) == (sign not in "$%{}")
