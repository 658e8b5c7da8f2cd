"""Events as JSON lines, in the log and with --json on stdout.

docs/reference/events.md documents the format, which is stable.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict

from forge.base.errors import EXIT_INTERRUPTED, Problem
from forge.base.graph import reduced
from forge.base.signals import ignore_closed_output
from forge.base.text import split_lines
from forge.build.events import (
    Aborted,
    Event,
    Finished,
    Fresh,
    Output,
    Skipped,
    Started,
    StepFinished,
    StepStarted,
)
from forge.build.tasks import BuildPlan, Step
from forge.output.console import ConsoleReporter
from forge.workspace.model import Package


class JsonEvents:
    """Writes the JSON lines of one run; owned by the main loop."""

    def __init__(
        self,
        plan: BuildPlan,
        packages: Mapping[str, Package],
        *,
        log: Callable[[bytes], object] | None = None,
        printed: bool = False,
        output: bool = False,
    ) -> None:
        """Start the clock; write to `log`, and if `printed` to stdout, with package output if `output`."""
        self._plan = plan
        self._packages = packages
        self._log = log
        self.printed = printed
        self._output = output
        self.begun = time.monotonic()
        self.observers: list[Callable[[Mapping[str, object]], object]] = []

    def announce(self, *, steps: bool = False, seconds: Mapping[str, float] | None = None) -> None:
        """Write the plan, with the commands of packages if `steps`, and the `seconds` of their last build."""
        last = seconds or {}
        needs = reduced({name: task.needs for name, task in self._plan.tasks.items()}, [*self._plan.tasks])
        for name in self._plan.fresh:
            self.emit("Fresh", name)
        for name, task in self._plan.tasks.items():
            commands = {"steps": [_step(step) for step in task.steps]} if steps else {}
            duration = {"last": round(last[name], 3)} if name in last else {}
            planned = {"reason": task.reason, "conditional": task.conditional, "needs": needs[name]}
            self.emit("Planned", name, **planned, **duration, **commands)

    def write(self, event: Event, report: ConsoleReporter, why: Problem | None = None) -> None:
        """Write one event with the report's result; `why` is the reason if a package could not be started."""
        match event:
            case Started(name):
                self.emit("Started", name, reason=self._plan.tasks[name].reason)
            case Fresh(name):
                self.emit("Fresh", name)
            case StepStarted(name, step):
                self.emit("StepStarted", name, **_step(step))
            case StepFinished(name, step, code):
                self.emit("StepFinished", name, step=step.label, code=code)
            case Output(name, lines, stderr):
                for line in split_lines(lines) if self.printed and self._output else ():
                    text = line.decode(errors="replace")
                    self._print(_as_line(self._members("Output", name, line=text, stderr=stderr)))
            case Finished(name, code, seconds):
                values: dict[str, object] = {
                    "code": code,
                    "seconds": round(seconds, 3),
                    "log": str(report.logs / name) if report.logs else None,
                    "test_failures": name in report.failed_tests,
                }
                if event.cache:
                    values["cache"] = event.cache
                if failure := report.failures.get(name):
                    error = failure.error.lines if failure.error else ()
                    values |= {
                        "step": event.step.label if event.step else None,
                        "error": [why.message] if why else error,
                        "hint": why.hint if why else failure.hint,
                        "repeat": failure.repeat,
                    }
                self.emit("Finished", name, **values)
            case Aborted(name, seconds):
                self.emit("Aborted", name, seconds=round(seconds, 3))
            case Skipped(name, because):
                self.emit("Skipped", name, because=because)

    def conclude(self, report: ConsoleReporter, seconds: float, code: int | None = None) -> None:
        """Write the results, ending with a Summary; `code` overrides the exit code of the report."""
        for outcome in report.launcher_summaries:
            counted = {name: number for name, number in asdict(outcome).items() if number is not None}
            self.emit("Launcher", None, **counted)
        log = str(report.logs) if report.logs else None
        if isinstance(sys.exc_info()[1], KeyboardInterrupt):
            code = EXIT_INTERRUPTED
        elif code is None:
            code = report.exit_code
        tests = {"tests": asdict(report.test_counts)} if report.test_counts is not None else {}
        self.emit(
            "Summary", None, code=code, seconds=round(seconds, 3), log=log, **asdict(report.tally), **tests
        )

    def emit(self, event: str, name: str | None, **values: object) -> None:
        members = self._members(event, name, **values)
        line = _as_line(members)
        if self._log:
            self._log(line)
        if self.printed:
            self._print(line)
        for observe in self.observers:
            observe(members)

    def _members(self, event: str, name: str | None, **values: object) -> dict[str, object]:
        members: dict[str, object] = {"event": event, "time": round(time.monotonic() - self.begun, 6)}
        if name is not None:
            members |= {"package": name, "embedded": self._packages[name].embedded}
        return {**members, **values}

    def _print(self, line: bytes) -> None:
        with ignore_closed_output(1):
            sys.stdout.write(line.decode())
            # Readers of a pipe process each line immediately.
            sys.stdout.flush()


def _as_line(members: Mapping[str, object]) -> bytes:
    return json.dumps(members).encode() + b"\n"


def _step(step: Step) -> dict[str, object]:
    return {"step": step.label, "argv": step.argv, "cwd": str(step.cwd)}
