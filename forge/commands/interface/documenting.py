"""docs: a site of HTML pages about the interfaces of a workspace, and about what they refer to."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from forge.commands.interface.inputs import add_includes

if TYPE_CHECKING:
    import argparse

    from forge.commands.interface.inputs import Verbs

_OUTPUT = Path("build/forge_interface_docs")


def register(verbs: Verbs) -> None:
    """Add what makes pages to the words that follow `forge interface`."""
    summary = "make a site of HTML pages about the interfaces of the workspace"
    more = "What the interfaces refer to has pages, too, wherever it is from: no link leads nowhere."
    docs = verbs.add_parser("docs", help=summary, description=summary, epilog=more)
    docs.add_argument(
        "packages", metavar="PKG", nargs="*", help="these packages alone, of the workspace or not"
    )
    docs.add_argument(
        "-o", "--output", metavar="DIR", type=Path, help=f"where the pages go (default: {_OUTPUT})"
    )
    docs.add_argument(
        "--underlays", action="store_true", help="also about all interfaces in prefixes that are sourced"
    )
    docs.add_argument(
        "--embedded", action="store_true", help="also about all interfaces that forge brings along"
    )
    docs.add_argument(
        "--title", metavar="TEXT", default="Interfaces", help="what the site is called (default: %(default)s)"
    )
    add_includes(docs)
    docs.set_defaults(verb=_docs)


def _docs(options: argparse.Namespace) -> int:
    from forge.commands.interface.pages import make_site  # noqa: PLC0415  (code generation starts without it)

    return make_site(options, _OUTPUT)
