"""Compilers that are killed, and the memory of packages, with real processes."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING

import pytest

from tests.packages import manifest_text

if TYPE_CHECKING:
    from pathlib import Path

    from tests.conftest import Forge, Tree

CMAKE = """cmake_minimum_required(VERSION 3.18)
project({name} CXX)
add_library({name} STATIC a.cpp b.cpp)
target_compile_options({name} PRIVATE -wrapper sh,${{CMAKE_CURRENT_SOURCE_DIR}}/wrapper.sh)
install(TARGETS {name} DESTINATION lib)
"""
KILLED = """case "$1" in
*cc1plus)
  echo "$*" >> "$LOG"
  case "$*" in
  *a.cpp*)
    if [ -n "$ALWAYS" ] || [ ! -e "$LOG.killed" ]; then
      touch "$LOG.killed"
      kill -9 $$
    fi ;;
  esac ;;
esac
exec "$@"
"""
"""Runs what g++ runs, but kills the compiler of a.cpp, once or always."""


def write(tree: Tree, *names: str) -> Path:
    files: dict[str, str] = {}
    for name in names:
        files |= {
            f"my ws/src/{name}/package.xml": manifest_text(name, build_type="cmake"),
            f"my ws/src/{name}/CMakeLists.txt": CMAKE.format(name=name),
            f"my ws/src/{name}/wrapper.sh": KILLED,
            f"my ws/src/{name}/a.cpp": f"int a_{name};\n",
            f"my ws/src/{name}/b.cpp": f"int b_{name};\n",
        }
    return tree(files) / "my ws"


@pytest.mark.needs("cmake", "g++", "ninja")
def test_a_package_whose_compiler_was_killed_is_rebuilt_alone_once(forge: Forge, tree: Tree) -> None:
    root = write(tree, "one", "two")
    env = {"LOG": str(root / "calls"), "ALWAYS": ""}
    ran = forge("build", "-j2", cwd=root, env=env)
    assert ran.code == 0, ran.out + ran.err
    said = "was killed, probably for lack of memory; building again, alone and with one job"
    assert ran.err.count(said) == 1
    calls = (root / "calls").read_text().splitlines()
    assert sum("a.cpp" in line for line in calls) == 3  # of both packages, and once more


@pytest.mark.needs("cmake", "g++", "ninja")
def test_a_second_kill_fails_the_package_with_cause_and_remedy(forge: Forge, tree: Tree) -> None:
    root = write(tree, "one")
    env = {"LOG": str(root / "calls"), "ALWAYS": "1"}
    ran = forge("build", cwd=root, env=env)
    assert ran.code == 1
    assert "was killed again, although nothing else ran" in ran.err
    assert "hint: one file needs more memory than this machine has" in ran.err
    assert "Traceback" not in ran.err
    calls = (root / "calls").read_text().splitlines()
    assert sum("a.cpp" in line for line in calls) == 2


@pytest.mark.needs("cmake", "g++", "ninja")
def test_an_error_after_a_kill_gets_no_memory_hint(forge: Forge, tree: Tree) -> None:
    root = write(tree, "one")
    (root / "src/one/a.cpp").write_text("int wrong = ;\n")
    ran = forge("build", cwd=root, env={"LOG": str(root / "calls"), "ALWAYS": ""})
    assert ran.code == 1
    assert "a.cpp:1:13: error: expected primary-expression" in ran.err
    assert "hint: " not in ran.err


HUNGRY = """cmake_minimum_required(VERSION 3.18)
project(hungry NONE)
add_custom_target(eat ALL COMMAND "{python}" "${{CMAKE_CURRENT_SOURCE_DIR}}/eat.py" VERBATIM)
"""


@pytest.mark.needs("cmake")
def test_memory_peaks_of_packages_are_recorded(forge: Forge, tree: Tree) -> None:
    """Two processes of one package count together."""
    eat = "import os, time\nos.fork()\nfood = b'x' * 150_000_000\ntime.sleep(1.5)\n"
    root = (
        tree(
            {
                "ws/src/hungry/package.xml": manifest_text("hungry", build_type="cmake"),
                "ws/src/hungry/CMakeLists.txt": HUNGRY.format(python=sys.executable),
                "ws/src/hungry/eat.py": eat,
            }
        )
        / "ws"
    )
    assert forge("build", cwd=root).code == 0
    peaks = json.loads((root / "build/forge_memory.json").read_text())["peaks"]
    assert 300_000_000 < peaks["hungry"] < 600_000_000
    # It is no input.
    (root / "build/forge_memory.json").write_text("{")
    assert "1 package unchanged" in forge("build", cwd=root).out


@pytest.mark.needs("cmake")
def test_packages_that_do_not_fit_into_memory_together_are_built_in_turn(forge: Forge, tree: Tree) -> None:
    files = {}
    for name in ("one", "two"):
        files[f"ws/src/{name}/package.xml"] = manifest_text(name, build_type="cmake")
        files[f"ws/src/{name}/CMakeLists.txt"] = (
            f"cmake_minimum_required(VERSION 3.18)\nproject({name} NONE)\n"
            "add_custom_target(nap ALL sleep 0.2)\n"
        )
    huge = json.dumps({"peaks": {"one": 1 << 60, "two": 1 << 60}})
    root = tree(files) / "ws"
    assert forge("build", "-j2", cwd=root).code == 0
    (root / "build/forge_memory.json").write_text(huge)
    ran = forge("build", "-j2", "--force", cwd=root)
    assert ran.code == 0, ran.err
    assert [line.split()[0] for line in ran.out.splitlines()[:4]] == ["Starting", "Finished"] * 2
    ran = forge("build", "-j2", "--force", "--memory-limit", "none", cwd=root)
    assert [line.split()[0] for line in ran.out.splitlines()[:4]] == ["Starting"] * 2 + ["Finished"] * 2
