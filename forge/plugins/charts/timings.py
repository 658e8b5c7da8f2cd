"""Parses the events.jsonl of a build into the times of packages and steps."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields
from typing import Any

from forge.base.frozen import frozen
from forge.base.text import counted, duration
from forge.cache.model import RESTORED
from forge.plugins.charts.commands import Command, NinjaRun
from forge.plugins.charts.graph_formats import longest_chain, printable, reduced_among
from forge.plugins.charts.headers import HeaderTimes
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
    ninja: tuple[NinjaRun, ...] = ()
    """The commands that ninja ran."""

    @property
    def seconds(self) -> float:
        return self.ended - self.begun


@frozen
class MachineUse:
    """The number of processors, the bytes of memory, and samples: time, busy processors, bytes in use.

    `jobs` is the number of commands that forge ran at the same time.
    """

    processors: int
    memory: int
    samples: tuple[tuple[float, float, int], ...]
    jobs: int


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
    headers: HeaderTimes | None = None


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
    summary = _first(events, "Summary") or {}
    usage = _first(events, "Usage")
    use = usage and MachineUse(
        usage["processors"],
        usage["memory"],
        tuple(map(tuple, usage["samples"])),
        usage.get("jobs", usage["processors"]),
    )
    headers = _first(events, "Headers")
    # Events after the last package, such as the times of headers, are not part of the build.
    moments = [event["time"] for event in events if "package" in event and event["event"] != "Commands"]
    samples = use.samples if use else ()
    ended = max((*moments, *(sample[0] for sample in samples))) if moments else 0.0
    planned = {
        event["package"]: frozenset(event.get("needs", ())) for event in events if event["event"] == "Planned"
    }
    started = {event["package"] for event in events if event["event"] == "Started"}
    # Through packages that are up to date, a package also waits for their dependencies.
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
        headers=HeaderTimes.read(headers) if headers else None,
    )


def critical_path(packages: Sequence[PackageRun]) -> tuple[PackageRun, ...]:
    """Return the chain of dependent packages with the longest total duration.

    The durations are those of this build, in which packages shared the processors: alone, the same packages
    take less time.
    """
    runs = {run.name: run for run in packages}
    needs = {run.name: run.needs for run in packages}
    return tuple(runs[name] for name in longest_chain(needs, {run.name: run.seconds for run in packages}))


def waited(run: PackageRun, runs: Mapping[str, PackageRun]) -> float:
    """Return how long a package waited for a free job after its dependencies had finished."""
    return max(0.0, run.begun - max((runs[need].ended for need in run.needs), default=0.0))


def rows(packages: Iterable[PackageRun]) -> dict[str, int]:
    """Assign each package the first free row at its start; there are as many rows as parallel packages."""
    runs = [*packages]
    return dict(zip((run.name for run in runs), packed(runs), strict=True))


def packed(spans: Iterable[PackageRun | Command]) -> list[int]:
    """Return the first free row for each of the spans, which are sorted by their start."""
    ends: list[float] = []
    assigned_rows: list[int] = []
    for span in spans:
        row = next((row for row, end in enumerate(ends) if end <= span.begun), len(ends))
        ends[row : row + 1] = [span.ended]
        assigned_rows.append(row)
    return assigned_rows


def at_work(packages: Iterable[PackageRun]) -> tuple[tuple[float, int], ...]:
    """Return the number of running packages at each time it changed."""
    changes: dict[float, int] = {0.0: 0}
    for run in packages:
        changes[run.begun] = changes.get(run.begun, 0) + 1
        changes[run.ended] = changes.get(run.ended, 0) - 1
    count, counts = 0, []
    for time in sorted(changes):
        count += changes[time]
        counts.append((time, count))
    return tuple(counts)


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
    # A package that has been started waits for a job first.
    begun = started["time"] if end is None else max(started["time"], end["time"] - end["seconds"])
    return PackageRun(
        name=started["package"],
        embedded=started["embedded"],
        reason=started["reason"],
        begun=begun,
        ended=stop["time"],
        outcome=outcome,
        steps=tuple(_steps(events, stop["time"])),
        needs=tuple(sorted(needs)),
        last=planned.get("last"),
        ninja=tuple(NinjaRun.read(event) for event in events if event["event"] == "Commands"),
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


STEP_KINDS = {
    "configure": "configure",
    "build": "build",
    "install": "install",
    "test": "test",
    "waiting": "begin and end",
}
"""Kinds of steps distinguished in the legend; the last one is forge's own work around the steps."""
_KINDS = {"cmake": "configure", "install": "install"} | dict.fromkeys(
    ("ctest", "pytest", "unittest", "test"), "test"
)


def kind_of(step: StepRun) -> str:
    """Return one of STEP_KINDS."""
    return _KINDS.get(step.label, "build")


def step_kinds(build: Build) -> dict[str, str]:
    """Return the STEP_KINDS that occur in a build, and the last one."""
    kinds = {kind_of(step) for run in build.packages for step in run.steps}
    return {kind: word for kind, word in STEP_KINDS.items() if kind in kinds or kind == "waiting"}


_SLOWEST_STEPS = 25
_SIGNS = {True: "+", False: "\N{MINUS SIGN}"}
_LEAST_CHANGE = _LEAST_WAIT = 0.05
"""Seconds below which changes are considered noise."""
_GIGA = 1e9


def page(build: Build) -> dict[str, Any]:
    """Return the values of the template; `number` is the index of a package in order of start.

    A bar and its pieces have their positions in percent; cells of the table are a number to sort by and its
    text; `critical` has index, name and duration of the packages on the critical path.
    """
    path = critical_path(build.packages)
    critical = {run.name for run in path}
    runs = {run.name: run for run in build.packages}
    common = {
        run.name: {
            "number": number,
            "name": printable(run.name),
            "critical": run.name in critical,
        }
        for number, run in enumerate(build.packages)
    }
    bars = [
        {
            **common[run.name],
            "outcome": run.outcome,
            "embedded": run.embedded,
            "took": duration(run.seconds),
            "left": _percent(run.begun, build.ended),
            "width": _percent(run.seconds, build.ended),
            "pieces": [
                {
                    "kind": FAILED if step.code else kind_of(step),
                    "left": _percent(step.begun - run.begun, run.seconds),
                    "width": _percent(step.seconds, run.seconds),
                }
                for step in run.steps
            ],
        }
        for run in build.packages
    ]
    rows = [
        {
            **common[run.name],
            "took": _timed(run.seconds),
            "last": (-1.0, "") if run.last is None else _timed(run.last),
            "change": _change(run),
            "waited": _timed(waited(run, runs)),
        }
        for run in sorted(build.packages, key=lambda run: (-round(run.seconds, 3), run.name))
    ]
    steps = [(run, step) for run in build.packages for step in run.steps]
    slowest = sorted(steps, key=lambda item: -item[1].seconds)[:_SLOWEST_STEPS]
    return {
        "headline": f"{counted(len(build.packages), 'package')} in {duration(build.seconds)}",
        "remarks": list(_remarks(build)),
        "bars": bars,
        "rows": rows,
        "steps": [
            {**common[run.name], "step": printable(step.label), "took": duration(step.seconds)}
            for run, step in slowest
        ],
        "strips": list(_strips(build)),
        "critical": [
            (common[run.name]["number"], common[run.name]["name"], duration(run.seconds)) for run in path
        ],
        "critical_took": duration(sum(run.seconds for run in path)),
        "fresh": [printable(name) for name in build.fresh],
        "skipped": [printable(name) for name in build.skipped],
    }


def facts(build: Build) -> dict[str, object]:
    """Return the data of the page's scripts: packages by index, times in seconds."""
    numbers = {run.name: number for number, run in enumerate(build.packages)}
    runs = {run.name: run for run in build.packages}
    return {
        "seconds": build.ended,
        "packages": [
            {
                "name": printable(run.name),
                "embedded": run.embedded,
                "outcome": run.outcome,
                "reason": printable(run.reason),
                "begun": round(run.begun, 3),
                "took": duration(run.seconds),
                "last": None if run.last is None else duration(run.last),
                "change": _change(run)[1],
                "waited": duration(waited(run, runs)) if waited(run, runs) >= _LEAST_WAIT else None,
                "needs": [numbers[need] for need in run.needs],
                "steps": [
                    {"label": printable(step.label), "took": duration(step.seconds), "code": step.code}
                    for step in run.steps
                ],
            }
            for run in build.packages
        ],
        "atWork": at_work(build.packages),
        "processors": build.use.processors if build.use else 0,
        "memory": build.use.memory if build.use else 0,
        "samples": build.use.samples if build.use else (),
    }


def _remarks(build: Build) -> Iterator[str]:
    """Yield sentences about results, utilization and changes since earlier builds."""
    outcomes = [run.outcome for run in build.packages]
    counts = {
        "built": outcomes.count(FINISHED),
        RESTORED: outcomes.count(RESTORED_FROM_CACHE),
        "failed": outcomes.count(FAILED),
        "aborted": outcomes.count(ABORTED),
        "not started": len(build.skipped),
        "up to date": len(build.fresh),
    }
    if set(outcomes) != {FINISHED} or build.skipped or build.fresh:
        yield ", ".join(f"{count} {word}" for word, count in counts.items() if count) + "."
    if build.packages and build.ended:
        busy = sum(run.seconds for run in build.packages) / build.ended
        text = f"On average {busy:.1f} packages ran in parallel"
        if build.use and build.use.samples:
            mean = _mean_busy(build.use)
            text += f", and {mean:.1f} of {build.use.processors} processors were busy"
        yield text + "."
    yield from (f"{outcome.words}." for outcome in build.outcomes)
    reruns = [run for run in build.packages if run.last is not None and run.outcome == FINISHED]
    if reruns:
        now, then = sum(run.seconds for run in reruns), sum(run.last or 0.0 for run in reruns)
        subject = f"{len(reruns)} of them" if len(reruns) < len(build.packages) else "They"
        change = f"{duration(abs(now - then))} {'less' if now < then else 'more'}"
        yield f"{subject} took {duration(now)} in total, {change} than in their previous builds."


def _change(run: PackageRun) -> tuple[float, str]:
    """Return how much slower a package was than in its previous build."""
    if run.last is None or run.outcome != FINISHED:
        return 0.0, ""
    change = run.seconds - run.last
    if abs(change) < _LEAST_CHANGE:
        return change, "unchanged"
    return change, f"{_SIGNS[change > 0]}{duration(abs(change))}"


def _timed(seconds: float) -> tuple[float, str]:
    return round(seconds, 3), duration(seconds)


def _strips(build: Build) -> Iterator[dict[str, str]]:
    """Yield quantities over time: a path in a box of 1000 by 100, and their maximum and mean."""
    work = at_work(build.packages)
    most = max((count for _, count in work), default=0)
    if most and build.ended:
        mean = sum(run.seconds for run in build.packages) / build.ended
        path = _stairs(work, most, build.ended)
        yield {"name": "packages at work", "path": path, "most": str(most), "mean": f"{mean:.1f}"}
    if build.use and build.use.samples and build.ended:
        use, total_time = build.use, build.ended
        times, busy, used = zip(*use.samples, strict=True)
        most_busy = f"{max(busy):.1f} of {use.processors}"
        path = _slope(zip(times, busy, strict=True), use.processors, total_time)
        yield {"name": "processors busy", "path": path, "most": most_busy, "mean": f"{_mean_busy(use):.1f}"}
        most_used = f"{max(used) / _GIGA:.1f} of {use.memory / _GIGA:.1f} GB"
        path = _slope(zip(times, used, strict=True), use.memory, total_time)
        mean_used = f"{sum(used) / len(used) / _GIGA:.1f} GB"
        yield {"name": "memory in use", "path": path, "most": most_used, "mean": mean_used}


def _mean_busy(use: MachineUse) -> float:
    """Return the average number of busy processors; samples cover the time before them."""
    processor_seconds, before = 0.0, 0.0
    for time, busy, _ in use.samples:
        processor_seconds += busy * (time - before)
        before = time
    return processor_seconds / before if before else 0.0


def _stairs(work: Sequence[tuple[float, int]], most: int, total_time: float) -> str:
    words = ["M0 100"]
    for time, count in work:
        words.append(f"H{_thousandth(time, total_time)}V{_down(count, most)}")
    return "".join((*words, "V100Z"))


def _slope(samples: Iterable[tuple[float, float]], most: float, total_time: float) -> str:
    """Return an area path below values that each cover the time before them."""
    words = ["M0 100"]
    for time, value in samples:
        words.append(f"V{_down(value, most)}H{_thousandth(time, total_time)}")
    return "".join((*words, "V100Z"))


def _thousandth(time: float, total_time: float) -> str:
    return f"{min(1000.0, max(0.0, 1000 * time / total_time)):.1f}"


def _down(value: float, most: float) -> str:
    return f"{100 - 100 * min(1.0, value / most):.1f}" if most else "100"


def _percent(part: float, total: float) -> str:
    return f"{100 * part / total:.3f}%" if total else "0%"
