"""What CMake and the commands of a build folder read and wrote, as their steps were observed."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from typing import TYPE_CHECKING

from forge.base.env_vars import own_cache
from forge.base.files import text_or_nothing
from forge.base.layout import own_folders
from forge.build.inputs.depfiles import cmake_root
from forge.build.inputs.native_graph import read_native_graph
from forge.engine.commands import NOT_OBSERVED, Folders, commands_of
from forge.engine.world import PACKAGE_FOUND

if TYPE_CHECKING:
    from pathlib import Path

    from forge.base.layout import Layout
    from forge.build.inputs.native_graph import Edge, NativeGraph
    from forge.build.observed_writes import ObservedSteps
    from forge.engine.commands import ObservedCommands
    from forge.engine.observation import Process
    from forge.engine.world import World

_CACHES = ("~/.cache", "~/.ccache")
_CACHE_VARIABLES = ("CCACHE_DIR", "SCCACHE_DIR")
_COMMAND = re.compile(r"^  COMMAND = (.*)$", re.MULTILINE)
_PACKAGE = re.compile(r"^([^/#:]+)_DIR:PATH=", re.MULTILINE)
"""The packages that CMake has searched, found or not."""
_ESCAPE = re.compile(r"\$([ :$])")


def observed_commands(
    steps: ObservedSteps,
    build: Path,
    source: Path,
    layout: Layout,
    world: World,
    before: ObservedCommands,
    *,
    workspace: Path | None = None,
) -> ObservedCommands:
    """Return what the steps of a package did, and what was done `before` in its build folder."""
    if not steps.kinds:
        return NOT_OBSERVED
    graph = read_native_graph(build)
    own = (f"{folder}/" for folder in own_folders())
    caches = (*_CACHES, *filter(None, map(world.value, _CACHE_VARIABLES)))
    tracked = (*own, cmake_root(build), *(f"{os.path.expanduser(cache)}/" for cache in caches))
    sources = {path for edge in graph.edges if edge.compiles for path in graph.inputs_of(edge)}
    folders = Folders(
        build,
        (source, layout.install, layout.build),
        filter(None, tracked),
        world,
        own_cache(os.environ),
        frozenset(sources),
        source,
        workspace,
    )
    found = commands_of(steps.observed, steps.kinds, EdgeFinder(graph), folders)
    outputs = frozenset(edge.outputs[0] for edge in graph.edges)
    # Which commands ran is unknown if a part of the log is missing.
    commands = (NOT_OBSERVED if steps.observed.blind else before).merged(found, outputs)
    packages = _PACKAGE.findall(text_or_nothing(build / "CMakeCache.txt", errors="surrogateescape"))
    asked = {f"{PACKAGE_FOUND}{name}" for name in packages}.union(*(each.asked for each in commands.all))
    return replace(commands, answers=world.answers(asked))


class EdgeFinder:
    """Finds the edge that a process below ninja runs."""

    def __init__(self, graph: NativeGraph) -> None:
        self._by_output = {output: edge for edge in graph.edges for output in edge.outputs}
        self._by_command = {
            _ESCAPE.sub(r"\1", match[1]): edge
            for edge in graph.edges
            if (match := _COMMAND.search(edge.text)) is not None
        }

    def __call__(self, process: Process, written: frozenset[str]) -> tuple[str, frozenset[str]] | None:
        """Return the first output of the edge and all of its outputs; None if it is unknown."""
        edge = self.edge(process, written)
        return None if edge is None else (edge.outputs[0], frozenset(edge.outputs))

    def edge(self, process: Process, written: frozenset[str]) -> Edge | None:
        """Return the edge of a process that wrote some files; None if it is unknown."""
        edge = self._by_command.get(process.command)
        return edge or next((self._by_output[path] for path in written if path in self._by_output), None)
