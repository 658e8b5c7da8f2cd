"""Record what CMake and the commands of a build folder read and wrote, as their steps were observed."""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING

from forge.base.layout import PACKAGE, SCRATCH_DIR
from forge.build.inputs.depfiles import cmake_root
from forge.build.inputs.native_graph import read_native_graph
from forge.build.observed_writes import read_steps
from forge.build.prefix import written_log
from forge.engine.commands import NOT_OBSERVED, Folders, commands_of, read_commands, write_commands

if TYPE_CHECKING:
    from pathlib import Path

    from forge.base.layout import Layout
    from forge.build.inputs.native_graph import Edge, NativeGraph
    from forge.build.tasks import Task
    from forge.engine.observation import Process

COMMANDS, COMMANDS_BEFORE = "commands.json", "commands_before.json"
"""What is known of the commands whose products are in a build folder, and what was before this build."""
_CACHES = ("~/.cache", "~/.ccache")
_COMMAND = re.compile(r"^  COMMAND = (.*)$", re.MULTILINE)
_ESCAPE = re.compile(r"\$([ :$])")


def record_commands(task: Task, source: Path, layout: Layout) -> frozenset[str]:
    """Record what the steps of a task have done, successful or not.

    Returns the files that they, or earlier steps whose products are kept, read outside of the workspace.
    """
    build = task.build_dir
    steps = read_steps(written_log(task.name, layout))
    if not steps.kinds:
        return frozenset()
    graph = read_native_graph(build)
    tracked = (f"{PACKAGE}/", cmake_root(build), *(f"{os.path.expanduser(cache)}/" for cache in _CACHES))
    folders = Folders(build, (source, layout.install, layout.build), filter(None, tracked))
    found = commands_of(steps.observed, steps.kinds, EdgeFinder(graph), folders)
    outputs = frozenset(edge.outputs[0] for edge in graph.edges)
    # Which commands ran is unknown if a part of the log is missing.
    is_whole = not steps.observed.blind
    before = read_commands(build / SCRATCH_DIR / COMMANDS_BEFORE) if is_whole else NOT_OBSERVED
    commands = before.merged(found, outputs)
    write_commands(build / SCRATCH_DIR / COMMANDS, commands)
    return commands.all_external()


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
