"""The commands that ninja ran in the build folders of a run: their files and times, and the longest chain."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import networkx as nx

from forge.base.files import text_or_nothing
from forge.base.frozen import frozen
from forge.build.events import Event, StepFinished, StepStarted
from forge.build.inputs.native_graph import Edge, NativeGraph, read_native_graph
from forge.build.tasks import BuildPlan, StepKind

COMPILE, LINK, CONFIGURE, GENERATE = "compile", "link", "configure", "generate"
"""Kinds of commands; those with a description from CMake's add_custom_command() count as generators."""

_LOG = ".ninja_log"
_HEADER = re.compile(r"# ninja log v[5-7]\n")
_ENTRY = re.compile(r"(\d{1,15})\t(\d{1,15})\t-?\d+\t([^\t]+)\t([^\t]+)")
_LINKS = re.compile(r"\w+_LINKER__")
_RUN_NINJA = frozenset({StepKind.BUILD, StepKind.BUILD_TARGET, StepKind.INSTALL})


@frozen
class Command:
    """A command that ninja ran, and the file that it is for. Times are seconds since the start of the run."""

    kind: str
    name: str
    """The compiled source file, else the first output."""
    begun: float
    ended: float
    output: str = ""
    """The first output, as an absolute path; events do not contain it."""

    @property
    def seconds(self) -> float:
        return self.ended - self.begun


@frozen
class NinjaRun:
    """The commands of one step, and the numbers of those on the longest dependency chain."""

    package: str
    commands: tuple[Command, ...]
    chain: tuple[int, ...]

    @staticmethod
    def read(event: Mapping[str, Any]) -> NinjaRun:
        """Return the run that an event describes."""
        commands = (Command(*values) for values in event["commands"])
        return NinjaRun(event["package"], tuple(commands), tuple(event["chain"]))

    @property
    def members(self) -> Mapping[str, object]:
        """Return the members of its event."""
        commands = [
            [each.kind, each.name, round(each.begun, 3), round(each.ended, 3)] for each in self.commands
        ]
        return {"commands": commands, "chain": self.chain}

    @property
    def seconds(self) -> float:
        """The time from the start of the first command to the end of the last."""
        return max(each.ended for each in self.commands) - min(each.begun for each in self.commands)

    @property
    def work(self) -> float:
        return sum(each.seconds for each in self.commands)

    @property
    def least(self) -> float:
        """The seconds of the longest chain."""
        return sum(self.commands[number].seconds for number in self.chain)


class NinjaLogs:
    """Reads the lines that each step adds to the ninja logs of a plan, without those of earlier builds."""

    def __init__(self, plan: BuildPlan, sources: Path, clock: float) -> None:
        """Read the lines of earlier builds; times count from the monotonic time `clock`."""
        self._folders = {name: task.build_dir for name, task in plan.tasks.items()}
        self._sources = {name: sources / task.package.path for name, task in plan.tasks.items()}
        self._earlier = {name: set(_lines(folder)) for name, folder in self._folders.items()}
        self._clock = clock
        self._begun: dict[str, float] = {}
        self.runs: list[NinjaRun] = []

    def show(self, event: Event) -> None:
        match event:
            case StepStarted(name):
                self._begun[name] = time.monotonic() - self._clock
            case StepFinished(name, step) if step.kind in _RUN_NINJA:
                self._read(name)
            case _:
                pass

    def _read(self, name: str) -> None:
        folder, earlier = self._folders[name], self._earlier[name]
        new = [line for line in _lines(folder) if line not in earlier]
        if not new:
            return
        earlier.update(new)
        graph = read_native_graph(folder)
        commands = tuple(commands_of(new, graph, folder, self._sources[name], self._begun[name]))
        if commands:
            self.runs.append(NinjaRun(name, commands, longest_chain(commands, graph)))


def commands_of(
    lines: Sequence[str], graph: NativeGraph, build: Path, source: Path, begun: float
) -> Iterator[Command]:
    """Yield the commands of lines of a ninja log, in the order of their start.

    A command with several outputs has a line for each.
    """
    edges = {output: edge for edge in graph.edges for output in edge.outputs}
    outputs: dict[tuple[int, int, str], str] = {}
    for line in lines:
        if entry := _ENTRY.fullmatch(line):
            first, last, path, digest = entry.groups()
            outputs.setdefault((int(first), int(last), digest), os.path.normpath(build / path))
    for (start, end, _), output in sorted(outputs.items()):
        edge = edges.get(output)
        kind = _kind(edge, output)
        file = edge.inputs[0] if edge and edge.compiles and edge.inputs else output
        yield Command(kind, _shown(file, build, source), begun + start / 1e3, begun + end / 1e3, output)


def longest_chain(commands: Sequence[Command], graph: NativeGraph) -> tuple[int, ...]:
    """Return the numbers of the dependent commands that take longest in total."""
    edges = {output: edge for edge in graph.edges for output in edge.outputs}
    makers = {
        output: number
        for number, command in enumerate(commands)
        for output in (edges[command.output].outputs if command.output in edges else (command.output,))
    }
    chart: nx.DiGraph[int] = nx.DiGraph()
    for number, command in enumerate(commands):
        # The weight of an edge is that of the command it leads to; -1 precedes all commands.
        chart.add_edge(-1, number, seconds=command.seconds)
        edge = edges.get(command.output)
        pending = [*graph.inputs_of(edge)] if edge else []
        while pending:
            path = pending.pop()
            maker = makers.get(path, number)
            if maker != number:
                chart.add_edge(maker, number, seconds=command.seconds)
            pending += graph.aliases.get(path, ())
    if not nx.is_directed_acyclic_graph(chart):  # a log of another build.ninja
        return ()
    return tuple(number for number in nx.dag_longest_path(chart, "seconds") if number >= 0)


def _lines(folder: Path) -> list[str]:
    """Return the entries of a ninja log of a known version."""
    text = text_or_nothing(folder / _LOG, errors="surrogateescape")
    header = _HEADER.match(text)
    return [line for line in text[header.end() :].split("\n") if line] if header else []


def _kind(edge: Edge | None, output: str) -> str:
    if edge is None:
        return CONFIGURE if Path(output).name == "build.ninja" else GENERATE
    if edge.compiles:
        return COMPILE
    return LINK if _LINKS.match(edge.rule) else GENERATE


def _shown(path: str, build: Path, source: Path) -> str:
    """Return a path relative to the package's sources or build folder, if it is in one of them."""
    for folder in (source, build):
        if path.startswith(f"{folder}{os.sep}"):
            return path[len(f"{folder}{os.sep}") :]
    return path
