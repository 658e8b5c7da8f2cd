"""The verb docs of `forge interface`: generate HTML documentation of interfaces."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.layout import INTERFACE_PAGES_DIR
from forge.cli.commands.interface.inputs import add_includes

if TYPE_CHECKING:
    import argparse

    from forge.cli.commands.interface.inputs import Verbs

_OUTPUT = Path("build") / INTERFACE_PAGES_DIR


def register(verbs: Verbs) -> None:
    summary = "generate HTML documentation of the interfaces of the workspace"
    more = "Types that the interfaces refer to are documented, too, so that all links work."
    docs = verbs.add_parser("docs", help=summary, description=summary, epilog=more)
    docs.add_argument(
        "packages",
        metavar="PKG",
        nargs="*",
        help="document only these packages, which may be outside of the workspace",
    )
    docs.add_argument("-o", "--output", metavar="DIR", type=Path, help=f"output folder (default: {_OUTPUT})")
    docs.add_argument(
        "--underlays", action="store_true", help="also document all interfaces in sourced prefixes"
    )
    docs.add_argument(
        "--embedded", action="store_true", help="also document all interfaces embedded in forge"
    )
    docs.add_argument(
        "--title", metavar="TEXT", default="Interfaces", help="title of the site (default: %(default)s)"
    )
    add_includes(docs)
    docs.set_defaults(verb=_docs)


def _docs(options: argparse.Namespace) -> int:
    from forge.cli.commands.interface.pages import make_site

    return make_site(options, _OUTPUT)
