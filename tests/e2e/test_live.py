"""Output on a terminal: a real pseudo-terminal with an emulated screen."""

import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Mapping
from pathlib import Path

import pyte
import pytest

from tests.conftest import Tree
from tests.packages import manifest_text
from tests.snippets import ROOT

pytestmark = pytest.mark.needs("cmake")

SLOW = """cmake_minimum_required(VERSION 3.18)
project({name} NONE)
add_custom_target(all_of_it ALL COMMAND sleep {seconds} && {command})
install(FILES package.xml DESTINATION share/{name})
"""


def package(name: str, seconds: float, command: str = "true", *depends: str) -> dict[str, str]:
    needs = (f"<depend>{need}</depend>" for need in depends)
    return {
        f"src/{name}/package.xml": manifest_text(name, *needs, build_type="cmake"),
        f"src/{name}/CMakeLists.txt": SLOW.format(name=name, seconds=seconds, command=command),
    }


class Terminal:
    """A program on a terminal of its own, and what has been on its screen."""

    def __init__(
        self, argv: list[str], cwd: Path, size: tuple[int, int], variables: Mapping[str, str]
    ) -> None:
        """Start it; `size` is columns and lines."""
        columns, height = size
        self.screen = pyte.HistoryScreen(columns, height, history=1000)
        self._stream = pyte.ByteStream(self.screen)
        self._ours, theirs = pty.openpty()
        self.resize(columns, height)
        environment = {**os.environ, "TERM": "xterm", "PYTHONPATH": str(ROOT), **variables}
        if "NO_COLOR" not in variables:
            environment.pop("NO_COLOR", None)
        self._process = subprocess.Popen(
            argv, cwd=cwd, stdin=theirs, stdout=theirs, stderr=theirs, env=environment
        )
        os.close(theirs)
        self.frames: list[str] = []
        self.written = b""

    def resize(self, columns: int, height: int) -> None:
        fcntl.ioctl(self._ours, termios.TIOCSWINSZ, struct.pack("HHHH", height, columns, 0, 0))
        self.screen.resize(height, columns)

    def watch(self, seconds: float = 60) -> None:
        """Take in what is written until the program ends, or so many seconds pass."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            ready, _, _ = select.select([self._ours], [], [], 0.05)
            if ready:
                try:
                    written = os.read(self._ours, 65536)
                except OSError:  # Linux says so when the other side is closed
                    break
                self.written += written
                self._stream.feed(written)
            self.frames.append("\n".join(line.rstrip() for line in self.screen.display).rstrip())

    def end(self) -> int:
        """Watch to the end and return the exit code."""
        self.watch()
        os.close(self._ours)
        return self._process.wait(timeout=10)


def build(
    root: Path, *options: str, size: tuple[int, int] = (80, 24), variables: Mapping[str, str] | None = None
) -> Terminal:
    return Terminal([sys.executable, "-m", "forge", "build", *options], root, size, variables or {})


@pytest.mark.parametrize("size", [(80, 24), (30, 8), (200, 60)])
def test_running_packages_are_shown(tree: Tree, size: tuple[int, int]) -> None:
    root = tree({**package("first", 0.6), **package("second", 0.6, "true", "first")})
    terminal = build(root, size=size)
    assert terminal.end() == 0
    seen = "\n".join(terminal.frames)
    assert "0/2 packages" in seen
    assert "  first  build" in seen
    assert "1/2 packages" in seen
    last = terminal.frames[-1]
    assert "1/2 packages" not in last, "the moving lines are gone in the end"
    assert "Starting >>>" not in seen
    for words in ("Finished <<< first", "Finished <<< second", "Summary: 2 packages finished"):
        assert words[: size[0]] in last


def test_status_lines_fit_the_size_of_the_terminal(tree: Tree) -> None:
    variables = {"COLUMNS": "80", "LINES": "24"}
    terminal = build(tree(package("first", 0.3)), size=(30, 8), variables=variables)
    assert terminal.end() == 0
    assert "Finished <<< first" in terminal.frames[-1]
    assert "packages" not in terminal.frames[-1].partition("Summary")[0]


def test_failures_stay_visible_with_the_complete_error(tree: Tree) -> None:
    root = tree({**package("bad", 0.1, "exit 3"), **package("good", 1.5)})
    terminal = build(root, "--continue-on-error", "--jobs", "2")
    assert terminal.end() == 1
    assert any("failed: bad" in frame and "good  " in frame for frame in terminal.frames)
    assert "Failed   <<< bad" in terminal.frames[-1]
    assert "failed: bad" in terminal.frames[-1]


def test_the_terminal_can_be_resized(tree: Tree) -> None:
    terminal = build(tree(package("slow", 1.5)))
    terminal.watch(1.0)
    terminal.resize(40, 10)
    assert terminal.end() == 0
    assert "Finished <<< slow" in terminal.frames[-1]
    assert "0/1 packages" not in terminal.frames[-1]


def test_the_remaining_time_is_estimated_from_earlier_builds(tree: Tree) -> None:
    root = tree({**package("first", 1.2), **package("second", 3.0, "true", "first")})
    assert build(root).end() == 0
    again = build(root, "--force")
    assert again.end() == 0
    assert any("left" in frame for frame in again.frames)


@pytest.mark.parametrize(
    ("options", "variables"),
    [((), {"TERM": "dumb"}), (("--event-handlers", "status-"), {})],
)
def test_plain_output_can_be_requested(
    tree: Tree, options: tuple[str, ...], variables: dict[str, str]
) -> None:
    terminal = build(tree(package("first", 0.3)), *options, variables=variables)
    assert terminal.end() == 0
    assert "Starting >>> first" in terminal.frames[-1]
    assert "0/1 packages" not in "\n".join(terminal.frames)


@pytest.mark.parametrize(("variables", "coloured"), [({"NO_COLOR": "1"}, False), ({}, True)])
def test_no_color_removes_only_colours(tree: Tree, variables: dict[str, str], *, coloured: bool) -> None:
    terminal = build(tree(package("first", 0.3)), variables=variables)
    assert terminal.end() == 0
    seen = "\n".join(terminal.frames)
    assert "0/1 packages" in seen
    assert "  first  build" in seen
    assert "Finished <<< first" in terminal.frames[-1]
    assert bool(re.search(rb"\x1b\[[\d;]*3[1-7]m", terminal.written)) is coloured


def test_an_up_to_date_build_prints_two_lines(tree: Tree) -> None:
    root = tree(package("first", 0.0))
    assert build(root).end() == 0
    again = build(root)
    assert again.end() == 0
    assert again.frames[-1].strip().startswith("Summary: 0 packages finished, 1 package unchanged")
