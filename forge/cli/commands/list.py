"""`forge list`: list the packages of a workspace with name, path and type."""

from __future__ import annotations

import json
import os
from dataclasses import fields
from pathlib import Path
from typing import Any

from forge.base.errors import Problem, SelectionError, print_warnings
from forge.base.extensions import COMMANDS, find
from forge.base.frozen import frozen
from forge.base.options import flag, options_of
from forge.cli import options as shared
from forge.cli.options import OptionSources
from forge.workspace.load import LoadedWorkspace, load_workspace
from forge.workspace.selection import Query

_GRAPH = "topological_graph"


@frozen
class ListingOptions:
    """The options of commands that only show packages."""

    query: Query = options_of(Query)
    sources: OptionSources = options_of(OptionSources)
    build_base: str = shared.build_base_option()
    embedded: bool = flag("include the packages embedded in forge")
    json: bool = flag("print the output as JSON")

    def load(self) -> LoadedWorkspace:
        """Return the workspace in the current folder; print its warnings."""
        loaded = load_workspace(Path.cwd(), self.query, os.environ, embedded=self.embedded)
        print_warnings(loaded.warnings)
        return loaded


def _alias(command: str, short: str = "") -> Any:
    group = "aliases of 'forge graph', for compatibility with colcon"
    return flag(f"same as '{command}'", short=short, group=group)


@frozen
class Options:
    listing: ListingOptions = options_of(ListingOptions)
    topological_order: bool = flag("sort packages in topological order", short="-t")
    names_only: bool = flag("print only the names", short="-n", conflicts="columns")
    paths_only: bool = flag("print only the paths", short="-p", conflicts="columns")
    topological_graph: bool = _alias("forge graph", "-g")
    topological_graph_dot: bool = _alias("forge graph --dot")
    topological_graph_density: bool = _alias("forge graph --density")
    topological_graph_legend: bool = _alias("forge graph --legend")
    topological_graph_dot_cluster: bool = _alias("forge graph --dot --dot-cluster")
    topological_graph_dot_include_skipped: bool = _alias("forge graph --dot --dot-include-skipped")
    origin: str = os.curdir


def run(options: Options) -> int:
    names = [each.name for each in fields(Options) if each.name.startswith(_GRAPH)]
    of_graph = {name.removeprefix(_GRAPH).lstrip("_"): getattr(options, name) for name in names}
    if any(of_graph.values()):
        requested, dot = of_graph.pop(""), of_graph["dot"]
        if not (dot or requested):
            hint = "add '--topological-graph' or '--topological-graph-dot', or use 'forge graph'"
            raise SelectionError(
                Problem("options of the dependency graph given without requesting the graph", hint=hint)
            )
        graph = find(COMMANDS, "graph", "command")
        of_graph["density"] = of_graph["density"] and not dot
        code: int = graph.run(graph.Options(options.listing, **of_graph))
        return code
    loaded = options.listing.load()
    packages = [loaded.packages[node] for node in loaded.selection.names]
    if not options.topological_order:
        packages.sort(key=lambda package: (package.name, str(package.path)))
    rows = [
        {"name": each.name, "path": shared.displayed(each.path, options.origin), "type": each.type}
        for each in packages
    ]
    if options.listing.json:
        print(json.dumps(rows, indent=2))
        return 0
    form = "{path}" if options.paths_only else "{name}\t{path}\t({type})"
    lines = [("{name}" if options.names_only else form).format(**row) for row in rows]
    for line in lines if options.topological_order else sorted(lines):
        print(line)
    return 0
