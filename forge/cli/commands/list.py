"""`forge list`: list the packages of a workspace with name, path and type."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.errors import Problem, SelectionError, print_warnings
from forge.base.extensions import COMMANDS, find
from forge.cli import options as shared
from forge.cli import package_options
from forge.workspace.load import load_workspace

if TYPE_CHECKING:
    import argparse

    from forge.cli.main import Parser
    from forge.workspace.model import Package

_GRAPH = {
    "topological_graph": "forge graph",
    "topological_graph_dot": "forge graph --dot",
    "topological_graph_density": "forge graph --density",
    "topological_graph_legend": "forge graph --legend",
    "topological_graph_dot_cluster": "forge graph --dot --dot-cluster",
    "topological_graph_dot_include_skipped": "forge graph --dot --dot-include-skipped",
}


def register(parser: Parser) -> None:
    package_options.add_listing(parser)
    parser.add_argument(
        "-t", "--topological-order", action="store_true", help="sort packages in topological order"
    )
    only = parser.add_mutually_exclusive_group()
    only.add_argument("-n", "--names-only", action="store_true", help="print only the names")
    only.add_argument("-p", "--paths-only", action="store_true", help="print only the paths")
    older = parser.add_argument_group("aliases of 'forge graph', for compatibility with colcon")
    for name, command in _GRAPH.items():
        flags = (["-g"] if name == "topological_graph" else []) + [f"--{name.replace('_', '-')}"]
        older.add_argument(*flags, action="store_true", help=f"same as '{command}'")


def run(options: argparse.Namespace) -> int:
    """Print a line for each selected package, in alphabetical or topological order."""
    if any(getattr(options, name) for name in _GRAPH):
        options.dot = options.topological_graph_dot
        if not (options.dot or options.topological_graph):
            hint = "add '--topological-graph' or '--topological-graph-dot', or use 'forge graph'"
            raise SelectionError(
                Problem("options of the dependency graph given without requesting the graph", hint=hint)
            )
        options.html = options.svg = options.mermaid = False
        options.output = None
        options.density = options.topological_graph_density and not options.dot
        options.legend = options.topological_graph_legend
        options.dot_cluster = options.topological_graph_dot_cluster
        options.dot_include_skipped = options.topological_graph_dot_include_skipped
        code: int = find(COMMANDS, "graph", "command").run(options)
        return code
    loaded = load_workspace(
        Path.cwd(), package_options.query_of(options), os.environ, embedded=options.embedded
    )
    print_warnings(loaded.warnings)
    packages = [loaded.packages[node] for node in loaded.selection.names]
    if not options.topological_order:
        packages.sort(key=lambda package: (package.name, str(package.path)))
    if options.json:
        rows = [
            {"name": p.name, "path": shared.displayed(p.path, options.origin), "type": p.type}
            for p in packages
        ]
        print(json.dumps(rows, indent=2))
        return 0
    lines = [_line(package, options) for package in packages]
    for line in lines if options.topological_order else sorted(lines):
        print(line)
    return 0


def _line(package: Package, options: argparse.Namespace) -> str:
    if options.names_only:
        return package.name
    if options.paths_only:
        return shared.displayed(package.path, options.origin)
    return f"{package.name}\t{shared.displayed(package.path, options.origin)}\t({package.type})"
