"""`forge graph`: show the dependency graph of the packages as text, diagram or image."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

from forge.base.frozen import frozen
from forge.base.graph import ordered_names
from forge.base.options import flag, option, options_of
from forge.cli.commands.list import ListingOptions
from forge.plugins.charts import graph_formats
from forge.plugins.charts.graph_formats import PackageGraph


@frozen
class Options:
    listing: ListingOptions = options_of(ListingOptions)
    html: bool = flag("print an interactive web page", conflicts="form")
    svg: bool = flag("print an SVG image", conflicts="form")
    mermaid: bool = flag("print a Mermaid diagram, which GitHub renders in Markdown", conflicts="form")
    dot: bool = flag("print a Graphviz graph: 'forge graph --dot | dot -Tsvg'", conflicts="form")
    density: bool = flag("print the density of the graph first", conflicts="form")
    output: str | None = option("write to this file instead of stdout", short="-o", metavar="FILE")
    legend: bool = flag("print a legend first")
    dot_cluster: bool = flag("with --dot: group packages by folder")
    dot_include_skipped: bool = flag("with --dot: include packages that are not selected, in grey")


def run(options: Options) -> int:
    """Print the graph of the selected packages, or write it to a file."""
    root, loaded = Path.cwd(), options.listing.load()
    needs, names = loaded.resolution.needs, frozenset(loaded.selection.names)
    chart = PackageGraph(ordered_names(needs), needs, loaded.packages, names)
    text = _text(chart, options, root)
    if options.output is None:
        print(text, end="")
        return 0
    from forge.base.files import write_if_changed

    write_if_changed(root / options.output, text)
    return 0


def _text(chart: PackageGraph, options: Options, root: Path) -> str:
    if options.listing.json:
        return json.dumps(graph_formats.plain(chart), indent=2) + "\n"
    if options.html or options.svg:
        from forge.base.templating import render
        from forge.build.journal import open_journal
        from forge.plugins.charts.drawing import drawn, facts

        records = open_journal(root / options.listing.build_base).records
        seconds = {name: record.seconds for name, record in records.items() if record.seconds}
        graph = graph_formats.reduced_among(chart.needs, chart.ordered, chart.selected)
        picture = drawn(chart, graph, seconds)
        title = f"{graph_formats.printable(root.name)}: {len(picture['nodes'])} packages"
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
