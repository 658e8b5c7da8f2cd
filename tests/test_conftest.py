"""Tests of the shared fixtures."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from forge import __version__

if TYPE_CHECKING:
    from tests.conftest import Forge, Golden, Tree

SUITE = """
import pytest

@pytest.mark.needs("a-tool-that-is-nowhere")
def test_with_a_tool():
    pass

def test_with_a_reason():
    pytest.skip("the moon is full")

def test_that_runs():
    pass
"""


GUARDED = """
import os, pytest, socket, subprocess, threading

def test_that_starts_a_program_and_handles_the_error():
    try:
        subprocess.run(["true"])
    except OSError:
        pass

def test_that_starts_a_program_in_a_thread():
    thread = threading.Thread(target=subprocess.run, args=(["true"],))
    thread.start()
    thread.join()

@pytest.fixture(scope="module")
def child():
    return os.posix_spawn("/bin/true", ["true"], {})

def test_with_a_fixture_that_starts_a_program(child):
    pass

def test_that_uses_the_network():
    with pytest.raises(PermissionError):
        socket.create_connection(("127.0.0.1", 9))

@pytest.mark.needs("sh")
def test_that_needs_a_program():
    pass

def test_that_computes():
    pass
"""


TOOLS = """
import pathlib, subprocess
import pytest

@pytest.fixture(scope="module")
def server():
    return pathlib.Path("/usr/sbin/nginx").read_bytes()

def test_without_its_marker():
    subprocess.run(["git", "--version"], check=True)

def test_with_a_fixture_that_uses_a_tool_by_its_path(server):
    pass

@pytest.mark.needs("git")
def test_with_its_marker():
    subprocess.run(["git", "--version"], check=True)

def test_with_what_every_machine_has():
    for tool in ("python3", "make", "g++"):
        subprocess.run([tool, "--version"], check=True)

def test_with_a_virtual_environment(tmp_path):
    subprocess.run(["python3", "-m", "venv", "--without-pip", tmp_path], check=True)
    subprocess.run([tmp_path / "bin/python3", "-c", "import subprocess"], check=True)
"""


def run_suite(
    folder: Path, *, suite: str = SUITE, before: tuple[str, ...] = (), after: tuple[str, ...] = (), **env: str
) -> subprocess.CompletedProcess[str]:
    """Run a suite with a copy of the real conftest; `before` are words before the Python, `after` options."""
    root = Path(__file__).parents[1]
    shutil.copy(root / "tests/conftest.py", folder)
    (folder / "test_suite.py").write_text(suite, encoding="utf-8")
    (folder / "pytest.ini").write_text("[pytest]\nmarkers =\n  needs(tool): x\n", encoding="utf-8")
    argv = [*before, sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *after]
    return subprocess.run(
        argv,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(root), "FORGE_TEST_NOTHING_LEFT_OUT": "0", **env},
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_run_gives_its_code_and_what_it_printed(forge: Forge) -> None:
    ran = forge("--version")
    assert (ran.code, ran.out.strip()) == (0, f"forge {__version__}")


def test_a_mistake_on_the_command_line_is_code_2(forge: Forge) -> None:
    assert forge("no-such-command").code == 2


def test_a_run_leaves_folder_and_environment_as_they_were(forge: Forge, tmp_path: Path) -> None:
    before = (Path.cwd(), dict(os.environ))
    forge("--version", cwd=tmp_path, env={"FORGE_X": "1", "PATH": None})
    assert (Path.cwd(), dict(os.environ)) == before


def test_a_script_in_a_tree_can_be_executed(tree: Tree) -> None:
    root = tree({"a/run.sh": "#!/bin/sh\n", "a/text": "#\n"})
    assert [os.access(root / "a" / name, os.X_OK) for name in ("run.sh", "text")] == [True, False]


@pytest.mark.parametrize("files", [{"a": "1\n"}, {"a": "1\n", "b": "", "c": "3\n"}, {"a": "2\n", "b": ""}])
def test_a_golden_tells_missing_additional_and_different_files(
    golden: Golden, tree: Tree, tmp_path: Path, files: dict[str, str]
) -> None:
    tree({"expected/a": "1\n", "expected/b": ""})
    golden(tmp_path, {"a": "1\n", "b": ""})
    with pytest.raises(pytest.fail.Exception, match=r"missing: b|not expected: c|-1\n\+2"):
        golden(tmp_path, files)


def test_what_is_left_out_is_named_with_its_remedy(tmp_path: Path) -> None:
    ran = run_suite(tmp_path)
    assert ran.returncode == 0
    assert "1 for want of a-tool-that-is-nowhere: put 'a-tool-that-is-nowhere' on PATH" in ran.stdout
    assert "1 because of: Skipped: the moon is full" in ran.stdout


def test_on_request_nothing_may_be_left_out(tmp_path: Path) -> None:
    assert run_suite(tmp_path, FORGE_TEST_NOTHING_LEFT_OUT="1").returncode == 1


def test_what_has_passed_is_not_run_again(tmp_path: Path) -> None:
    once = ("--once", "passed.txt")
    assert "\n1 passed, 2 skipped in" in run_suite(tmp_path, after=once).stdout
    assert (tmp_path / "passed.txt").read_text(encoding="utf-8") == "test_suite.py::test_that_runs\n"
    assert "\n2 skipped, 1 deselected in" in run_suite(tmp_path, after=once).stdout


def test_on_a_bare_machine_a_test_without_its_marker_fails(tmp_path: Path) -> None:
    bare = (sys.executable, "-m", "tests.bare_machine")
    ran = run_suite(tmp_path, suite=TOOLS, before=bare)
    failed = re.findall(r"^(?:FAILED|ERROR) test_suite.py::(\w+)", ran.stdout, re.MULTILINE)
    assert set(failed) == {"test_without_its_marker", "test_with_a_fixture_that_uses_a_tool_by_its_path"}
    assert "1 failed, 2 passed, 1 skipped, 1 error in" in ran.stdout


def test_a_unit_test_starts_no_program_and_uses_no_network(tmp_path: Path) -> None:
    root = Path(__file__).parents[1]
    (tmp_path / "guarded").mkdir()
    shutil.copy(root / "tests/unit/conftest.py", tmp_path / "guarded")
    (tmp_path / "guarded/test_guarded.py").write_text(GUARDED, encoding="utf-8")
    ran = run_suite(tmp_path)
    words = ran.stdout.split("short test summary info")[1]
    failed = {line.split("::")[1].split()[0] for line in words.splitlines() if "test_guarded.py::" in line}
    assert failed == {
        "test_that_starts_a_program_and_handles_the_error",
        "test_that_starts_a_program_in_a_thread",
        "test_with_a_fixture_that_starts_a_program",
        "test_that_uses_the_network",
        "test_that_needs_a_program",
    }
