"""`forge interface`: compile interface definitions and query installed and embedded ones."""

from __future__ import annotations

from forge.base.extensions import VERBS, installed
from forge.cli.commands.interface import asking, compiling
from forge.cli.main import Parser, add_plugin

__all__ = ["inputs"]


def register(parser: Parser) -> None:
    verbs = parser.add_subparsers(metavar="VERB", required=True, parser_class=type(parser))
    asking.register(verbs)
    compiling.register(verbs)
    asked = next((word for word in parser.words if not word.startswith("-")), None)
    # Builds wait for 'generate': it imports no plugins.
    if asked not in verbs.choices:
        for word in sorted({*installed(VERBS), *((asked,) if asked else ())}):
            add_plugin(verbs, VERBS, word, "verb")
