"""`forge graph`: which package depends on which, as a matrix or for Graphviz."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge import charts, package_options
from forge.charts import Chart
from forge.workspace import load_workspace

if TYPE_CHECKING:
    import argparse

    from forge.cli import Parser


def register(parser: Parser) -> None:
    """Add the options of `forge graph`."""
    package_options.add_listing(parser)
    form = parser.add_mutually_exclusive_group()
    form.add_argument(
        "--dot",
        action="store_true",
        help="for Graphviz, as 'forge graph --dot | dot -Tsvg'; dashed over packages left out",
    )
    form.add_argument("--density", action="store_true", help="begin with how dense the graph is")
    parser.add_argument("--legend", action="store_true", help="explain the signs")
    parser.add_argument("--dot-cluster", action="store_true", help="with --dot: a frame around each folder")
    parser.add_argument(
        "--dot-include-skipped", action="store_true", help="with --dot: packages that are left out, in grey"
    )


def run(options: argparse.Namespace) -> int:
    """Print the graph of the selected packages."""
    loaded = load_workspace(Path.cwd(), options, os.environ, embedded=options.embedded)
    chart = Chart(loaded.ordered, loaded.needs, loaded.packages, frozenset(loaded.selection.names))
    if options.json:
        print(json.dumps(charts.plain(chart), indent=2))
    elif options.dot:
        lines = charts.dot(
            chart, cluster=options.dot_cluster, skipped=options.dot_include_skipped, legend=options.legend
        )
        print(*lines, sep="\n")
    else:
        if options.legend:
            print(*charts.LEGEND, sep="\n")
        if options.density:
            print(f"dependency density {charts.density(chart):.2f} %\n")
        for line in charts.matrix(chart):
            print(line)
    return 0
