"""Parses the events.jsonl of a build into the times of packages and steps."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields
from typing import Any

import networkx as nx

from forge.base.frozen import frozen
from forge.cache.model import RESTORED
from forge.plugins.charts.graph_formats import reduced_among
from forge.toolchain.compiler_launchers import LauncherSummary

FINISHED, FAILED, ABORTED, RESTORED_FROM_CACHE = "finished", "failed", "aborted", "taken"
"""Results of packages."""

_SUMMARY = tuple(each.name for each in fields(LauncherSummary))


@frozen
class StepRun:
    """A step of a package. Times are seconds since the first event; `code` is None if it was aborted."""

    label: str
    begun: float
    ended: float
    code: int | None

    @property
    def seconds(self) -> float:
        return self.ended - self.begun


@frozen
class PackageRun:
    """A package that was started. `needs` are the packages of this build that it waited for.

    `last` is the duration of its previous build, None if unknown.
    """

    name: str
    embedded: bool
    reason: str
    begun: float
    ended: float
    outcome: str
    steps: tuple[StepRun, ...]
    needs: tuple[str, ...]
    last: float | None

    @property
    def seconds(self) -> float:
        return self.ended - self.begun


@frozen
class MachineUse:
    """The number of processors, the bytes of memory, and samples: time, busy processors, bytes in use."""

    processors: int
    memory: int
    samples: tuple[tuple[float, float, int], ...]


@frozen
class Build:
    """A build: packages in order of their start, and those up to date or skipped.

    `ended` is the time of the last event, `seconds` the duration of the command.
    """

    packages: tuple[PackageRun, ...]
    fresh: tuple[str, ...]
    skipped: tuple[str, ...]
    ended: float
    seconds: float
    code: int
    use: MachineUse | None
    outcomes: tuple[LauncherSummary, ...] = ()


def read_build(lines: Iterable[str]) -> Build:
    """Parse the events of one run; an incomplete last line is ignored."""
    events: list[Mapping[str, Any]] = []
    for line in lines:
        with suppress(ValueError):
            event = json.loads(line)
            events += [event] if isinstance(event, dict) and {"event", "time"} <= event.keys() else []
    by_package: dict[str, list[Mapping[str, Any]]] = {}
    for event in events:
        if "package" in event:
            by_package.setdefault(event["package"], []).append(event)
    ended = events[-1]["time"] if events else 0.0
    summary = _first(events, "Summary") or {}
    usage = _first(events, "Usage")
    use = usage and MachineUse(usage["processors"], usage["memory"], tuple(map(tuple, usage["samples"])))
    planned = {
        event["package"]: frozenset(event.get("needs", ())) for event in events if event["event"] == "Planned"
    }
    started = {event["package"] for event in events if event["event"] == "Started"}
    # A package also waits, over packages that are up to date, for what these depend on.
    needs = reduced_among(planned, planned, started)
    runs = [_package(own, ended, needs[name]) for name, own in by_package.items() if name in started]
    return Build(
        packages=tuple(sorted(runs, key=lambda run: run.begun)),
        fresh=tuple(name for name, own in by_package.items() if _first(own, "Fresh")),
        skipped=tuple(name for name, own in by_package.items() if _first(own, "Skipped")),
        ended=ended,
        seconds=summary.get("seconds", ended),
        code=summary.get("code", 0),
        use=use or None,
        outcomes=tuple(
            LauncherSummary(**{key: event[key] for key in _SUMMARY if key in event})
            for event in events
            if event["event"] == "Launcher"
        ),
    )


def critical_path(packages: Sequence[PackageRun]) -> tuple[PackageRun, ...]:
    """Return the chain of dependent packages with the longest total duration.

    The durations are those of this build, in which packages shared the processors: without others beside
    them, the same packages take less time.
    """
    runs = {run.name: run for run in packages}
    graph: nx.DiGraph[str] = nx.DiGraph()
    for run in packages:
        # An edge weighs as much as the package it leads to; those without dependencies follow "".
        graph.add_edges_from(((need, run.name) for need in ("", *run.needs)), seconds=run.seconds)
    return tuple(runs[name] for name in nx.dag_longest_path(graph, "seconds") if name)


def waited(run: PackageRun, runs: Mapping[str, PackageRun]) -> float:
    """Return how long a package waited for a free job after its dependencies had finished."""
    return max(0.0, run.begun - max((runs[need].ended for need in run.needs), default=0.0))


def rows(packages: Iterable[PackageRun]) -> dict[str, int]:
    """Assign each package the first free row at its start; there are as many rows as parallel packages."""
    ends: list[float] = []
    found: dict[str, int] = {}
    for run in packages:
        row = next((row for row, end in enumerate(ends) if end <= run.begun), len(ends))
        ends[row : row + 1] = [run.ended]
        found[run.name] = row
    return found


def at_work(packages: Iterable[PackageRun]) -> tuple[tuple[float, int], ...]:
    """Return the number of running packages at each time it changed."""
    changes: dict[float, int] = {0.0: 0}
    for run in packages:
        changes[run.begun] = changes.get(run.begun, 0) + 1
        changes[run.ended] = changes.get(run.ended, 0) - 1
    count, found = 0, []
    for time in sorted(changes):
        count += changes[time]
        found.append((time, count))
    return tuple(found)


def _package(events: Sequence[Mapping[str, Any]], ended: float, needs: Iterable[str]) -> PackageRun:
    started, end = _first(events, "Started") or {}, _first(events, "Finished")
    planned = _first(events, "Planned") or {}
    if end is None:
        outcome = ABORTED
    elif end["code"]:
        outcome = FAILED
    else:
        outcome = RESTORED_FROM_CACHE if end.get("cache") == RESTORED else FINISHED
    stop = end or _first(events, "Aborted") or {"time": ended}
    return PackageRun(
        name=started["package"],
        embedded=started["embedded"],
        reason=started["reason"],
        begun=started["time"],
        ended=stop["time"],
        outcome=outcome,
        steps=tuple(_steps(events, stop["time"])),
        needs=tuple(sorted(needs)),
        last=planned.get("last"),
    )


def _steps(events: Sequence[Mapping[str, Any]], ended: float) -> Iterable[StepRun]:
    open_step: Mapping[str, Any] | None = None
    for event in events:
        if event["event"] == "StepStarted":
            open_step = event
        elif event["event"] == "StepFinished" and open_step:
            yield StepRun(open_step["step"], open_step["time"], event["time"], event["code"])
            open_step = None
    if open_step:
        yield StepRun(open_step["step"], open_step["time"], ended, None)


def _first(events: Iterable[Mapping[str, Any]], word: str) -> Mapping[str, Any] | None:
    return next((event for event in events if event["event"] == word), None)
