"""Renders the dependency graph as colcon's matrix, Graphviz dot or Mermaid."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence, Set
from pathlib import Path

from forge.base.frozen import frozen
from forge.base.graph import closures, reduced
from forge.base.templating import render
from forge.workspace.model import BUILD_KINDS, RUN_KINDS, TEST_KINDS, Package
from forge.workspace.selection import name_of

LEGEND = (
    "+ marks the package itself",
    "* marks a package that depends on it directly",
    ". marks a package that depends on it indirectly",
    "",
)
_COLOURS = {"build": "#0000ff", "run": "#ff0000", "test": "#d2b48c"}
_KINDS = {"build": BUILD_KINDS, "run": RUN_KINDS, "test": TEST_KINDS}
_ESCAPED = re.compile(r'["\\]')
"""Characters that end a Graphviz string or have a meaning in it; names may contain any."""
_GREY = '[color = "gray" fontcolor = "gray"]'


@frozen
class PackageGraph:
    """All nodes in topological order, their dependencies and packages, and the selected nodes."""

    ordered: Sequence[str]
    needs: Mapping[str, frozenset[str]]
    packages: Mapping[str, Package]
    selected: frozenset[str]

    @property
    def shown(self) -> tuple[str, ...]:
        return tuple(node for node in self.ordered if node in self.selected)


@frozen
class _Edge:
    start: str
    end: str
    categories: tuple[str, ...]
    direct: bool


def matrix(chart: PackageGraph) -> Iterator[str]:
    """Yield a row for each node that marks the columns that depend on it."""
    width = max((len(name_of(node)) for node in chart.shown), default=0) + 2
    for row, cells in _cells(chart).items():
        yield f"{name_of(row):<{width}}{cells}"


def density(chart: PackageGraph) -> float:
    """Return the percentage of possible dependencies that exist, directly or indirectly."""
    cells = "".join(_cells(chart).values()).replace("+", "")
    return 200.0 * (1.0 - cells.count(" ") / len(cells)) if cells else 0.0


def dot(
    chart: PackageGraph, *, cluster: bool = False, skipped: bool = False, legend: bool = False
) -> Iterator[str]:
    """Yield the lines of a digraph: edges colored by category, dashed if they skip hidden packages."""
    nodes = [node for node in reversed(chart.ordered) if skipped or node in chart.selected]
    labels = _labels(nodes, chart, skipped=skipped)
    yield "digraph graphname {"
    if cluster and nodes:
        yield from _clusters(nodes, labels, chart)
    else:
        yield from (f"  {labels[node][1]};" for node in nodes)
    for edge in _edges(chart, frozenset(nodes), skipped=skipped):
        alpha = "" if {edge.start, edge.end} <= chart.selected else "77"
        colours = ":".join(_COLOURS[category] + alpha for category in edge.categories)
        style = "" if edge.direct else ', style="dashed"'
        start, end = (labels[node][0] for node in (edge.start, edge.end))
        yield f'  "{start}" -> "{end}" [color="{colours}"{style}];'
    if legend:
        yield from render("charts/templates/legend.dot.j2", colours=_COLOURS).splitlines()
    yield "}"


def mermaid(chart: PackageGraph) -> Iterator[str]:
    """Yield the lines of a flowchart with an arrow to each dependency, without implied ones."""
    shown = tuple(reversed(chart.shown))
    numbers = {node: number for number, node in enumerate(shown)}
    yield "flowchart TD"
    yield from (f'  p{number}["{_in_mermaid(name_of(node))}"]' for node, number in numbers.items())
    graph = reduced_among(chart.needs, chart.ordered, chart.selected)
    yield from (f"  p{numbers[node]} --> p{numbers[need]}" for node in shown for need in graph[node])


def reduced_among(
    needs: Mapping[str, frozenset[str]], ordered: Iterable[str], nodes: Collection[str]
) -> dict[str, tuple[str, ...]]:
    """Return the direct and indirect dependencies of `nodes` on each other, without implied ones.

    `ordered` is a topological order of all nodes, and that of the result.
    """
    below = closures(needs, ordered)
    return reduced(below, [node for node in below if node in nodes])


def longest_chain(needs: Mapping[str, Iterable[str]], seconds: Mapping[str, float]) -> tuple[str, ...]:
    """Return the chain of dependent nodes with the longest total duration."""
    import networkx as nx  # slow, and not needed for the matrix

    graph: nx.DiGraph[str] = nx.DiGraph()
    for node, own in needs.items():
        # The weight of an edge is that of the node it leads to; "" precedes nodes without dependencies.
        graph.add_edges_from(((need, node) for need in ("", *own)), seconds=seconds.get(node, 0.0))
    return tuple(node for node in nx.dag_longest_path(graph, "seconds") if node)


def printable(text: str) -> str:
    """Replace invisible characters and those that XML does not allow."""
    return "".join(char if char.isprintable() else "\N{REPLACEMENT CHARACTER}" for char in text)


def plain(chart: PackageGraph) -> dict[str, object]:
    edges = _edges(chart, chart.selected, skipped=False)
    paths = {node: str(chart.packages[node].path) for node in chart.shown}
    return {
        "packages": [{"name": name_of(node), "path": path} for node, path in paths.items()],
        "dependencies": [
            {
                "from": name_of(edge.start),
                "to": name_of(edge.end),
                "categories": list(edge.categories),
                "direct": edge.direct,
            }
            for edge in edges
        ],
    }


def _cells(chart: PackageGraph) -> dict[str, str]:
    below, shown = dict(closures(chart.needs, chart.ordered)), chart.shown

    def cell(row: str, column: str) -> str:
        if column == row:
            return "+"
        if row in chart.needs[column]:
            return "*"
        return "." if row in below[column] else " "

    return {row: "".join(cell(row, column) for column in shown) for row in shown}


def _edges(chart: PackageGraph, nodes: frozenset[str], *, skipped: bool) -> Iterator[_Edge]:
    """Yield direct edges between the nodes, then those that skip hidden packages."""
    direct = [
        _Edge(node, need, _categories(chart, node, need), direct=True)
        for node in reversed(chart.ordered)
        if node in nodes
        for need in sorted(chart.needs[node] & nodes)
    ]
    yield from direct
    if skipped or len(nodes) == len(chart.ordered):
        return
    direct_pairs = {(edge.start, edge.end) for edge in direct}
    below = closures(chart.needs, chart.ordered)
    for node in reversed(chart.ordered):
        if node in nodes:
            yield from _indirect(chart, node, nodes, direct_pairs, below)


def _indirect(
    chart: PackageGraph,
    node: str,
    nodes: frozenset[str],
    direct_pairs: set[tuple[str, str]],
    below: Mapping[str, Set[str]],
) -> Iterator[_Edge]:
    ends: dict[str, set[str]] = {}
    for need in sorted(chart.needs[node] - nodes):
        for end in sorted(below[need] & nodes):
            if (node, end) not in direct_pairs:
                ends.setdefault(end, set()).update(_categories(chart, node, need))
    for end, categories in ends.items():
        yield _Edge(node, end, tuple(word for word in _COLOURS if word in categories), direct=False)


def _categories(chart: PackageGraph, node: str, need: str) -> tuple[str, ...]:
    """Return the categories of a dependency; edges without a tag, such as to an alias, count as build."""
    manifest = chart.packages[node].manifest
    categories = (word for word, kinds in _KINDS.items() if name_of(need) in manifest.names(kinds))
    return tuple(categories) or ("build",)


def _labels(nodes: Sequence[str], chart: PackageGraph, *, skipped: bool) -> dict[str, tuple[str, str]]:
    """Return the ID of each node and its declaration; duplicate names get a numeric suffix."""
    names = [name_of(node) for node in nodes]
    if len(set(names)) < len(names):
        ids = {node: f"{name_of(node)}_{number}" for number, node in enumerate(sorted(nodes), 1)}
        return {node: (ids[node], f'"{ids[node]}" [label = "{name_of(node)}"]') for node in nodes}
    grey = {node: _GREY for node in nodes if skipped and node not in chart.selected}
    return {node: (node, f'"{node}"{grey.get(node, "")}') for node in nodes}


def _clusters(
    nodes: Iterable[str], labels: Mapping[str, tuple[str, str]], chart: PackageGraph
) -> Iterator[str]:
    """Yield the nodes grouped by folder, those of the common folder ungrouped."""
    folders: dict[Path, list[str]] = {}
    for node in nodes:
        # Paths of packages outside the workspace are absolute.
        folders.setdefault(chart.packages[node].path.parent.absolute(), []).append(node)
    common = os.path.commonpath(folders)
    for number, (folder, members) in enumerate(folders.items()):
        frame = str(folder) != common
        if frame:
            yield f"  subgraph cluster_{number} {{"
            label = _ESCAPED.sub(r"\\\g<0>", str(folder.relative_to(common)))
            yield f'    label = "{label}";'
        indent = "    " if frame else "  "
        yield from (f"{indent}{labels[node][1]};" for node in members)
        if frame:
            yield "  }"


def _in_mermaid(text: str) -> str:
    """Escape a text for quotation marks in Mermaid."""
    safe = frozenset("_-. ")
    return "".join(char if char.isalnum() or char in safe else f"#{ord(char)};" for char in printable(text))
