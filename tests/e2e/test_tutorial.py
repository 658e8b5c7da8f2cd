"""A new user follows the tutorial, line by line, in an empty folder on a machine without ROS."""

import os
import shlex
import shutil
import sys
from pathlib import Path

import pytest

from tests.snippets import ROOT, run, shell

TUTORIAL = ROOT / "docs/tutorial.md"

pytestmark = pytest.mark.needs("bash", "cmake", "make", "g++")

HELLO = "from example_ros2_interfaces.msg import RobotPose as R; print(R(status=R.STATUS_STOPPED).status)"


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Type the whole tutorial once; the folder's name has a blank, as on many a desktop."""
    folder = tmp_path_factory.mktemp("tutorial") / "an empty folder"
    folder.mkdir()
    run(TUTORIAL, folder)
    return folder / "robot_ws"


def test_the_tutorial_commands_work(workspace: Path) -> None:
    """Every command succeeds and prints what the tutorial says; the fixture asserts it."""
    assert sorted(path.name for path in workspace.iterdir() if path.is_dir()) == [
        "build",
        "elsewhere",
        "install",
        "log",
        "src",
    ]


@pytest.mark.parametrize("name", ["sh", "bash"])
def test_every_shell_can_use_the_install_folder(workspace: Path, name: str) -> None:
    """Sourced from elsewhere, under the strictest options, twice, by the path with its blank.

    Other shells, which a bare machine lacks, are in test_shells.py.
    """
    setup = workspace / f"install/setup.{name}"
    script = f"""
set -eu
. "{setup}"
once=$PYTHONPATH
. "{setup}"
[ "$once" = "$PYTHONPATH" ]
python3 -c "{HELLO}"
"""
    assert shell(f"{name} -c {shlex.quote(script)}", ROOT) == "2\n"


def test_the_install_folder_works_without_forge(workspace: Path, tmp_path: Path) -> None:
    """A fresh CMake project and a fresh interpreter use it on a machine that never saw forge."""
    shutil.copytree(workspace / "elsewhere", tmp_path / "elsewhere", ignore=shutil.ignore_patterns("build"))
    shutil.copy(workspace / "hello.cpp", tmp_path)
    script = f"""
set -e
unset PYTHONPATH
source "{workspace}/install/setup.bash"
cmake -S elsewhere -B out >/dev/null
cmake --build out >/dev/null
out/hello | head -1
python3 -c "{HELLO}"
"""
    path = os.pathsep.join([str(_programs(tmp_path)), "/usr/bin", "/bin"])
    assert shell(script, tmp_path, PATH=path) == "status: 1\n2\n"


def test_an_up_to_date_build_touches_no_installed_file(workspace: Path) -> None:
    before = _times(workspace / "install")
    shell("forge build", workspace)
    assert _times(workspace / "install") == before


def _programs(folder: Path) -> Path:
    """Link the interpreter and CMake, and no forge, into a folder for PATH."""
    programs = folder / "programs"
    programs.mkdir()
    for name, target in (("python3", sys.executable), ("cmake", shutil.which("cmake")), ("ninja", None)):
        found = target or shutil.which(name)
        if found:
            (programs / name).write_text(f'#!/bin/sh\nexec "{found}" "$@"\n', encoding="utf-8")
            (programs / name).chmod(0o755)
    return programs


def _times(folder: Path) -> dict[str, int]:
    parts = ("example_ros2_interfaces/include", "example_ros2_interfaces/lib", "example_interfaces_cpp/lib")
    found = (path for part in parts for path in (folder / part).rglob("*"))
    return {str(path): path.lstat().st_mtime_ns for path in found if path.is_file()}
