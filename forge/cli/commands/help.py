"""`forge help`: print the help of a command."""

from __future__ import annotations

from forge.base.frozen import frozen
from forge.base.options import option
from forge.cli import main


@frozen
class Options:
    words: tuple[str, ...] = option(
        "command, and its verb if it has verbs: pkg create", default=(), positional=True, metavar="COMMAND"
    )


def run(options: Options) -> int:
    """Print the help of a command, or of forge itself; ends with SystemExit like `--help`."""
    main.parser_of(options.words).parse_args([*options.words, "--help"])
    return 0
