"""`forge graph`: which package depends on which, as a matrix, for Graphviz or Mermaid, and as a picture."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge import package_options
from forge.pictures import charts
from forge.pictures.charts import Chart
from forge.workspace import load_workspace

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable

    from forge.cli import Parser


def register(parser: Parser) -> None:
    """Add the options of `forge graph`."""
    package_options.add_listing(parser)
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--html", action="store_true", help="a picture to walk through, as one web page")
    form.add_argument("--svg", action="store_true", help="a picture to look at")
    form.add_argument("--mermaid", action="store_true", help="for Mermaid, which GitHub draws in Markdown")
    form.add_argument(
        "--dot",
        action="store_true",
        help="for Graphviz, as 'forge graph --dot | dot -Tsvg'",
    )
    form.add_argument("--density", action="store_true", help="begin with how dense the graph is")
    parser.add_argument("-o", "--output", metavar="FILE", help="write to a file instead of printing")
    parser.add_argument("--legend", action="store_true", help="explain the signs")
    parser.add_argument("--dot-cluster", action="store_true", help="with --dot: a frame around each folder")
    parser.add_argument(
        "--dot-include-skipped", action="store_true", help="with --dot: packages that are left out, in grey"
    )


def run(options: argparse.Namespace) -> int:
    """Print the graph of the selected packages, or write it."""
    root = Path.cwd()
    loaded = load_workspace(root, options, os.environ, embedded=options.embedded)
    chart = Chart(loaded.ordered, loaded.needs, loaded.packages, frozenset(loaded.selection.names))
    text = _text(chart, options, root)
    if options.output is None:
        print(text, end="")
        return 0
    from forge.files import write_if_changed  # noqa: PLC0415  (most graphs are printed)

    write_if_changed(root / options.output, text)
    return 0


def _text(chart: Chart, options: argparse.Namespace, root: Path) -> str:
    """Return the graph in the form that was asked for."""
    if options.json:
        return json.dumps(charts.plain(chart), indent=2) + "\n"
    if options.html or options.svg:
        return _picture(chart, options, root)
    if options.mermaid:
        return _joined(charts.mermaid(chart))
    if options.dot:
        cluster, skipped = options.dot_cluster, options.dot_include_skipped
        return _joined(charts.dot(chart, cluster=cluster, skipped=skipped, legend=options.legend))
    legend = charts.LEGEND if options.legend else ()
    density = (f"dependency density {charts.density(chart):.2f} %\n",) if options.density else ()
    return _joined((*legend, *density, *charts.matrix(chart)))


def _picture(chart: Chart, options: argparse.Namespace, root: Path) -> str:
    """Return the picture, in which packages are as tall as their last build took long."""
    from forge.journal import open_journal  # noqa: PLC0415  (only pictures show times)
    from forge.pictures.drawing import drawn, facts  # noqa: PLC0415
    from forge.templating import render  # noqa: PLC0415

    records = open_journal(root / options.build_base).records
    seconds = {name: record.seconds for name, record in records.items() if record.seconds}
    picture = drawn(chart, seconds)
    title = f"{charts.printable(root.name)}: {len(picture.nodes)} packages"
    if options.svg:
        return render("html/graph.svg.j2", title=title, picture=picture)
    return render("html/graph.html.j2", title=title, picture=picture, facts=facts(chart, seconds))


def _joined(lines: Iterable[str]) -> str:
    return "".join(f"{line}\n" for line in lines)
