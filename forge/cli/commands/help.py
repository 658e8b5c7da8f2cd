"""`forge help`: print the help of a command."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.cli import main

if TYPE_CHECKING:
    import argparse


def register(parser: main.Parser) -> None:
    parser.add_argument(
        "words", nargs="*", metavar="COMMAND", help="command, and its verb if it has verbs: pkg create"
    )


def run(options: argparse.Namespace) -> int:
    """Print the help of a command, or of forge itself; ends with SystemExit like `--help`."""
    main.parser_of(options.words).parse_args([*options.words, "--help"])
    return 0
