"""The locks of build and install folders."""

import getpass
import re
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from forge.base.errors import WorkspaceError
from forge.base.layout import LAYOUT_MARKER, LOCK_FILE, PROCESSES_FILE
from forge.execution.lock import lock_build_dir, lock_install_dir
from forge.execution.started import StartedProcesses
from tests.conftest import Forge, Tree
from tests.testable import cmake_package

HOLD = """
import sys, time
from pathlib import Path
from forge.execution.lock import lock_build_dir, lock_install_dir
with lock_build_dir(Path(sys.argv[1])):
    print("holding", flush=True)
    sys.stdin.readline()
"""


def holder(build: Path) -> subprocess.Popen[str]:
    """Start a process that holds the lock until it reads a line."""
    argv = [sys.executable, "-c", HOLD, str(build)]
    process = subprocess.Popen(argv, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "holding\n"
    return process


def sleeper(build: Path) -> subprocess.Popen[bytes]:
    """Start a process like a build in that folder."""
    process = subprocess.Popen(["sleep", "60"], start_new_session=True)
    StartedProcesses(build).note(process.pid)
    return process


def test_processes_left_by_a_finished_build_keep_running(tmp_path: Path) -> None:
    with holder(tmp_path) as first, sleeper(tmp_path) as daemon:
        first.communicate("go\n")
        assert not (tmp_path / PROCESSES_FILE).exists()
        with lock_build_dir(tmp_path):
            assert daemon.poll() is None
        daemon.kill()


HOLD_INSTALL = HOLD.replace("with lock_build_dir", "with lock_install_dir")


@pytest.mark.parametrize(("kind", "lock"), [("build", lock_build_dir), ("install", lock_install_dir)])
def test_the_message_names_the_process_that_holds_the_lock(
    kind: str, lock: Callable[..., AbstractContextManager[float]], tmp_path: Path
) -> None:
    argv = [
        sys.executable,
        "-c",
        HOLD if kind == "build" else HOLD_INSTALL,
        str(tmp_path),
        "https://me:secret@x",
    ]
    with subprocess.Popen(argv, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        process.stdout.readline()
        with pytest.raises(WorkspaceError) as error, lock(tmp_path, wait=False):
            pass
        process.communicate("go\n")
    (problem,) = error.value.problems
    assert problem.message.startswith(f"the {kind} folder '{tmp_path}' is locked by process {process.pid} ('")
    assert re.search(rf"' of user '{getpass.getuser()}', since \d\d:\d\d:\d\d\)$", problem.message)
    assert "secret" not in problem.message


@pytest.mark.parametrize("content", ["4711", "{}", "[]", "nonsense", '{"pid": "x"}', '{"pid": 1, "uid": -5}'])
def test_an_unreadable_lock_description_is_not_an_error(content: str, tmp_path: Path) -> None:
    with holder(tmp_path) as first:
        (tmp_path / LOCK_FILE).write_text(content, encoding="utf-8")
        with pytest.raises(WorkspaceError) as error, lock_build_dir(tmp_path, wait=False):
            pass
        first.communicate("go\n")
    assert error.value.problems[0].message.endswith("is locked by another process")


@pytest.mark.slow
@pytest.mark.needs("cmake")
def test_lock_waiting_time_is_excluded_from_the_summary(built: Tree, forge: Forge) -> None:
    root = built(cmake_package("a", "add_test(NAME t COMMAND sh -c true)"))
    for command in ("build", "test"):
        with holder(root / "build") as first:
            release = threading.Timer(3, first.communicate, ("go\n",))
            release.start()
            ran = forge(command, cwd=root)
            release.join()
        found = re.search(r"^Summary: .*\[([\d.]+)s\]$", ran.out, re.MULTILINE)
        assert (ran.code, "waiting for process" in ran.err) == (0, True)
        assert found
        assert float(found[1]) < 3


@pytest.mark.needs("cmake", "ninja")
def test_builds_that_share_an_install_folder_wait_for_each_other(tree: Tree, forge: Forge) -> None:
    """Builds move the installed files of a package aside."""
    packages = [cmake_package(f"p{number}") for number in range(3)]
    root = tree({name: text for package in packages for name, text in package.items()})
    argv = [sys.executable, "-m", "forge", "build", "--force"]
    for _ in range(2):
        started = [
            subprocess.Popen(
                [*argv, "--build-base", base, "--log-base", f"log_{base}"],
                cwd=root,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
            )
            for base in ("one", "two")
        ]
        outputs = [process.communicate()[0] for process in started]
        assert [process.returncode for process in started] == [0, 0], outputs
    with lock_install_dir(root / "install"):
        ran = forge("build", "--no-wait", "--build-base", "two", cwd=root)
        assert ran.code == 2
        assert "the install folder" in ran.err
        assert "--install-base" in ran.err


def test_the_layout_is_checked_again_after_waiting(tree: Tree) -> None:
    root = tree(cmake_package("a"))
    (root / "install").mkdir()
    with lock_install_dir(root / "install"):
        argv = (sys.executable, "-m", "forge", "build")
        waiting = subprocess.Popen(
            argv, cwd=root, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True
        )
        assert waiting.stderr is not None
        assert "to release the lock on the install folder" in waiting.stderr.readline()
        (root / "install" / LAYOUT_MARKER).write_text("merged\n")
    _, message = waiting.communicate()
    assert waiting.returncode == 2
    assert "has the merged layout, not the isolated one" in message
