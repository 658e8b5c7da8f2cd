"""Tests that take too long are stopped, with all processes that they have started."""

from pathlib import Path

import pytest

from forge.execution.started import is_running
from tests.conftest import Forge, Tree
from tests.testable import cmake_package, python_package

HANGS = """import pathlib
import subprocess
import signal

def test_hangs():
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    child = subprocess.Popen(["sleep", "600"])
    pathlib.Path("children").write_text(str(child.pid))
    child.wait()
"""
UNITTEST = """import unittest
from .hangs import test_hangs

class Hangs(unittest.TestCase):
    def test(self):
        test_hangs()
"""


def has_child(folder: Path) -> bool:
    return is_running(int((folder / "children").read_text(encoding="utf-8")))


@pytest.mark.parametrize("runner", ["pytest", "unittest"])
def test_a_python_test_run_is_killed_with_its_children_on_timeout(
    forge: Forge, built: Tree, runner: str
) -> None:
    files = python_package("p", HANGS if runner == "pytest" else UNITTEST, pytest=runner == "pytest")
    root = built({**files, "src/p/tests/hangs.py": HANGS})
    ran = forge("test", "--test-timeout", "2", "--return-code-on-test-failure", cwd=root)
    assert ran.code == 1
    assert f"{runner} exited without writing a result, or took longer than 2 s" in ran.out
    assert "forge: stopped, because it took longer than 2 s" in ran.err
    assert not has_child(root / "src/p")
    assert forge("test-result", cwd=root).code == 1


@pytest.mark.needs("cmake")
def test_a_ctest_timeout_leaves_no_processes(forge: Forge, built: Tree) -> None:
    hangs = "add_test(NAME hangs COMMAND sh ${CMAKE_SOURCE_DIR}/hangs.sh)"
    files = cmake_package("p", hangs, "add_test(NAME good COMMAND true)")
    root = built({**files, "src/p/hangs.sh": "trap : TERM\nsleep 600 &\necho $! > children\nwait\nwait\n"})
    ran = forge("test", "--test-timeout", "1", cwd=root)
    assert "2 tests, 0 errors, 1 failure" in ran.out
    assert "  p: hangs\n      Timeout\n" in ran.out
    assert not has_child(root / "build/p")


@pytest.mark.needs("cmake")
def test_processes_left_by_a_test_are_stopped(forge: Forge, built: Tree) -> None:
    leaves = 'sh -c "sleep 600 > /dev/null 2>&1 & echo \\$! > children"'
    root = built(cmake_package("p", f"add_test(NAME leaves COMMAND {leaves})"))
    assert "1 test, 0 errors, 0 failures" in forge("test", cwd=root).out
    assert not has_child(root / "build/p")
