"""forge run: start an executable of an installed package and stand aside until it ends."""

from __future__ import annotations

import argparse
import os
import shlex
import signal
import subprocess
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

from forge.errors import EnvironmentFault, ForgeError, Problem
from forge.installed import executables, find_package, workspace_of
from forge.unfound import refuse_windows_line_endings, remedy

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path
    from types import FrameType


def register(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `ros2 run`."""
    parser.add_argument(
        "--prefix",
        metavar="COMMAND",
        help="put this command in front, such as 'gdb --args'; stands before the package",
    )
    # One positional, because argparse would take a '--' away from between two.
    parser.add_argument("words", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)
    parser.usage = "%(prog)s [-h] [--prefix COMMAND] PACKAGE EXECUTABLE [ARGUMENT ...]"
    parser.epilog = "The executable is given all that follows its name, options included."


def run(options: argparse.Namespace) -> int:
    """Run the executable and return its exit code, or minus the signal that ended it."""
    words = options.words[1:] if options.words[:1] == ["--"] else options.words
    if len(words) < 2:  # noqa: PLR2004  (a package and an executable)
        hint = "'forge pkg executables' lists them"
        raise ForgeError(Problem("name a package and one of its executables", hint=hint))
    package, name, *arguments = words
    variables = _environment(package)
    path = _choose(package, name, find_package(package, variables))
    code = _wait_for((*_words(options.prefix), str(path), *arguments), variables)
    if code:
        print(f"[ros2run]: {_ending(code)}", file=sys.stderr)
    return code


def _environment(package: str) -> Mapping[str, str]:
    """Return our environment, with the workspace around sourced where only that has the package."""
    install = workspace_of(package, os.environ)
    if install is None:
        return os.environ
    from forge.sourcing import sourced_environment  # noqa: PLC0415  (who has sourced does without)

    return sourced_environment(install, os.environ)


def _choose(package: str, name: str, prefix: Path) -> Path:
    """Return the one executable of that name."""
    paths = executables(package, prefix)
    matches = [path for path in paths if path.name == name]
    if not matches:
        raise ForgeError(Problem("no executable found", hint=remedy(package, name, prefix, paths)))
    if len(matches) > 1:
        listing = "".join(f"\n- {path}" for path in matches)
        raise ForgeError(Problem(f"multiple executables found:{listing}"))
    refuse_windows_line_endings(matches[0])
    return matches[0]


def _words(command: str | None) -> list[str]:
    try:
        return shlex.split(command or "")
    except ValueError as error:
        raise ForgeError(Problem(f"--prefix cannot be read: {str(error).lower()}")) from None


def _wait_for(argv: Sequence[str], variables: Mapping[str, str]) -> int:
    """Run a program with our input, output and folder until it ends, whatever signals we get."""
    sys.stdout.flush()
    with _deaf() as listeners:
        try:
            child = subprocess.Popen(argv, env=variables)
        except OSError as error:
            hint = "a script says in its first line what runs it, such as '#!/usr/bin/env python3'"
            problem = Problem(f"cannot run '{argv[0]}': {(error.strerror or str(error)).lower()}", hint=hint)
            raise EnvironmentFault(problem) from None
        listeners.append(child)
        return child.wait()


@contextmanager
def _deaf() -> Iterator[list[subprocess.Popen[bytes]]]:
    """Leave Ctrl-C to the child, which the terminal tells as well; hand on what only we are told.

    Handlers, and not SIG_IGN, because the child would inherit that.
    """
    listeners: list[subprocess.Popen[bytes]] = []

    def leave_it(_number: int, _frame: FrameType | None) -> None:
        pass

    def hand_on(number: int, _frame: FrameType | None) -> None:
        for child in listeners:
            child.send_signal(number)

    handlers = {signal.SIGINT: leave_it, signal.SIGTERM: hand_on, signal.SIGHUP: hand_on}
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield listeners
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _ending(code: int) -> str:
    """Return how the program failed, in the words of `ros2 run`."""
    return f"Process exited with failure {code}" if code > 0 else str(signal.strsignal(-code))
