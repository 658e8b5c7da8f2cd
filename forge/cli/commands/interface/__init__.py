"""`forge interface`: compile interface definitions and query installed and embedded ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.cli.commands.interface import asking, compiling, describing, documenting

if TYPE_CHECKING:
    import argparse

    from forge.cli.main import Parser


def register(parser: Parser) -> None:
    verbs = parser.add_subparsers(metavar="VERB", required=True, parser_class=type(parser))
    asking.register(verbs)
    compiling.register(verbs)
    describing.register(verbs)
    documenting.register(verbs)


def run(options: argparse.Namespace) -> int:
    """Run the verb and return the exit code."""
    code: int = options.verb(options)
    return code
