"""What goes wrong around a build: signals, closed terminals, floods, full disks, vanishing files, neighbours.

Each promise has a test that injects the fault into a real build, reads what is said, takes the fault away,
builds once more and compares with a clean build. `make soak` repeats random faults as often as
FORGE_TEST_FAULTS says, and lets a step print FORGE_TEST_FLOOD megabytes.
"""

import os
import pty
import random
import re
import select
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

import pytest

from forge.base.layout import LOCK_FILE
from forge.execution.started import BUILD_FOLDER_VARIABLE
from tests.conftest import Tree
from tests.evolving import differences, look
from tests.packages import manifest_text, write_files
from tests.snippets import ROOT

pytestmark = pytest.mark.needs("cmake")

FAULTS = int(os.environ.get("FORGE_TEST_FAULTS", "1"))
FLOOD = int(os.environ.get("FORGE_TEST_FLOOD", "24"))
"""Megabytes that one step prints."""
SEED = int(os.environ.get("FORGE_TEST_SEED", "1"))

_CMAKE = """cmake_minimum_required(VERSION 3.18)
project({name} NONE)
set(here ${{CMAKE_CURRENT_SOURCE_DIR}})
add_custom_target(all_of_it ALL COMMAND sh ${{here}}/work.sh ${{here}})
install(FILES ${{CMAKE_CURRENT_BINARY_DIR}}/made.txt DESTINATION share/{name})
install(FILES said.txt DESTINATION share/{name})
"""
PLAIN = "cat $1/said.txt > made.txt"
WAITING = "touch $1/../../ready; while [ -e $1/../../wait ]; do sleep 0.05; done; cat $1/said.txt > made.txt"
STUBBORN = """trap '' INT TERM HUP
setsid sh -c "trap '' TERM; while :; do sleep 0.1; done" &
touch $1/../../ready
while [ -e $1/../../wait ]; do sleep 0.1; done
"""


def package(name: str, work: str = PLAIN, *depends: str) -> dict[str, str]:
    needs = (f"<depend>{need}</depend>" for need in depends)
    return {
        f"src/{name}/package.xml": manifest_text(name, *needs, build_type="cmake"),
        f"src/{name}/CMakeLists.txt": _CMAKE.format(name=name),
        f"src/{name}/work.sh": work,
        f"src/{name}/said.txt": f"{name} one\n",
    }


def command(*options: str) -> list[str]:
    return [sys.executable, "-m", "forge", "build", *options]


def environment() -> dict[str, str]:
    """Return ours, with this forge."""
    return {**os.environ, "PYTHONPATH": str(ROOT)}


def start(root: Path, *options: str, **more: int) -> subprocess.Popen[str]:
    """Start a build, with pipes for both streams unless told otherwise."""
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **more}
    return subprocess.Popen(command(*options), cwd=root, env=environment(), text=True, **streams)  # type: ignore[call-overload,no-any-return]


def run(root: Path, *options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command(*options), cwd=root, env=environment(), capture_output=True, text=True, check=False
    )


def mended(root: Path) -> None:
    """Build once more, plainly; the result must be that of a clean build in the same place."""
    ran = run(root)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    found = look(root / "install")
    parked = root.with_name(f"{root.name} parked")
    root.rename(parked)
    shutil.copytree(parked / "src", root / "src", symlinks=True)
    clean = run(root)
    assert clean.returncode == 0, clean.stdout + clean.stderr
    wrong = differences(found, look(root / "install"))
    shutil.rmtree(root)
    parked.rename(root)
    assert not wrong, wrong


def until(done: object, seconds: float = 30) -> None:
    """Wait until a path is there, or a question is answered with yes."""
    end = time.monotonic() + seconds
    while not (done.exists() if isinstance(done, Path) else done()):  # type: ignore[operator]
        assert time.monotonic() < end, f"{done} did not come true"
        time.sleep(0.02)


def living(root: Path) -> dict[int, str]:
    """Return the programs that builds of a workspace have left running, by their ids."""
    mark = f"{BUILD_FOLDER_VARIABLE}={root / 'build'}".encode()
    found = {}
    for path in Path("/proc").glob("[0-9]*/environ"):
        with suppress(OSError):
            if mark in path.read_bytes().split(b"\0"):
                found[int(path.parent.name)] = (path.parent / "cmdline").read_text().replace("\0", " ")
    return found


@pytest.fixture
def waiting(tree: Tree) -> Path:
    """Return a workspace that was built, and in which b will wait in the middle of its next build."""
    root = tree({f"ws/{name}": text for name, text in {**package("a"), **package("b", WAITING, "a")}.items()})
    home = root / "ws"
    assert run(home).returncode == 0
    for name in ("a", "b"):
        (home / f"src/{name}/said.txt").write_text(f"{name} two\n")
    (home / "ready").unlink()
    (home / "wait").touch()
    return home


def is_as_before(root: Path) -> bool:
    """Tell if b is installed as it was, a anew, and if the notes say so."""
    said = [(root / f"install/{name}/share/{name}/said.txt").read_text() for name in ("a", "b")]
    notes = [(root / f"build/{name}/colcon_build.rc").read_text() for name in ("a", "b")]
    whole = (root / "install/b/share/b/package.sh").is_file()
    return (said, notes, whole) == (["a two\n", "b one\n"], ["0\n", "SIGINT\n"], True)


# -- Processes


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_all_programs_and_keeps_records_valid(waiting: Path, number: signal.Signals) -> None:
    with start(waiting) as process:
        until(waiting / "ready")
        process.send_signal(number)
        out, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "Aborted  <<< b" in out
    assert "Traceback" not in err
    assert not living(waiting)
    assert is_as_before(waiting)
    if number == signal.SIGTERM:
        (waiting / "wait").unlink()
        mended(waiting)


@pytest.mark.parametrize("view", ["lines", "plain"])
def test_a_closed_terminal_ends_the_build(waiting: Path, view: str) -> None:
    ours, theirs = pty.openpty()
    kind = {"TERM": "xterm" if view == "lines" else "dumb"}
    process = subprocess.Popen(
        # A shell of its own session takes the terminal, as one in a window does.
        ["setsid", "--ctty", "--wait", *command()],
        cwd=waiting,
        env={**environment(), **kind},
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
    )
    os.close(theirs)
    while not (waiting / "ready").exists():
        if select.select([ours], [], [], 0.05)[0]:
            os.read(ours, 65536)
    os.close(ours)
    process.wait(timeout=30)
    until(lambda: not living(waiting))
    until(lambda: (waiting / "build" / LOCK_FILE).read_text() == "")
    assert is_as_before(waiting)


def test_a_closed_output_pipe_ends_the_build(waiting: Path) -> None:
    write_files(waiting, package("c", PLAIN, "b"))
    with start(waiting) as process:
        until(waiting / "ready")
        assert process.stdout is not None
        process.stdout.close()
        (waiting / "wait").unlink()
        assert process.stderr is not None
        assert "Traceback" not in process.stderr.read()
        process.wait(timeout=30)
    assert process.returncode == 130
    assert not living(waiting)
    assert (waiting / "install/b/share/b/said.txt").read_text() == "b two\n"
    assert not (waiting / "install/c/share/c/package.sh").exists()
    mended(waiting)


def test_nohup_is_respected(waiting: Path) -> None:
    process = subprocess.Popen(
        ["nohup", *command()], cwd=waiting, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    until(waiting / "ready")
    process.send_signal(signal.SIGHUP)
    time.sleep(0.3)
    assert process.poll() is None
    (waiting / "wait").unlink()
    process.communicate(timeout=30)
    assert process.returncode == 0


REPEATS = """
. build/b/.forge/environment.sh || exit 9
exec 3<>"$1"
sleep 60 >/dev/null &
editor=$!
echo ready
read said <&3
shift
"$@"
echo "forge ended with $?, the shell goes on"
kill "$editor" && wait "$editor"; echo "so does the editor: $?"
"""
"""A shell that has sourced what a failed step says, starts an editor, and then builds again."""


@contextmanager
def shell_of_a_user(home: Path, *argv: str) -> Iterator[subprocess.Popen[str]]:
    """Start it; it builds when a line is written to HOME/go."""
    os.mkfifo(home / "go")
    words = ["bash", "-c", REPEATS, "bash", str(home / "go"), *argv]
    with subprocess.Popen(
        words, cwd=home, env=environment(), stdout=subprocess.PIPE, text=True, start_new_session=True
    ) as shell:
        assert shell.stdout is not None
        assert shell.stdout.readline() == "ready\n"
        try:
            yield shell
        except BaseException:
            os.killpg(shell.pid, signal.SIGKILL)  # or the test would wait for it for ever
            raise


def go(home: Path) -> None:
    with (home / "go").open("w") as stream:
        stream.write("\n")


def test_unrelated_processes_survive_the_build_after_a_kill(waiting: Path) -> None:
    with start(waiting) as process:
        until(waiting / "ready")
        time.sleep(0.2)  # a program may get that far before forge has recorded it
        process.kill()
        process.communicate()
    left = living(waiting)
    assert left, "a killed forge ends nothing"
    (waiting / "ready").unlink()
    with shell_of_a_user(waiting, *command()) as shell:
        go(waiting)
        until(waiting / "ready")
        assert not left.keys() & living(waiting).keys(), "what the first one had started has been ended"
        (waiting / "wait").unlink()
        out, _ = shell.communicate(timeout=60)
    assert "forge ended with 0, the shell goes on\nso does the editor: 143\n" in out
    mended(waiting)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_unrelated_processes_survive_an_interrupt(waiting: Path, number: signal.Signals) -> None:
    with start(waiting) as process, shell_of_a_user(waiting, "true") as shell:
        until(waiting / "ready")
        process.send_signal(number)
        process.communicate(timeout=60)
        assert process.returncode == 130
        go(waiting)
        out, _ = shell.communicate(timeout=60)
    assert "the shell goes on\nso does the editor: 143\n" in out
    assert not living(waiting)


def test_programs_that_ignore_signals_are_killed_in_any_session(waiting: Path) -> None:
    (waiting / "src/b/work.sh").write_text(STUBBORN)
    begun = time.monotonic()
    with start(waiting) as process:
        until(waiting / "ready")
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=60)
    assert process.returncode == 130
    assert time.monotonic() - begun < 40
    assert not living(waiting)
    assert is_as_before(waiting)


def test_a_second_signal_kills_immediately(waiting: Path) -> None:
    (waiting / "src/b/work.sh").write_text(STUBBORN)
    with start(waiting) as process:
        until(waiting / "ready")
        begun = time.monotonic()
        process.send_signal(signal.SIGINT)
        time.sleep(0.3)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    assert process.returncode == 130
    assert time.monotonic() - begun < 6
    assert not living(waiting)


PEAK = """
import resource, subprocess, sys
code = subprocess.call(sys.argv[2:])
with open(sys.argv[1], "w") as said:
    said.write(str(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss))
sys.exit(code)
"""
"""Writes the peak memory of a command in kilobytes; apart, for a child begins with the peak of its parent."""


@pytest.mark.parametrize(
    "flood",
    [
        f"yes 'a line as a compiler prints it when it has much to say of a template' | head -c {FLOOD}M",
        f"head -c {FLOOD}M /dev/zero | tr '\\0' x",
        f"head -c {FLOOD}M /dev/urandom >&2",
    ],
    ids=["lines", "a line without end", "bytes on stderr"],
)
def test_huge_output_is_logged_in_bounded_memory(tree: Tree, flood: str) -> None:
    root = tree(package("a", f"{flood}\n{PLAIN}"))
    (root / "src/a/CMakeLists.txt").write_text(
        (root / "src/a/CMakeLists.txt").read_text().replace(" ALL COMMAND", " ALL USES_TERMINAL COMMAND")
    )
    argv = (sys.executable, "-c", PEAK, str(root / "peak"), *command())
    with (root / "out").open("wb") as out, (root / "err").open("wb") as err:
        subprocess.run(argv, cwd=root, env=environment(), stdout=out, stderr=err, check=True)
    logged = (root / "log/latest/a/stdout_stderr.log").stat().st_size
    assert logged >= FLOOD * 1024 * 1024
    kilobytes = int((root / "peak").read_text())
    assert kilobytes < 150 * 1024, "of forge, and of each program that it started"


# -- Disks and files


@contextmanager
def small_disk(folder: Path, kilobytes: int) -> Iterator[bool]:
    """Put a small file system where a folder is; where nobody may, a limit on sizes of files has to do."""
    folder.mkdir(parents=True, exist_ok=True)
    mount = ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", str(folder)]
    mounted = subprocess.run(mount, capture_output=True, check=False).returncode == 0
    try:
        yield mounted
    finally:
        mounts = Path("/proc/mounts").read_text(encoding="utf-8") if mounted else ""
        # A build may have renamed a folder above.
        for path in re.findall(rf"^tmpfs ({folder.parents[1]}/\S+)", mounts, re.MULTILINE):
            subprocess.run(["umount", "--lazy", path], check=True)


def grown(folder: Path, options: str) -> None:
    """Change how the small disk is mounted."""
    subprocess.run(["mount", "-o", f"remount,{options}", str(folder)], check=True)


BIG = f"{PLAIN}\nhead -c 3000000 /dev/zero >> made.txt\n"
CHATTY = "yes 'many words' | head -c 3000000\n" + PLAIN


@pytest.mark.parametrize("base", ["build", "install", "log"])
def test_a_full_disk_is_reported_and_leaves_no_partial_state(tree: Tree, base: str) -> None:
    root = tree({f"ws/{name}": text for name, text in package("a").items()}) / "ws"
    with small_disk(root / base, 900) as mounted:
        assert run(root).returncode == 0
        (root / "src/a/work.sh").write_text(CHATTY if base == "log" else BIG)
        (root / "src/a/said.txt").write_text("two\n")
        argv = command() if mounted else ["sh", "-c", 'ulimit -f 1800; exec "$@"', "sh", *command()]
        ran = subprocess.run(argv, cwd=root, env=environment(), capture_output=True, text=True, check=False)
        said = ran.stdout + ran.stderr
        assert ran.returncode in {1, 2}, said
        assert "Traceback" not in said
        assert re.search("no space left|file too large|write error|disk is full", said, re.IGNORECASE), said
        installed = root / "install/a/share/a"
        whole = (installed / "package.sh").is_file()
        # Without a disk for logs, the package may be built to its end before the build is stopped.
        texts = {"a one\n", "two\n"} if base == "log" else {"a one\n"}
        assert not whole or (installed / "said.txt").read_text() in texts
        assert not living(root)
        if mounted:
            grown(root / base, "size=60m")
        ran = run(root)
        assert ran.returncode == 0, ran.stdout + ran.stderr
        found = look(root / "install")
    for name in ("build", "install", "log"):
        shutil.rmtree(root / name)
    assert run(root).returncode == 0
    assert not differences(found, look(root / "install"))


@pytest.mark.parametrize("base", ["build", "install"])
def test_a_full_disk_during_a_python_install_gives_one_error_with_a_path(tree: Tree, base: str) -> None:
    root = tree(
        {
            "ws/src/p/package.xml": manifest_text("p", build_type="ament_python"),
            "ws/src/p/setup.py": "from setuptools import setup\nfrom glob import glob\n"
            "setup(name='p', version='1', py_modules=['p'], data_files=[('share/p', glob('d/*'))])\n",
            "ws/src/p/p.py": "",
            **{f"ws/src/p/d/{number}": f"{number:04}\n" * 10000 for number in range(20)},
        }
    )
    root /= "ws"
    for kilobytes in (4, 500, 900, 1600):
        with small_disk(root / base, kilobytes) as mounted:
            if not mounted:
                pytest.skip("needs permission to mount")
            ran = run(root)
            said = ran.stdout + ran.stderr
            assert "Traceback" not in said, (kilobytes, said)
            if ran.returncode:
                assert re.search(rf"error: .*{root / base}/.*no space left on device", said), (
                    kilobytes,
                    said,
                )
    assert run(root).returncode == 0


@pytest.mark.parametrize("part", ["build/p/d", "install/p/d"])
def test_a_mount_that_cannot_be_removed_gives_one_error_with_its_path(tree: Tree, part: str) -> None:
    root = tree({f"ws/{name}": text for name, text in package("p").items()}) / "ws"
    assert run(root).returncode == 0
    with small_disk(root / part, 100) as mounted:
        if not mounted:
            pytest.skip("needs permission to mount")
        (root / part / "precious").write_text("mine")
        (root / "src/p/said.txt").write_text("two\n")
        for words in ((), ("--force",), ("--symlink-install", "--force")):
            ran = run(root, *words)
            assert "Traceback" not in ran.stderr, ran.stderr
            assert ran.returncode in {0, 1, 2}
            assert ran.returncode == 0 or f"{root}/{part.partition('/')[0]}/" in ran.stderr, ran.stderr
        assert [path.read_text() for path in root.rglob("precious")] == ["mine"]


def test_an_unwritable_install_folder_is_reported(tree: Tree) -> None:
    root = tree({f"ws/{name}": text for name, text in package("a").items()}) / "ws"
    with small_disk(root / "install", 9000) as mounted:
        assert run(root).returncode == 0
        (root / "src/a/said.txt").write_text("two\n")
        if mounted:
            grown(root / "install", "ro")
        else:
            subprocess.run(["chmod", "-R", "a-w", str(root / "install")], check=True)
        ran = run(root)
        assert ran.returncode in {1, 2}, ran.stdout
        assert "Traceback" not in ran.stderr
        assert re.search("read-only|permission denied", ran.stderr, re.IGNORECASE)
        assert (root / "install/a/share/a/said.txt").read_text() == "a one\n"
        if mounted:
            grown(root / "install", "rw")
        else:
            subprocess.run(["chmod", "-R", "u+w", str(root / "install")], check=True)
        assert run(root).returncode == 0
        assert (root / "install/a/share/a/said.txt").read_text() == "two\n"


def test_a_removed_working_folder_is_reported(tmp_path: Path) -> None:
    gone = tmp_path / "gone"
    gone.mkdir()
    words = f"cd '{gone}' && rmdir '{gone}' && exec \"$@\""
    ran = subprocess.run(
        ["sh", "-c", words, "sh", *command()], env=environment(), capture_output=True, text=True, check=False
    )
    assert ran.returncode == 2
    assert (
        ran.stderr == "error: the current folder has been removed\nhint: change to an existing folder: cd\n"
    )


def test_a_workspace_removed_during_the_build_is_reported(waiting: Path) -> None:
    with start(waiting) as process:
        until(waiting / "ready")
        shutil.rmtree(waiting, ignore_errors=True)
        out, err = process.communicate(timeout=60)
    assert process.returncode in {1, 2}, out + err
    assert "Traceback" not in err
    assert "Failed   <<< b" in err or "disappeared" in err


def test_files_changed_during_a_build_are_built_next_time(waiting: Path) -> None:
    with start(waiting) as process:
        until(waiting / "ready")
        (waiting / "src/a/said.txt").write_text("a three\n")
        (waiting / "src/b/more.txt").write_text("new\n")
        (waiting / "src/b/said.txt").unlink()
        (waiting / "wait").unlink()
        out, err = process.communicate(timeout=60)
    assert process.returncode == 1, out
    assert "Failed   <<< b" in err
    assert "Traceback" not in err
    (waiting / "src/b/said.txt").write_text("b three\n")
    mended(waiting)


def test_files_may_change_or_disappear_while_being_read(tree: Tree) -> None:
    root = tree({f"ws/{name}": text for name, text in package("a").items()}) / "ws"
    stop = threading.Event()

    def fidget() -> None:
        chance = random.Random(SEED)
        while not stop.is_set():
            path = root / f"src/a/{chance.choice('xyz')}/{chance.randrange(20)}"
            with suppress(OSError):
                path.parent.mkdir(exist_ok=True)
                path.write_bytes(b"x" * chance.randrange(100_000))
                chance.choice((path.unlink, path.touch, partial(shutil.rmtree, path.parent)))()

    thread = threading.Thread(target=fidget)
    thread.start()
    try:
        for _ in range(2):
            ran = run(root)
            assert ran.returncode == 0, ran.stderr
    finally:
        stop.set()
        thread.join()
    mended(root)


# -- Neighbours


def test_a_second_build_waits_or_fails_as_requested(waiting: Path) -> None:
    with start(waiting) as first:
        until(waiting / "ready")
        refused = run(waiting, "--no-wait")
        assert refused.returncode == 2
        assert f"error: the build folder '{waiting}/build' is locked by process {first.pid}" in refused.stderr
        with start(waiting) as second:
            assert second.stderr is not None
            assert f"waiting for process {first.pid}" in second.stderr.readline()
            (waiting / "wait").unlink()
            assert first.wait(timeout=30) == 0
            first.communicate()
            out, _ = second.communicate(timeout=30)
        assert second.returncode == 0
        assert "2 packages unchanged" in out
    mended(waiting)


def test_waiting_for_the_lock_can_be_interrupted(waiting: Path) -> None:
    with start(waiting) as first:
        until(waiting / "ready")
        with start(waiting) as second:
            assert second.stderr is not None
            second.stderr.readline()
            second.send_signal(signal.SIGTERM)
            assert second.wait(timeout=10) == 130
        (waiting / "wait").unlink()
        first.communicate(timeout=30)
    assert first.returncode == 0


def test_builds_in_different_folders_run_concurrently(waiting: Path) -> None:
    with start(waiting) as first:
        until(waiting / "ready")
        with start(waiting, "--build-base", "b2", "--install-base", "i2", "--packages-select", "a") as second:
            second.communicate(timeout=60)
        assert second.returncode == 0
        assert first.poll() is None
        (waiting / "wait").unlink()
        first.communicate(timeout=30)
    assert first.returncode == 0
    mended(waiting)


def test_tests_and_builds_exclude_each_other(waiting: Path) -> None:
    with start(waiting) as first:
        until(waiting / "ready")
        argv = [sys.executable, "-m", "forge", "test", "--no-wait"]
        ran = subprocess.run(
            argv, cwd=waiting, env=environment(), capture_output=True, text=True, check=False
        )
        assert (ran.returncode, f"locked by process {first.pid}" in ran.stderr) == (2, True)
        (waiting / "wait").unlink()
        first.communicate(timeout=30)


def test_stale_locks_do_not_block(tree: Tree) -> None:
    root = tree(package("a"))
    assert run(root).returncode == 0
    (root / "build" / LOCK_FILE).write_text("4194303")
    ran = run(root, "--no-wait")
    assert (ran.returncode, ran.stderr) == (0, "")


# -- Anything, at any time


def test_random_faults_leave_a_correct_workspace(tree: Tree) -> None:
    chance = random.Random(f"{SEED} faults")
    files = {**package("a"), **package("b", BIG, "a"), **package("c", PLAIN, "b")}
    root = tree({f"ws/{name}": text for name, text in files.items()}) / "ws"
    begun = time.monotonic()
    assert run(root).returncode == 0
    lasts = time.monotonic() - begun
    signals = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)
    for fault in range(FAULTS):
        for name in chance.sample("abc", 2):
            (root / f"src/{name}/said.txt").write_text(f"{name} {fault}\n")
        kind = chance.choice(("signal", "size", "closed"))
        limit = chance.choice((0, 1, 4, 64, 1024)) if kind == "size" else 1_000_000
        argv = ["sh", "-c", f'ulimit -f {limit}; exec "$@"', "sh", *command()]
        process = subprocess.Popen(
            argv, cwd=root, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        with suppress(subprocess.TimeoutExpired):
            process.wait(timeout=chance.uniform(0.05, lasts) if kind != "size" else 60)
        if kind == "signal":
            process.send_signal(chance.choice(signals))
        elif kind == "closed":
            assert process.stdout is not None
            process.stdout.close()
            process.stdout = None
        _, err = process.communicate(timeout=60)
        assert "Traceback" not in err, f"fault {fault}, {kind}: {err}"
        mended(root)
