"""`python -m tests.screenshot`: make docs/images/terminal.svg of what forge prints on a real terminal."""

import fcntl
import os
import pty
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import termios
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import jinja2
import pyte
from pyte.screens import Char

from forge.base.files import write_if_changed
from tests.snippets import ROOT, surroundings

PICTURE = ROOT / "docs/images/terminal.svg"
HOME = b"/home/me/ws"
"""Printed for the folder of the copy, so that the picture does not name this machine."""

COLUMNS, LINES = 106, 200
CELL, LINE = 8.0, 18
"""Width and height of a character."""

BUILD = "forge build --packages-up-to robot_demo_cpp"
MISTAKE = "sed -i s,geometry_msgs/,geometry_msg/, src/example_ros2_interfaces/msg/RobotPose.msg"
TYPED = (BUILD, MISTAKE, BUILD)
"""What is typed in a copy of the example workspace: a build, a mistake, and what forge says about it."""

BEFORE = (BUILD, "forge clean packages -y $(forge list --names-only --packages-up-to robot_demo_cpp)")
"""What is done before, and not shown: embedded packages are built once in the life of a workspace."""


_PROGRAM = re.compile(rb"/[^ ]*/bin/(?=cmake|python)")
"""The folder of a program."""


@dataclass(frozen=True, slots=True)
class Run:
    """Characters of a line with the same style, and where they stand."""

    x: float
    width: float
    text: str
    style: str


def main(argv: Sequence[str]) -> int:
    """Write the picture; the argument is another file."""
    with tempfile.TemporaryDirectory() as name:
        lines = session(Path(name) / "robot_ws")
    write_if_changed(Path(argv[0]) if argv else PICTURE, picture(lines))
    return 0


def session(folder: Path) -> list[tuple[Run, ...]]:
    """Build a copy of the example workspace, and return what the picture shows of it."""
    shutil.copytree(ROOT / "examples_ws/src", folder / "src")
    for command in BEFORE:
        subprocess.run(["bash", "-c", command], cwd=folder, env=surroundings(folder), check=True)
    return list(screen(TYPED, folder))


def screen(typed: Iterable[str], folder: Path) -> Iterator[tuple[Run, ...]]:
    """Type commands in a folder and yield the lines that a terminal shows in the end."""
    terminal = pyte.Screen(COLUMNS, LINES)
    stream = pyte.ByteStream(terminal)
    for command in typed:
        stream.feed(f"\x1b[1m$ {command}\x1b[0m\r\n".encode())
        printed = b"".join(_output(command, folder)).replace(os.fsencode(folder), HOME)
        stream.feed(_PROGRAM.sub(b"", printed))
    shown = [[terminal.buffer[row][column] for column in range(COLUMNS)] for row in range(LINES)]
    while shown and not "".join(char.data for char in shown[-1]).strip():
        shown.pop()
    yield from (tuple(_runs(line)) for line in shown)


def picture(lines: Sequence[Sequence[Run]]) -> str:
    """Return the SVG of a terminal with these lines."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(ROOT / "tests/data"),
        undefined=jinja2.StrictUndefined,
        autoescape=True,
        keep_trailing_newline=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    rows = [(LINE * number, runs) for number, runs in enumerate(lines, 1)]
    size = {"width": round(COLUMNS * CELL) + 32, "height": LINE * len(rows) + 62}
    return environment.get_template("terminal.svg.j2").render(rows=rows, **size)


def _output(command: str, folder: Path) -> Iterator[bytes]:
    """Run a command on a pseudo-terminal and yield what it prints."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 40, COLUMNS, 0, 0))
    variables = surroundings(folder) | {"TERM": "xterm-256color"}
    for name in ("NO_COLOR", "CI"):
        variables.pop(name, None)
    with subprocess.Popen(
        ["bash", "-c", command], cwd=folder, env=variables, stdin=theirs, stdout=theirs, stderr=theirs
    ):
        os.close(theirs)
        try:
            while data := os.read(ours, 4096):
                yield data
        except OSError:  # the terminal is closed with its last program
            pass
        finally:
            os.close(ours)


def _runs(line: Iterable[Char]) -> Iterator[Run]:
    """Yield the parts of a line that have the same style, without blanks at the ends."""
    column = 0
    for style, chars in groupby(line, _style):
        text = "".join(char.data for char in chars)
        if text.strip():
            lead = len(text) - len(text.lstrip())
            shown = text.strip()
            yield Run((column + lead) * CELL, len(shown) * CELL, shown, style)
        column += len(text)


def _style(char: Char) -> str:
    """Return the classes of a character."""
    color = char.fg.removeprefix("bright").replace("brown", "yellow")
    return " ".join(filter(None, (color if color != "default" else "", "bold" if char.bold else "")))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
