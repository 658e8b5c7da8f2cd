"""What happens, as JSON: a line for each event, in the log and, where it was asked for, on stdout.

docs/reference/events.md is the vocabulary; a tool may read it, so a word in it does not change.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import asdict
from typing import TYPE_CHECKING

from forge.errors import EXIT_INTERRUPTED
from forge.excerpts import split_lines
from forge.graph import reduced
from forge.interrupts import heard_by_somebody
from forge.model import (
    Aborted,
    Finished,
    Fresh,
    Output,
    Skipped,
    Started,
    StepFinished,
    StepStarted,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from forge.errors import Problem
    from forge.model import BuildPlan, Event, Package, Step
    from forge.pictures.sampling import Usage
    from forge.reporting import Report
    from forge.testing.showing import Failure


class Feed:
    """The lines of one run, in the order of what happens; owned by the loop of the command."""

    def __init__(
        self,
        plan: BuildPlan,
        packages: Mapping[str, Package],
        *,
        log: Callable[[bytes], object] | None = None,
        printed: bool = False,
        output: bool = False,
    ) -> None:
        """Begin the clock; lines go to `log`, and to stdout if `printed`, there with what programs print."""
        self._plan = plan
        self._packages = packages
        self._log = log
        self._printed = printed
        self._output = output
        self._begun = time.monotonic()

    def announce(self, *, steps: bool = False, seconds: Mapping[str, float] | None = None) -> None:
        """Tell what the plan is, with the commands of each package if `steps`.

        `seconds` says how long packages took when they were built the last time.
        """
        last = seconds or {}
        needs = reduced({name: task.needs for name, task in self._plan.tasks.items()}, [*self._plan.tasks])
        for name in self._plan.fresh:
            self._say("Fresh", name)
        for name, task in self._plan.tasks.items():
            commands = {"steps": [_step(step) for step in task.steps]} if steps else {}
            known = {"last": round(last[name], 3)} if name in last else {}
            told = {"reason": task.reason, "conditional": task.conditional, "needs": needs[name]}
            self._say("Planned", name, **told, **known, **commands)

    def write(self, event: Event, report: Report, why: Problem | None = None) -> None:
        """Tell of one event, and what the report made of it; `why` is known of what could not begin."""
        match event:
            case Started(name):
                self._say("Started", name, reason=self._plan.tasks[name].reason)
            case Fresh(name):
                self._say("Fresh", name)
            case StepStarted(name, step):
                self._say("StepStarted", name, **_step(step))
            case StepFinished(name, step, code):
                self._say("StepFinished", name, step=step.label, code=code)
            case Output(name, lines, stderr):
                self._pass_on(name, lines, stderr=stderr)
            case Finished():
                self._finish(event, report, why)
            case Aborted(name, seconds):
                self._say("Aborted", name, seconds=round(seconds, 3))
            case Skipped(name, because):
                self._say("Skipped", name, because=because)

    def tell_failures(self, failures: Iterable[Failure]) -> None:
        """Tell of tests that failed, each by itself."""
        for failure in failures:
            self._say(
                "TestFailure",
                failure.package,
                test=failure.test,
                message=list(failure.lines),
                repeat=failure.repeat,
            )

    def tell_usage(self, usage: Usage) -> None:
        """Tell how much of the machine was in use in the course of it all."""
        samples = [[round(time - self._begun, 3), round(busy, 2), used] for time, busy, used in usage.samples]
        self._say("Usage", None, processors=usage.processors, memory=usage.memory, samples=samples)

    def conclude(self, report: Report, seconds: float, code: int | None = None) -> None:
        """Tell what came of it all, last in one line. The code is the report's, unless another is given."""
        for outcome in report.outcomes:
            counted = {name: number for name, number in asdict(outcome).items() if number is not None}
            self._say("Launcher", None, **counted)
        log = str(report.logs) if report.logs else None
        if isinstance(sys.exc_info()[1], KeyboardInterrupt):
            code = EXIT_INTERRUPTED
        elif code is None:
            code = report.exit_code
        self._say("Summary", None, code=code, seconds=round(seconds, 3), log=log, **asdict(report.tally))

    def _pass_on(self, name: str, lines: bytes, *, stderr: bool) -> None:
        """Tell what a program printed, where that was asked for; the log has it in files of its own."""
        for line in split_lines(lines) if self._printed and self._output else ():
            said = line.decode(errors="replace")
            self._print(self._line("Output", name, line=said, stderr=stderr))

    def _finish(self, event: Finished, report: Report, why: Problem | None) -> None:
        name, fault = event.task, report.fault(event.task)
        said: dict[str, object] = {
            "code": event.code,
            "seconds": round(event.seconds, 3),
            "log": str(report.logs / name) if report.logs else None,
            "test_failures": name in report.failed_tests,
        }
        if event.cache:
            said["cache"] = event.cache
        if fault:
            said |= {
                "step": event.step.label if event.step else None,
                "error": [why.message] if why else list(fault.lines),
                "hint": why.hint if why else fault.hint,
                "repeat": fault.repeat,
            }
        self._say("Finished", name, **said)

    def _say(self, word: str, name: str | None, **said: object) -> None:
        line = self._line(word, name, **said)
        if self._log:
            self._log(line)
        if self._printed:
            self._print(line)

    def _line(self, word: str, name: str | None, **said: object) -> bytes:
        whole: dict[str, object] = {"event": word, "time": round(time.monotonic() - self._begun, 6)}
        if name is not None:
            whole |= {"package": name, "embedded": self._packages[name].embedded}
        return json.dumps({**whole, **said}).encode() + b"\n"

    def _print(self, line: bytes) -> None:
        with heard_by_somebody(1):
            sys.stdout.write(line.decode())
            # Whoever reads a pipe wants to see it now.
            sys.stdout.flush()


def _step(step: Step) -> dict[str, object]:
    return {"step": step.label, "argv": step.argv, "cwd": str(step.cwd)}
