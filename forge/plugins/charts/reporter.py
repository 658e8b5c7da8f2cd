"""The reporter of `forge build --timings`: a page of build times and a Perfetto trace in the log folder."""

from __future__ import annotations

import contextlib
import json
import os
import threading
import time
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.errors import Problem, SelectionError
from forge.base.files import write_if_changed
from forge.base.templating import render
from forge.build.events import Event
from forge.output.reporters import Report, Reporter, Run, Start
from forge.plugins.charts.commands import COMPILE, NinjaLogs
from forge.plugins.charts.graph_formats import printable
from forge.plugins.charts.headers import find_clang, measure_headers
from forge.plugins.charts.timings import (
    Build,
    at_work,
    critical_path,
    facts,
    packed,
    page,
    read_build,
    rows,
    step_kinds,
)
from forge.plugins.charts.work import comparison, lines, work
from forge.toolchain.resources import ROOT, memory

if TYPE_CHECKING:
    from forge.cli.build_options import BuildOptions
    from forge.plugins.charts.live import LiveBuild, LiveServer

PAGE, TRACE = "timings.html", "trace.json"
HEADERS, LIVE = "headers", "live"
"""The words of --timings for the times of headers, and for the page of the running build."""
_MEASURED = 20
"""The number of source files whose headers are measured, the slowest ones."""
PERIOD_SECONDS = 0.2
_MOST = 1500
"""Maximum number of samples, more than a chart has pixels; beyond it, pairs of samples are merged."""


class Sampler:
    """Takes samples of /proc in a thread until stopped; the period doubles whenever there are too many.

    A sample is a time of the monotonic clock, the number of busy processors since the previous sample, and
    the bytes in use. They include all processes of the machine, because others may slow down a build.
    """

    def __init__(self, period: float = PERIOD_SECONDS, most: int = _MOST) -> None:
        self._period = period
        self._most = most
        self.samples: list[tuple[float, float, int]] = []
        self._before = (time.monotonic(), processor_times() or (0, 0))
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._sample_periodically, name="sampling", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        if not self._stopped.is_set():
            self._stopped.set()
            self._thread.join()
            self._sample()

    def _sample(self) -> None:
        now, times, machine_memory = time.monotonic(), processor_times(), memory()
        (_, (busy, total)) = self._before
        if times is None or machine_memory is None or times[1] == total:
            return
        share = (times[0] - busy) / (times[1] - total)
        self.samples.append(
            (now, share * (os.cpu_count() or 1), machine_memory.total - machine_memory.available)
        )
        self._before = (now, times)
        if len(self.samples) > self._most:
            self.samples = [
                (later, (busy + other) / 2, max(used, most))
                for (_, busy, used), (later, other, most) in zip(*[iter(self.samples)] * 2, strict=False)
            ]
            self._period *= 2

    def _sample_periodically(self) -> None:
        while not self._stopped.wait(self._period):
            self._sample()


def processor_times(root: Path = ROOT) -> tuple[int, int] | None:
    """Return the busy and the total time of all processors, in ticks since boot; None if unavailable."""
    try:
        first, _, _ = (root / "proc/stat").read_text(encoding="ascii").partition("\n")
    except OSError:
        return None
    # user nice system idle iowait irq softirq steal; guests are in user and nice already
    word, *numbers = first.split()[:9]
    ticks = [int(number) for number in numbers]
    return (sum(ticks) - sum(ticks[3:5]), sum(ticks)) if word == "cpu" else None


class Timings(Reporter):
    """The report on one build, during which the use of the machine is sampled."""

    def __init__(self, run: Run, wanted: str = "", compared: Path | None = None) -> None:
        """Start observing.

        `wanted` are the words of --timings, `compared` is the log folder of a build ('.': the previous one).
        """
        self._run = run
        self._wanted = frozenset(wanted.split(","))
        self._compared = compared
        self._clang = find_clang(run.variables) if HEADERS in self._wanted else None
        if HEADERS in self._wanted and self._clang is None:
            hint = "install clang; it need not be the compiler of the build"
            run.warn(
                [
                    Problem(
                        "header times are not reported: only clang measures them, and it is not on PATH",
                        hint=hint,
                    )
                ]
            )
        self._logs = NinjaLogs(run.plan, run.root, run.clock)
        self._sampler = Sampler()
        self._live: LiveBuild | None = None
        self._server: LiveServer | None = None
        if LIVE in self._wanted:
            from forge.plugins.charts.live import LiveBuild, LiveServer

            self._live = LiveBuild(run, self._usage)
            self._server = LiveServer(self._live, f"{printable(run.root.name)}: {run.command}")
            run.say(f"live: {self._server.address}")

    def follow(self, event: Event) -> None:
        self._logs.show(event)
        if self._live:
            self._live.show(event)

    def _usage(self) -> Mapping[str, object]:
        """Return the use of the machine according to the last sample."""
        machine, samples = memory(), self._sampler.samples
        if machine is None or not samples:
            return {}
        _, busy, used = samples[-1]
        words = {"used": f"{used / 1e9:.1f}", "memory": f"{machine.total / 1e9:.1f} GB"}
        return {"busy": f"{busy:.1f}", "processors": os.cpu_count() or 1, **words}

    def conclude(self, *, complete: bool) -> Report:
        self._sampler.stop()
        events: list[tuple[str, str | None, Mapping[str, object]]] = [
            ("Commands", ninja_run.package, ninja_run.members) for ninja_run in self._logs.runs
        ]
        machine = memory()
        if processor_times() is not None and machine is not None:
            begun, raw_samples = self._run.clock, self._sampler.samples
            samples = [[round(moment - begun, 3), round(busy, 2), used] for moment, busy, used in raw_samples]
            size = {"processors": os.cpu_count() or 1, "memory": machine.total, "jobs": self._run.jobs}
            events.append(("Usage", None, {**size, "samples": samples}))
        if self._clang and complete and self._logs.runs:
            slowest = sorted(
                (
                    (self._run.plan.tasks[ninja_run.package].build_dir, command)
                    for ninja_run in self._logs.runs
                    for command in ninja_run.commands
                    if command.kind == COMPILE
                ),
                key=lambda item: -item[1].seconds,
            )[:_MEASURED]
            outputs = [(folder, command.output) for folder, command in slowest]
            header_times = measure_headers(outputs, self._clang, self._run.variables, self._run.jobs)
            events.append(("Headers", None, header_times.members))
        return Report(events=tuple(events))

    def write(self) -> Iterator[str]:
        """Write the page and the trace; yield the path by which the page of the latest build is found."""
        folder = self._run.log_folder
        assert folder is not None, "--timings needs a log folder"
        earlier = None
        if self._compared is not None:
            earlier = self._compared if self._compared.name else previous_build(folder)
            if earlier is None or not read_log(earlier).packages:
                yield "timings: no earlier build to compare with"
                earlier = None
        build = write_timings(folder, earlier)
        yield from lines(build)
        yield f"timings: {self._run.displayed(folder.parent / f'latest_{self._run.command}' / PAGE)}"

    def close(self) -> None:
        self._sampler.stop()
        if self._server:
            self._server.close()


start = Timings


def previous_build(folder: Path) -> Path | None:
    """Return the log folder of the last build before that of `folder` that built something."""
    command, _, _ = folder.name.partition("_")
    earlier = sorted(other for other in folder.parent.glob(f"{command}_*") if other.name < folder.name)
    return next((other for other in reversed(earlier) if read_log(other).packages), None)


def read_log(folder: Path) -> Build:
    """Read the events in a log folder; those of other versions or programs may be unreadable."""
    with (
        contextlib.suppress(OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError),
        (folder / "events.jsonl").open(encoding="utf-8", errors="replace") as events,
    ):
        return read_build(events)
    return read_build(())


def timings_page(title: str, build: Build, difference: Mapping[str, object] | None = None) -> str:
    """Return the page of a build, perhaps with a comparison."""
    return render(
        "charts/templates/timings.html.j2",
        title=title,
        page=page(build),
        work=work(build),
        comparison=difference,
        facts=facts(build),
        kinds=step_kinds(build),
        trace=TRACE,
    )


def write_timings(folder: Path, compared: Path | None = None) -> Build:
    """Write the report and the trace of a build next to its events; compare it with an earlier one."""
    build = read_log(folder)
    difference = comparison(build, read_log(compared), compared.name) if compared else None
    write_if_changed(folder / PAGE, timings_page(f"{folder.name}: build times", build, difference))
    write_if_changed(folder / TRACE, json.dumps(trace(build)) + "\n")
    return build


def trace(build: Build) -> dict[str, object]:
    """Return the build in the trace event format of Perfetto and chrome://tracing."""
    return {"displayTimeUnit": "ms", "traceEvents": list(_trace_events(build))}


def _trace_events(build: Build) -> Iterator[Mapping[str, object]]:
    """Yield packages in as many rows as ran in parallel, their steps, and counters."""
    yield _naming("process_name", 1, 0, "build")
    in_row = rows(build.packages)
    for row in range(max(in_row.values(), default=-1) + 1):
        yield _naming("thread_name", 1, row, f"job {row + 1}")
    for run in build.packages:
        details = {"outcome": run.outcome, "reason": run.reason, "needs": run.needs, "last": run.last}
        yield _stretch(run.name, "package", (run.begun, run.seconds), in_row[run.name], details)
        for step in run.steps:
            yield _stretch(
                step.label, "step", (step.begun, step.seconds), in_row[run.name], {"code": step.code}
            )
    yield _naming("process_name", 2, 0, "critical path")
    for run in critical_path(build.packages):
        yield {**_stretch(run.name, "package", (run.begun, run.seconds), 0, {}), "pid": 2}
    commands = sorted(
        ((command, run) for run in build.packages for ninja in run.ninja for command in ninja.commands),
        key=lambda item: item[0].begun,
    )
    yield _naming("process_name", 3, 0, "commands of ninja")
    for row, (command, run) in zip(packed(command for command, _ in commands), commands, strict=True):
        details = {"package": run.name, "kind": command.kind}
        span = command.begun, command.seconds
        yield {**_stretch(command.name, "command", span, row, details), "pid": 3}
    for moment, count in at_work(build.packages):
        yield _counter("packages at work", moment, count)
    for moment, busy, used in build.use.samples if build.use else ():
        yield _counter("processors busy", moment, busy)
        yield _counter("memory in use", moment, used)


def _naming(what: str, process: int, row: int, name: str) -> Mapping[str, object]:
    return {"ph": "M", "name": what, "pid": process, "tid": row, "args": {"name": name}}


def _stretch(
    name: str, category: str, span: tuple[float, float], row: int, details: Mapping[str, object]
) -> Mapping[str, object]:
    begun, seconds = (round(seconds * 1e6) for seconds in span)
    return {
        "ph": "X",
        "name": name,
        "cat": category,
        "pid": 1,
        "tid": row,
        "ts": begun,
        "dur": seconds,
        "args": details,
    }


def _counter(name: str, moment: float, value: float) -> Mapping[str, object]:
    return {"ph": "C", "name": name, "pid": 1, "tid": 0, "ts": round(moment * 1e6), "args": {name: value}}


def start_of(options: BuildOptions) -> Start:
    """Return the function that starts the reporter; raises SelectionError for an unknown log folder."""
    compared = None
    if options.timings_compare is not None:
        compared = _log_folder(options) if options.timings_compare else Path()
    return partial(start, wanted=options.timings or "", compared=compared)


def _log_folder(options: BuildOptions) -> Path:
    name, logs = options.timings_compare or "", options.folders.layout(Path.cwd()).logs or Path()
    for folder in (Path(options.origin, name), logs / name):
        if (folder / "events.jsonl").is_file():
            return folder.resolve()
    message = f"--timings-compare: there is no log of a build in '{name}'"
    raise SelectionError(Problem(message, hint=f"the logs of builds are in '{logs}'"))
