"""`forge graph`: which package depends on which, as a matrix or for Graphviz."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge import charts
from forge import options as shared
from forge.workspace import load_workspace

if TYPE_CHECKING:
    import argparse

    from forge.cli import Parser


def register(parser: Parser) -> None:
    """Add the options of `forge graph`."""
    shared.add_discovery(parser)
    shared.add_selection(parser)
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--dot", action="store_true", help="for Graphviz: forge graph --dot | dot -Tsvg")
    form.add_argument("--density", action="store_true", help="begin with how dense the graph is")
    parser.add_argument("--legend", action="store_true", help="explain the signs")
    parser.add_argument("--embedded", action="store_true", help="with the packages that forge brings along")


def run(options: argparse.Namespace) -> int:
    """Print the graph of the selected packages."""
    loaded = load_workspace(Path.cwd(), options, os.environ, embedded=options.embedded)
    names = loaded.selection.names
    needs = {name: loaded.provision.needs[name] for name in names}
    if options.dot:
        lines = charts.dot(names, needs, loaded.packages)
    else:
        if options.legend:
            print(*charts.LEGEND, sep="\n")
        if options.density:
            print(f"dependency density {charts.density(names, needs):.2f} %\n")
        lines = charts.matrix(names, needs)
    print(*lines, sep="\n")
    return 0
