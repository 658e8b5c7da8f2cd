"""Only processes that a build has started are terminated."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from forge.base.layout import PROCESSES_FILE
from forge.execution.started import BUILD_FOLDER_VARIABLE, START_VARIABLE, StartedProcesses

SLEEP = ["sleep", "60"]
ENDS_AND_LEAVES = ["sh", "-c", "sleep 60 >/dev/null & echo $!"]
MOVES_AWAY = ["sh", "-c", "setsid sleep 60 >/dev/null & sleep 0.2; echo $!; wait"]


@pytest.fixture
def started() -> Iterator[list[subprocess.Popen[str]]]:
    """Collect processes, and kill them at the end."""
    processes: list[subprocess.Popen[str]] = []
    yield processes
    for process in processes:
        process.kill()
        process.communicate()


def start(
    argv: list[str], build: Path | None = None, *, told: bool = False
) -> tuple[subprocess.Popen[str], int]:
    """Start a program in a new session and record it; also return the process id that it prints."""
    environment = {**os.environ, BUILD_FOLDER_VARIABLE: str(build)} if told else dict(os.environ)
    process = subprocess.Popen(
        argv, env=environment, stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    if build:
        StartedProcesses(build).note(process.pid)
    assert process.stdout is not None
    return process, int(process.stdout.readline()) if argv[0] == "sh" else process.pid


def runs(number: int) -> bool:
    """Tell whether a process is still running."""
    try:
        with open(f"/proc/{number}/stat", encoding="utf-8") as stat:  # noqa: PTH123
            return stat.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_processes_started_by_a_build_are_killed(
    tmp_path: Path, started: list[subprocess.Popen[str]]
) -> None:
    process, _ = start(SLEEP, tmp_path)
    started.append(process)
    StartedProcesses(tmp_path).end()
    assert process.wait(timeout=5) == -signal.SIGKILL


def test_processes_can_clean_up_after_sigterm(tmp_path: Path, started: list[subprocess.Popen[str]]) -> None:
    tidy = "trap 'echo tidied; exit 3' TERM; echo $$; while :; do sleep 0.05; done"
    process, _ = start(["sh", "-c", tidy], tmp_path)
    started.append(process)
    StartedProcesses(tmp_path).end(gently=True)
    assert process.wait(timeout=5) == 3


def test_a_process_that_only_inherits_the_variables_keeps_running(
    tmp_path: Path, started: list[subprocess.Popen[str]]
) -> None:
    """For example an editor, started in a shell that has sourced the environment of a step."""
    editor = subprocess.Popen(SLEEP, env={**os.environ, BUILD_FOLDER_VARIABLE: str(tmp_path)}, text=True)
    process, _ = start(SLEEP, tmp_path, told=True)
    started += [editor, process]
    StartedProcesses(tmp_path).end()
    assert process.wait(timeout=5) < 0
    assert editor.poll() is None


@pytest.mark.parametrize(("time_shift", "boot"), [(1, None), (0, "another")])
def test_a_process_with_a_reused_id_keeps_running(
    tmp_path: Path, started: list[subprocess.Popen[str]], time_shift: int, boot: str | None
) -> None:
    """Its start time differs, or the record is from another boot."""
    process, _ = start(SLEEP, tmp_path, told=True)
    started.append(process)
    number, begun, recorded_boot, namespace = (tmp_path / PROCESSES_FILE).read_text().split()
    record = f"{number} {int(begun) - time_shift} {boot or recorded_boot} {namespace}\n"
    (tmp_path / PROCESSES_FILE).write_text(record)
    StartedProcesses(tmp_path).end()
    assert process.poll() is None


def test_corrupt_records_are_ignored(tmp_path: Path) -> None:
    (tmp_path / PROCESSES_FILE).write_bytes(b"\xff\n1\n1 2 3 4 5 6\n-1 x\n\n12")
    StartedProcesses(tmp_path).end()


@pytest.mark.parametrize("told", [True, False])
def test_processes_left_in_a_session_are_killed(tmp_path: Path, *, told: bool) -> None:
    """It is killed only if it has the build's variable; otherwise, its id may have been reused."""
    process, child = start(ENDS_AND_LEAVES, tmp_path, told=told)
    process.wait()
    StartedProcesses(tmp_path).end()
    assert runs(child) is not told
    if not told:
        os.kill(child, signal.SIGKILL)
    process.communicate()


def test_descendants_in_other_sessions_are_killed(
    tmp_path: Path, started: list[subprocess.Popen[str]]
) -> None:
    process, child = start(MOVES_AWAY, tmp_path)
    started.append(process)
    StartedProcesses(tmp_path).end()
    assert not runs(child)


def test_descendants_are_found_after_their_parents_have_ended(tmp_path: Path) -> None:
    process, child = start(MOVES_AWAY, tmp_path)
    StartedProcesses(tmp_path).note_descendants()
    process.kill()
    process.communicate()
    assert runs(child)
    StartedProcesses(tmp_path).end()
    assert not runs(child)


ENDS_ITS_OWN = """import os, sys
from pathlib import Path
from forge.execution.started import StartedProcesses
started = StartedProcesses(Path(sys.argv[1]))
started.note(os.getppid())
started.note(os.getpid())
started.end()
print("there still", flush=True)
"""


def test_a_process_never_kills_its_own_parents(tmp_path: Path) -> None:
    """A forge started by a step of a killed one kills neither itself nor its parents."""
    line = f'"{sys.executable}" -c "$0" "{tmp_path}"; echo the shell as well'
    done = subprocess.run(
        ["sh", "-c", line, ENDS_ITS_OWN], capture_output=True, text=True, check=True, timeout=30
    )
    assert done.stdout == "there still\nthe shell as well\n"


def test_a_process_whose_start_could_not_be_recorded_is_killed(
    tmp_path: Path, started: list[subprocess.Popen[str]]
) -> None:
    """Its forge was killed between the start and the record."""
    token = StartedProcesses(tmp_path).announce()
    process = subprocess.Popen(SLEEP, env={**os.environ, START_VARIABLE: token}, text=True)
    started.append(process)
    StartedProcesses(tmp_path).end()
    assert process.wait(timeout=5) == -signal.SIGKILL


def test_a_daemon_of_a_recorded_process_keeps_running(
    tmp_path: Path, started: list[subprocess.Popen[str]]
) -> None:
    """For example the server of a compiler cache."""
    token = StartedProcesses(tmp_path).announce()
    environment = {**os.environ, START_VARIABLE: token}
    process = subprocess.Popen(SLEEP, env=environment, text=True, start_new_session=True)
    daemon = subprocess.Popen(SLEEP, env=environment, text=True, start_new_session=True)
    started += [process, daemon]
    StartedProcesses(tmp_path).note(process.pid, token)
    StartedProcesses(tmp_path).end()
    assert process.wait(timeout=5) == -signal.SIGKILL
    assert daemon.poll() is None
