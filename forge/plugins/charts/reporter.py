"""The reporter of `forge build --timings`: a page of build times and a Perfetto trace in the log folder."""

from __future__ import annotations

import json
import os
import threading
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

from forge.base.files import write_if_changed
from forge.base.templating import render
from forge.output.reporters import Report, Reporter, Run
from forge.plugins.charts.timings import (
    STEP_KINDS,
    Build,
    at_work,
    critical_path,
    facts,
    page,
    read_build,
    rows,
)
from forge.toolchain.resources import ROOT, memory

PAGE, TRACE = "timings.html", "trace.json"
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
        now, times, found = time.monotonic(), processor_times(), memory()
        (_, (busy, whole)) = self._before
        if times is None or found is None or times[1] == whole:
            return
        share = (times[0] - busy) / (times[1] - whole)
        self.samples.append((now, share * (os.cpu_count() or 1), found.total - found.available))
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

    def __init__(self, run: Run) -> None:
        self._run = run
        self._sampler = Sampler()

    def conclude(self, *, complete: bool) -> Report:
        self._sampler.stop()
        machine = memory()
        if processor_times() is None or machine is None:
            return Report()
        begun, taken = self._run.clock, self._sampler.samples
        samples = [[round(moment - begun, 3), round(busy, 2), used] for moment, busy, used in taken]
        usage = {"processors": os.cpu_count() or 1, "memory": machine.total, "samples": samples}
        return Report(events=(("Usage", None, usage),))

    def write(self) -> Iterator[str]:
        """Write the page and the trace; yield the path by which the page of the latest build is found."""
        folder = self._run.log_folder
        assert folder is not None, "--timings needs a log folder"
        write_timings(folder)
        yield f"timings: {self._run.displayed(folder.parent / 'latest_build' / PAGE)}"

    def close(self) -> None:
        self._sampler.stop()


start = Timings


def write_timings(folder: Path) -> None:
    """Write the report and the trace of a build next to its events."""
    with (folder / "events.jsonl").open(encoding="utf-8") as lines:
        build = read_build(lines)
    text = render(
        "charts/templates/timings.html.j2",
        title=f"{folder.name}: build times",
        page=page(build),
        facts=facts(build),
        kinds=STEP_KINDS,
        trace=TRACE,
    )
    write_if_changed(folder / PAGE, text)
    write_if_changed(folder / TRACE, json.dumps(trace(build)) + "\n")


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
