"""`forge build --watch`: a real process, real saves, and the line that tells how each went."""

import os
import queue
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.conftest import Tree
from tests.packages import manifest_text
from tests.snippets import ROOT

pytestmark = pytest.mark.needs("cmake")

_CMAKE = """cmake_minimum_required(VERSION 3.18)
project({name} NONE)
add_custom_target(all_of_it ALL COMMAND sleep {seconds})
install(FILES said.txt DESTINATION share/{name})
{more}
"""
LINE = re.compile(r"^\d\d:\d\d:\d\d (.*)$")
REBUILT = re.compile(r"(.*) rebuilt in [0-9.smin ]+")


def package(name: str, *depends: str, seconds: float = 0, more: str = "") -> dict[str, str]:
    """Return a package that installs what a file says."""
    needs = (f"<depend>{need}</depend>" for need in depends)
    return {
        f"src/{name}/package.xml": manifest_text(name, *needs, build_type="cmake"),
        f"src/{name}/CMakeLists.txt": _CMAKE.format(name=name, seconds=seconds, more=more),
        f"src/{name}/said.txt": "one\n",
    }


class Watch:
    """A running `forge build --watch` and what it says, line by line as it comes."""

    def __init__(self, root: Path, *options: str, prefix: tuple[str, ...] = ()) -> None:
        argv = [*prefix, sys.executable, "-m", "forge", "build", "--watch", *options]
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"}
        self.process = subprocess.Popen(
            argv, cwd=root, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        self.said: list[str] = []
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._lines.put(line.rstrip("\n"))
        self._lines.put(None)

    def line(self, seconds: float = 30) -> str:
        """Return the next line that has a clock in front, without that; what else is said is kept."""
        end = time.monotonic() + seconds
        while True:
            try:
                said = self._lines.get(timeout=max(0.0, end - time.monotonic()))
            except queue.Empty:
                raise AssertionError("\n".join(("nothing came, but:", *self.said))) from None
            assert said is not None, "\n".join(("it ended:", *self.said))
            self.said.append(said)
            if found := LINE.match(said):
                return found[1]

    def is_silent(self, seconds: float) -> bool:
        """Tell if nothing is said for so long."""
        try:
            said = self._lines.get(timeout=seconds)
        except queue.Empty:
            return True
        self.said.append(str(said))
        return False

    def nothing(self, path: Path) -> None:
        """Touch a file or make a folder, and see that forge says it need not build."""
        time.sleep(0.5)  # what comes right after a build may be its own doing, and is not told of
        path.touch() if path.is_file() else path.mkdir()
        assert self.line() == "nothing to do"

    def rebuilt(self) -> str:
        line = self.line()
        found = REBUILT.fullmatch(line)
        assert found, "\n".join((line, *self.said))
        return found[1]

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        self._reader.join()
        assert self.process.stdout is not None
        self.process.stdout.close()

    def end(self, number: signal.Signals = signal.SIGINT) -> int:
        """Interrupt it and return its exit code."""
        self.process.send_signal(number)
        return self.process.wait(timeout=20)


@contextmanager
def watching(root: Path, *options: str, prefix: tuple[str, ...] = ()) -> Iterator[Watch]:
    """Start a watch, wait until it watches, and see it out."""
    watch = Watch(root, *options, prefix=prefix)
    try:
        while not re.match(r"watching \d+ folders; press Ctrl-C to stop", watch.line(60)):
            pass
        yield watch
    finally:
        watch.close()


def replace(path: Path, text: str) -> None:
    """Save as most editors do: write beside it, then take its place."""
    beside = path.with_name(f"{path.name}~")
    beside.write_text(text)
    beside.replace(path)


def test_each_save_is_built_and_reported_in_one_line(tree: Tree) -> None:
    root = tree({**package("a"), **package("b", "a"), **package("c", "b"), **package("other")})
    with watching(root) as watch:
        assert any(said.startswith("Summary: 4 packages finished") for said in watch.said)
        before = len(watch.said)
        (root / "src/b/said.txt").write_text("two\n")
        assert watch.rebuilt() == "b and 1 more", "b came out different, so c is built again"
        assert len(watch.said) == before + 1
        assert (root / "install/b/share/b/said.txt").read_text() == "two\n"
        replace(root / "src/c/said.txt", "three\n")
        assert watch.rebuilt() == "c"
        assert (root / "install/c/share/c/said.txt").read_text() == "three\n"
        (root / "src/a/notes").mkdir()
        assert watch.rebuilt() == "a", "a package may install its folders, empty ones too"
        (root / "src/a/notes/new.txt").write_text("in a folder that was not there when the watch began")
        assert watch.rebuilt() == "a"
        watch.nothing(root / "src/a/said.txt")
        assert watch.end() == 0, "waiting is not interrupted, it ends"


def test_files_written_by_forge_git_and_editors_trigger_no_build(tree: Tree) -> None:
    root = tree({**package("a"), "src/a/.git/HEAD": "x", "src/.git/HEAD": "x"})
    with watching(root) as watch:
        for name in (
            *(
                "src/a/.git/index",
                "src/.git/index",
                "src/a/.said.txt.swp",
                "src/a/said.txt~",
                "src/a/#said.txt#",
            ),
            *("build/a/x.o", "build/new", "install/a/x", "install/new", "log/new", "src/notes.txt", "todo"),
        ):
            (root / name).write_text("x")
        (root / "src/a/__pycache__").mkdir()
        assert watch.is_silent(0.8), watch.said
        (root / "src/a/said.txt").write_text("two\n")
        assert watch.rebuilt() == "a"


def test_packages_can_be_added_and_removed(tree: Tree) -> None:
    root = tree({**package("a"), **package("b")})
    with watching(root) as watch:
        tree(package("c", "a"))
        while not (root / "install/c/share/c/package.sh").exists():
            watch.line()
        (root / "src/c/said.txt").write_text("two\n")
        assert watch.rebuilt() == "c"
        (root / "src/b/package.xml").write_text("<package")
        assert watch.line() == "nothing was built; waiting for the next change"
        assert any(said.startswith("src/b/package.xml:1") for said in watch.said)
        (root / "src/b/package.xml").write_text(manifest_text("b", "<depend>a</depend>", build_type="cmake"))
        assert watch.rebuilt() == "b"
        (root / "src/a/said.txt").write_text("two\n")
        assert watch.rebuilt() == "a and 2 more", "b needs a from now on"
        time.sleep(0.5)
        shutil.rmtree(root / "src/c")
        assert watch.line() == "nothing to do"
        (root / "src/d").mkdir()
        (root / "src/a").rename(root / "src/d/moved")
        assert watch.rebuilt().startswith("a")
        (root / "src/d/moved/said.txt").write_text("three\n")
        assert watch.rebuilt() == "a and 1 more"


def test_failures_are_reported_and_fixed_by_the_next_save(tree: Tree) -> None:
    root = tree({**package("a"), **package("b", "a")})
    with watching(root) as watch:
        good = (root / "src/a/CMakeLists.txt").read_text()
        (root / "src/a/CMakeLists.txt").write_text(f'{good}\nmessage(FATAL_ERROR "no luck")\n')
        line = watch.line()
        assert line.startswith(("a failed, 1 not built in ", "a failed in ")), line
        assert any("CMake Error at src/a/CMakeLists.txt" in said for said in watch.said)
        assert any(said.startswith("  repeat: ") for said in watch.said)
        (root / "src/a/CMakeLists.txt").open("a").close()
        assert watch.is_silent(0.3)
        (root / "src/a/CMakeLists.txt").write_text(f"{good}\n")
        assert watch.rebuilt() == "a"


def test_a_failing_package_is_not_rebuilt_without_a_change(tree: Tree) -> None:
    """Neither the first build nor late events of a save repeat it; polling checks all files once more."""
    root = tree(package("a", more='message(FATAL_ERROR "no luck")'))
    with watching(root, prefix=("env", "WATCHFILES_FORCE_POLLING=1")) as watch:
        assert sum(said.startswith("Failed   <<< a ") for said in watch.said) == 1
        assert watch.is_silent(2.5), watch.said
        good = (root / "src/a/CMakeLists.txt").read_text().replace("message(", "# message(")
        (root / "src/a/CMakeLists.txt").write_text(good)
        assert watch.rebuilt() == "a"


def installed(root: Path) -> tuple[str, ...]:
    """Return what the packages of the next test have installed; nothing in the moment of a change."""
    paths = [root / f"install/{name}/share/{name}/said.txt" for name in ("slow", "quick")]
    return tuple(path.read_text() if path.exists() else "" for path in paths)


def test_a_save_during_a_build_is_not_lost(tree: Tree) -> None:
    root = tree({**package("slow", seconds=0.6), **package("quick")})
    with watching(root) as watch:
        said = root / "src/slow/said.txt"
        said.write_text("two\n")
        time.sleep(0.4)
        said.write_text("three\n")
        (root / "src/quick/said.txt").write_text("two\n")
        end = time.monotonic() + 20
        while time.monotonic() < end and installed(root) != ("three\n", "two\n"):
            time.sleep(0.05)
        assert installed(root) == ("three\n", "two\n"), watch.said


def test_only_selected_packages_are_built(tree: Tree) -> None:
    root = tree({**package("a"), **package("b", "a"), **package("other")})
    with watching(root, "--packages-up-to", "b") as watch:
        watch.nothing(root / "src/other/said.txt")
        time.sleep(0.5)
        (root / "src/other/said.txt").write_text("two\n")
        assert watch.line() == "nothing to do"
        (root / "src/a/said.txt").write_text("two\n")
        assert watch.rebuilt() == "a and 1 more"
        assert not (root / "install/other").exists()


def test_other_builds_can_run_between_saves(tree: Tree) -> None:
    root = tree(package("a"))
    with watching(root) as watch:
        argv = [sys.executable, "-m", "forge", "build", "--force"]
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        other = subprocess.run(argv, cwd=root, env=environment, capture_output=True, text=True, check=False)
        assert (other.returncode, other.stderr) == (0, "")
        assert watch.is_silent(0.3)
        (root / "src/a/said.txt").write_text("two\n")
        assert watch.rebuilt() == "a"


def test_linked_folders_and_files_are_watched(tree: Tree, tmp_path: Path) -> None:
    root = tree({**{f"a space/{name}": text for name, text in package("a").items()}, "far/x": ""})
    home = root / "a space"
    (home / "src/a").rename(root / "far/a")
    (home / "src/a").symlink_to(root / "far/a")
    (root / "far/said elsewhere.txt").write_text("one\n")
    (root / "far/a/said.txt").unlink()
    (root / "far/a/said.txt").symlink_to(root / "far/said elsewhere.txt")
    with watching(home) as watch:
        replace(tmp_path / "far/said elsewhere.txt", "two\n")
        assert watch.rebuilt() == "a"
        assert (home / "install/a/share/a/said.txt").read_text() == "two\n"
        (root / "far/a/new.txt").write_text("x")
        assert watch.rebuilt() == "a"


def test_one_time_options_apply_only_to_the_first_build(tree: Tree) -> None:
    root = tree(package("a"))
    with watching(root, "--force", "--cmake-clean-cache") as watch:
        assert watch.is_silent(0.5)
        watch.nothing(root / "src/a/said.txt")
        (root / "forge.toml").write_text('[build]\ncmake-args = ["-DSAID=1"]\n')
        assert watch.rebuilt() == "a", "options in files are read again"


def test_packages_that_write_to_their_sources_cause_no_build_loop(tree: Tree) -> None:
    stamp = 'execute_process(COMMAND sh -c "date +%N > ${CMAKE_CURRENT_SOURCE_DIR}/stamp.txt")'
    root = tree(package("a", more=f'install(CODE "{stamp.replace(chr(34), chr(92) + chr(34))}")'))
    with watching(root) as watch:
        (root / "src/a/said.txt").write_text("two\n")
        end = time.monotonic() + 6
        while time.monotonic() < end and not any("consecutive builds" in said for said in watch.said):
            watch.line()
        assert any("'src/a/stamp.txt' changed during 5 consecutive builds" in said for said in watch.said)


@pytest.mark.needs("pgrep")
def test_an_interrupt_ends_watch_mode_with_130(tree: Tree) -> None:
    root = tree(package("a", seconds=0))
    with watching(root) as watch:
        text = (root / "src/a/CMakeLists.txt").read_text()
        (root / "src/a/CMakeLists.txt").write_text(text.replace("sleep 0", "sleep 77.31"))
        search = ["pgrep", "-f", "sleep 77.31"]
        end = time.monotonic() + 30
        while subprocess.run(search, capture_output=True, check=False).returncode and time.monotonic() < end:
            time.sleep(0.1)
        assert watch.end() == 130
        assert subprocess.run(search, capture_output=True, check=False).returncode == 1


@pytest.mark.parametrize("other", ["--dry-run", "--print-command=a"])
def test_options_that_build_nothing_are_rejected_with_watch(tree: Tree, other: str) -> None:
    watch = Watch(tree(package("a")), other)
    assert watch.process.wait(timeout=20) == 2
    watch.close()


def test_polling_replaces_exhausted_file_watches(tree: Tree) -> None:
    """The limit is set in a user namespace; without one, polling is requested by an option."""
    root = tree(package("a"))
    few = ("unshare", "-Ur", "sh", "-c", 'echo 2 > /proc/sys/user/max_inotify_watches && exec "$@"', "sh")
    try:
        limited = subprocess.run([*few, "true"], capture_output=True, check=False).returncode == 0
    except FileNotFoundError:
        limited = False
    prefix = few if limited else ("env", "WATCHFILES_FORCE_POLLING=1")
    with watching(root, prefix=prefix) as watch:
        if limited:
            assert any("sudo sysctl fs.inotify.max_user_watches=" in said for said in watch.said)
        (root / "src/a/said.txt").write_text("two\n")
        assert watch.rebuilt() == "a"
