"""generate HTML documentation of the interfaces of the workspace"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.layout import INTERFACE_PAGES_DIR
from forge.cli.commands.interface.inputs import add_includes

if TYPE_CHECKING:
    import argparse

    from forge.cli.main import Parser

_OUTPUT = Path("build") / INTERFACE_PAGES_DIR


def register(parser: Parser) -> None:
    """Add the options of `forge interface docs`."""
    parser.epilog = "Types that the interfaces refer to are documented, too, so that all links work."
    parser.add_argument(
        "packages",
        metavar="PKG",
        nargs="*",
        help="document only these packages, which may be outside of the workspace",
    )
    parser.add_argument(
        "-o", "--output", metavar="DIR", type=Path, help=f"output folder (default: {_OUTPUT})"
    )
    parser.add_argument(
        "--underlays", action="store_true", help="also document all interfaces in sourced prefixes"
    )
    parser.add_argument(
        "--embedded", action="store_true", help="also document all interfaces embedded in forge"
    )
    parser.add_argument(
        "--title", metavar="TEXT", default="Interfaces", help="title of the site (default: %(default)s)"
    )
    add_includes(parser)


def run(options: argparse.Namespace) -> int:
    """Write the pages."""
    from forge.plugins.interface_pages.documenting import make_site

    return make_site(options, _OUTPUT)
