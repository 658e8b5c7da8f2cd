"""`forge shell`: a shell, or any program, in the environment of the workspace; nothing needs sourcing."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from forge.errors import EnvironmentFault, Problem
from forge.sourcing import sourced_environment

if TYPE_CHECKING:
    from forge.cli import Parser


def register(parser: Parser) -> None:
    """Add the options of `forge shell`."""
    parser.add_argument(
        "--install-base",
        default="install",
        metavar="DIR",
        help="where the workspace is installed (default: install)",
    )
    parser.add_argument("words", nargs=argparse.REMAINDER, metavar="COMMAND", help="run this instead")


def run(options: argparse.Namespace) -> int:
    """Become the shell of the user, or the command; what that ends with is what forge ends with.

    Raises EnvironmentFault when it cannot be started.
    """
    words = options.words[1:] if options.words[:1] == ["--"] else options.words
    install = Path(options.install_base).absolute()
    variables = sourced_environment(install, os.environ)
    argv = words or [os.environ.get("SHELL") or "/bin/sh"]
    if not words and sys.stderr.isatty():
        print(f"'{install}' is sourced here; 'exit' leads back", file=sys.stderr)
    os.chdir(options.origin)
    sys.stdout.flush()
    try:
        os.execvpe(argv[0], argv, variables)  # noqa: S606  (a shell is what was asked for)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise EnvironmentFault(Problem(f"cannot run '{argv[0]}': {reason}")) from None
