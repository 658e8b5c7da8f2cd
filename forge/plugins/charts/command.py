"""`forge graph`: show the dependency graph of the packages as text, diagram or image."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.errors import print_warnings
from forge.cli import package_options
from forge.plugins.charts import graph_formats
from forge.plugins.charts.graph_formats import PackageGraph
from forge.workspace.load import load_workspace

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable

    from forge.cli.main import Parser


def register(parser: Parser) -> None:
    package_options.add_listing(parser)
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--html", action="store_true", help="print an interactive web page")
    form.add_argument("--svg", action="store_true", help="print an SVG image")
    form.add_argument(
        "--mermaid", action="store_true", help="print a Mermaid diagram, which GitHub renders in Markdown"
    )
    form.add_argument(
        "--dot", action="store_true", help="print a Graphviz graph: 'forge graph --dot | dot -Tsvg'"
    )
    form.add_argument("--density", action="store_true", help="print the density of the graph first")
    parser.add_argument("-o", "--output", metavar="FILE", help="write to this file instead of stdout")
    parser.add_argument("--legend", action="store_true", help="print a legend first")
    parser.add_argument("--dot-cluster", action="store_true", help="with --dot: group packages by folder")
    parser.add_argument(
        "--dot-include-skipped",
        action="store_true",
        help="with --dot: include packages that are not selected, in grey",
    )


def run(options: argparse.Namespace) -> int:
    """Print the graph of the selected packages, or write it to a file."""
    root = Path.cwd()
    loaded = load_workspace(root, package_options.query_of(options), os.environ, embedded=options.embedded)
    print_warnings(loaded.warnings)
    chart = PackageGraph(loaded.ordered, loaded.needs, loaded.packages, frozenset(loaded.selection.names))
    text = _text(chart, options, root)
    if options.output is None:
        print(text, end="")
        return 0
    from forge.base.files import write_if_changed

    write_if_changed(root / options.output, text)
    return 0


def _text(chart: PackageGraph, options: argparse.Namespace, root: Path) -> str:
    if options.json:
        return json.dumps(graph_formats.plain(chart), indent=2) + "\n"
    if options.html or options.svg:
        from forge.base.templating import render
        from forge.build.journal import open_journal
        from forge.plugins.charts.drawing import drawn, facts

        records = open_journal(root / options.build_base).records
        seconds = {name: record.seconds for name, record in records.items() if record.seconds}
        graph = graph_formats.reduced_among(chart.needs, chart.ordered, chart.selected)
        picture = drawn(chart, graph, seconds)
        title = f"{graph_formats.printable(root.name)}: {len(picture.nodes)} packages"
        if options.svg:
            return render("charts/templates/graph.svg.j2", title=title, picture=picture)
        details = facts(chart, graph, seconds)
        return render("charts/templates/graph.html.j2", title=title, picture=picture, facts=details)
    if options.mermaid:
        return _joined(graph_formats.mermaid(chart))
    if options.dot:
        cluster, skipped = options.dot_cluster, options.dot_include_skipped
        return _joined(graph_formats.dot(chart, cluster=cluster, skipped=skipped, legend=options.legend))
    legend = graph_formats.LEGEND if options.legend else ()
    density = (f"dependency density {graph_formats.density(chart):.2f} %\n",) if options.density else ()
    return _joined((*legend, *density, *graph_formats.matrix(chart)))


def _joined(lines: Iterable[str]) -> str:
    return "".join(f"{line}\n" for line in lines)
