"""forge interface: compile definitions, and ask about installed and embedded ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.commands.interface import asking, compiling, describing, documenting

if TYPE_CHECKING:
    import argparse


def register(parser: argparse.ArgumentParser) -> None:
    """Add the words that follow `forge interface`."""
    verbs = parser.add_subparsers(metavar="VERB", required=True, parser_class=type(parser))
    asking.register(verbs)
    compiling.register(verbs)
    describing.register(verbs)
    documenting.register(verbs)


def run(options: argparse.Namespace) -> int:
    """Do what the verb says and return the exit code."""
    code: int = options.verb(options)
    return code
