"""The documentation as a program: its console blocks are typed, its file blocks written, in one shell.

A comment in front of a fenced block says what becomes of it:

    (none)                                  console or bash: typed, line by line, and must succeed
    <!-- fails with 2 -->                   the last command of the block must end with this code
    <!-- write: PATH -->                    the block's text becomes that file
    <!-- append: PATH -->                   the block's text goes to the end of that file
    <!-- insert: PATH before: TEXT -->      the block's text goes before the first line with TEXT
    <!-- not run: REASON -->                left alone

In a console block, lines after '$ ' are commands and the others are what they print: each must occur, in
order; '...' stands for anything.
"""

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from itertools import chain
from pathlib import Path

ROOT = Path(__file__).parents[1]
FOREIGN = ("AMENT_", "CMAKE_PREFIX_PATH", "COLCON_", "FORGE_", "PYTHONPATH", "ROS_")
TYPED = ("console", "bash")

_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_MARK = re.compile(r"<!-- (.*?) -->\n\Z")
_INSERT = re.compile(r"insert: (.+) before: (.+)")
_END = re.compile(r"\x01(\d+)\x01\n")
_INSERT_TEXT = """import pathlib, sys
path, before, text = pathlib.Path(sys.argv[1]), sys.argv[2], sys.argv[3]
old = path.read_text()
at = old.rindex("\\n", 0, old.index(before)) + 1
path.write_text(old[:at] + text + old[at:])
"""


@dataclass(frozen=True, slots=True)
class Block:
    """A fenced block: where it stands, its language, the comment in front of it, its text."""

    line: int
    language: str
    mark: str
    text: str


@dataclass(frozen=True, slots=True)
class Command:
    """A command of a block, what it is to print and the code it is to end with."""

    line: int
    text: str
    expected: tuple[str, ...] = ()
    code: int = 0


def blocks(text: str) -> tuple[Block, ...]:
    """Return the fenced blocks of a Markdown text."""
    found = []
    for match in _BLOCK.finditer(text):
        mark = _MARK.search(text, 0, match.start())
        line = text.count("\n", 0, match.start()) + 1
        found.append(Block(line, match[1], mark[1] if mark else "", match[2]))
    return tuple(found)


def commands(block: Block) -> tuple[Command, ...]:
    """Return the commands that a block stands for; none if it is only to be read."""
    if block.mark.startswith("not run"):
        return ()
    if block.language in TYPED:
        return tuple(_typed(block))
    if block.mark.startswith(("write: ", "append: ", "insert: ")):
        return (_edit(block),)
    return ()


def run(document: Path, folder: Path) -> None:
    """Type a document's commands into one bash in `folder`; AssertionError names the first that differs."""
    todo = tuple(chain.from_iterable(map(commands, blocks(document.read_text(encoding="utf-8")))))
    if not todo:
        return
    output = shell(_script(todo), folder)
    pieces = _END.split(output)
    for command, printed, code in zip(todo, pieces[0::2], (*pieces[1::2], "none"), strict=False):
        where = f"{document}:{command.line}: {command.text}"
        assert code == str(command.code), f"{where}\nended with {code}, not {command.code}:\n{printed}"
        missing = _missing(command.expected, printed)
        assert missing is None, f"{where}\ndid not print '{missing}', but:\n{printed}"
    assert len(pieces) // 2 == len(todo), f"{document}: the shell ended early:\n{pieces[-1]}"


def shell(script: str, folder: Path, **variables: str) -> str:
    """Run a bash script as a user with a plain shell would, and return all that it printed."""
    ended = subprocess.run(
        ["bash", "--noprofile", "--norc", "-c", f"exec 2>&1\n{script}"],
        cwd=folder,
        env=surroundings(folder) | variables,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        text=True,
        check=False,
        timeout=900,
    )
    return ended.stdout


def surroundings(folder: Path) -> dict[str, str]:
    """Return an environment without any ROS, in which `forge` is the one of this checkout."""
    variables = {name: value for name, value in os.environ.items() if not name.startswith(FOREIGN)}
    path = [str(Path(sys.executable).parent), variables.get("PATH", os.defpath)]
    try:
        distribution("ros-forge")
    except PackageNotFoundError:
        variables["PYTHONPATH"] = str(ROOT)
        path.insert(0, str(_launcher(folder.parent / "forge on path")))
    return variables | {"PATH": os.pathsep.join(path), "VIRTUAL_ENV": sys.prefix}


def _launcher(folder: Path) -> Path:
    """Write a `forge` command for an interpreter into which forge is not installed."""
    folder.mkdir(exist_ok=True)
    script = folder / "forge"
    script.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m forge "$@"\n', encoding="utf-8")
    script.chmod(0o755)
    return folder


def _typed(block: Block) -> Iterator[Command]:
    """Yield the commands of a console or bash block with what each is to print."""
    fails = re.fullmatch(r"fails with (\d+)", block.mark)
    typed: list[tuple[int, str, list[str]]] = []
    for number, line in enumerate(block.text.splitlines(), block.line + 1):
        if block.language == "bash" or line.startswith("$ "):
            typed.append((number, line.removeprefix("$ "), []))
        elif line.startswith("> "):
            before = typed.pop()
            typed.append((before[0], f"{before[1]}\n{line.removeprefix('> ')}", []))
        elif line.strip():
            typed[-1][2].append(line)
    for number, text, expected in typed:
        last = number == typed[-1][0]
        yield Command(number, text, tuple(expected), int(fails[1]) if fails and last else 0)


def _edit(block: Block) -> Command:
    """Return the command that writes a block's text where its mark says."""
    if match := _INSERT.fullmatch(block.mark):
        return Command(
            block.line, shlex.join((sys.executable, "-S", "-c", _INSERT_TEXT, *match.groups(), block.text))
        )
    word, _, path = block.mark.partition(": ")
    folder, path, text = map(shlex.quote, (str(Path(path).parent), path, block.text))
    write = f"rm -f {path}\nprintf %s {text} >" if word == "write" else f"printf %s {text} >>"
    return Command(block.line, f"mkdir -p {folder}\n{write} {path}")


def _script(todo: tuple[Command, ...]) -> str:
    """Return a script that runs the commands, each with its exit code behind it, up to the first surprise."""
    return "".join(
        f'{command.text}\ncode=$?; printf "\\001$code\\001\\n"; [ $code = {command.code} ] || exit 0\n'
        for command in todo
    )


def _missing(expected: tuple[str, ...], printed: str) -> str | None:
    """Return the first expected line that the output does not have in its turn, or None."""
    lines = iter(printed.splitlines())
    for line in expected:
        pattern = re.compile(".*".join(map(re.escape, line.rstrip().split("..."))))
        if not any(pattern.fullmatch(given.rstrip()) for given in lines):
            return line
    return None
