"""One run of a plan of `forge build` or `forge test`: the log and the reporters around the build loop."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from forge.base.errors import Problem
from forge.base.extensions import REPORTERS, own_plugin
from forge.base.layout import Layout
from forge.base.text import listed
from forge.build.events import Event, Finished
from forge.build.tasks import BuildPlan, Task
from forge.cli.options import displayed
from forge.execution.loop import Scheduler, execute
from forge.execution.runner import TaskRunner
from forge.output.console import ConsoleReporter
from forge.output.handlers import TEXT_HANDLERS, ReportOptions
from forge.output.json_events import JsonEvents
from forge.output.logs import LogWriter, open_log
from forge.output.reporters import Reporter, Run, Start, ask
from forge.workspace.model import Package
from forge.workspace.selection import Query


@dataclass
class Session:
    """The reporters of one run and its loop; used by the main thread only."""

    began: float
    """The monotonic time at which the command started."""
    log: LogWriter
    options: ReportOptions
    report: ConsoleReporter
    json_events: JsonEvents
    opened: ExitStack
    """Closes the reporters of plugins."""
    run_information: Run
    """What reporters get to know; `start_reporters` completes it."""
    reporters: dict[str, Reporter] = field(default_factory=dict)
    complete: bool = False

    def start_reporters(self, reporters: Mapping[str, Start], **information: Any) -> None:
        """Start the reporters of plugins; `information` are further attributes of their Run."""
        run = replace(self.run_information, coloured=self.log.coloured, **information)
        if status := self.options.status:
            reporters = {"status": status, **reporters}
        if run.log_folder is not None and (event_log := own_plugin(REPORTERS, "event_log")):
            reporters = {"event_log": event_log.start, **reporters}
        for name, start in reporters.items():
            self.reporters[name] = reporter = ask(name, start, run)
            self.opened.callback(ask, name, reporter.close)
            self.report.screen = reporter.screen or self.report.screen
            self.report.folds.append(partial(ask, name, reporter.fold))
            self.report.guards.append(partial(ask, name, reporter.guard))
            self.json_events.observers.append(partial(ask, name, self._tell, reporter))
        self.report.folds_on_stderr = self.json_events.printed

    def _tell(self, reporter: Reporter, event: Mapping[str, Any]) -> None:
        self.say(reporter.observe(event))

    def say(self, lines: Iterable[str]) -> None:
        """Print lines of a reporter; with --json, stdout contains only events."""
        for line in lines:
            self.write(f"{line}\n", stderr=self.json_events.printed)

    def collect_reports(self) -> None:
        """Print and log the observations of plugin reporters, before the summary."""
        for name, reporter in self.reporters.items():
            ask(name, self._collect_report, reporter)

    def _collect_report(self, reporter: Reporter) -> None:
        report = reporter.conclude(complete=self.complete)
        if report.lines:
            self.report.show_report(report.lines)
        for event, package, members in report.events:
            self.json_events.emit(event, package, **members)

    def conclude(self, seconds: float, code: int | None = None) -> None:
        """Log the results and let reporters write files; `code` overrides the exit code of the report."""
        self.json_events.conclude(self.report, seconds, code)
        for name, reporter in self.reporters.items():
            ask(name, lambda each: self.say(each.write()), reporter)

    @property
    def seconds(self) -> float:
        return time.monotonic() - self.began

    def run(
        self,
        plan: BuildPlan,
        runner: TaskRunner,
        scheduler: Scheduler,
        resolve: Callable[[Task], Task | None] = lambda task: task,
        record: Callable[[Event], object] = lambda _: None,
    ) -> None:
        """Run the plan; pass each event to `record`, then to the reporters; `resolve` is as in `execute`."""
        waits = False
        with closing(execute(plan, runner, scheduler, resolve)) as events:
            for event in events:
                record(event)
                # The log comes first: it must be complete if a later reporter fails.
                self.log.write(event)
                for name, reporter in self.reporters.items():
                    ask(name, reporter.follow, event)
                self.report.show(event)
                self.json_events.write(event, self.report)
                failed = isinstance(event, Finished) and event.code
                if failed and scheduler.stopped and scheduler.running and not waits:
                    waits = True
                    steps = "step" if len(scheduler.running) == 1 else "steps"
                    names = listed(sorted(scheduler.running))
                    self.write(f"waiting for the running {steps} of {names}\n", stderr=True)
        self.complete = True

    def fail_unbuilt(self, name: str, problem: Problem) -> None:
        """Report a package that cannot be tested."""
        failed = Finished(name, 1, 0.0)
        self.report.show(failed)
        self.json_events.write(failed, self.report, problem)

    def write(self, text: str, *, stderr: bool = False) -> None:
        """Print text that is not part of an event."""
        self.report.screen.write(text.encode(errors="surrogateescape"), stderr=stderr)


@contextmanager
def open_session(
    command: str,
    plan: BuildPlan,
    packages: Mapping[str, Package],
    layout: Layout,
    options: ReportOptions,
    *,
    query: Query,
    began: float,
    needs: Mapping[str, Collection[str]],
    seconds: Mapping[str, float] | None = None,
    quiet: bool = False,
    cmake_variables: frozenset[str] = frozenset(),
    origin: str = os.curdir,
    **surroundings: Any,
) -> Iterator[Session]:
    """Yield the session of a command for the packages of `query` with their dependencies.

    `seconds` contains the duration of earlier builds of packages. A `quiet` session prints failures only.
    `cmake_variables` are those passed to all packages; `surroundings` is the context for hints, as in
    Failure. Paths are displayed relative to `origin`.
    """
    handlers, durations = options.handlers, seconds or {}
    with closing(open_log(layout.logs, command)) as log, ExitStack() as opened:
        shown = {**handlers, **dict.fromkeys(TEXT_HANDLERS if options.json or quiet else (), False)}
        report = ConsoleReporter(plan, packages, shown, log.folder, cmake_variables)
        report.surroundings = {"flags": options.flags, **surroundings}
        # Embedded packages are rebuilt only for a new version of forge or new options.
        report.collapsed = frozenset(
            name
            for name, task in plan.tasks.items()
            if task.embedded and name in durations and name not in query.named
        )
        root = Path.cwd()
        report.displayed = lambda path: (
            displayed(path.relative_to(root), origin) if path.is_relative_to(root) else str(path)
        )
        direct = handlers["console_direct"]
        json_events = JsonEvents(plan, packages, log=log.note, printed=options.json, output=direct)
        run = Run(
            command=command,
            plan=plan,
            packages=packages,
            needs=needs,
            query=query,
            layout=layout,
            root=root,
            log_folder=log.folder,
            clock=json_events.begun,
            displayed=report.displayed,
            seconds=durations,
            collapsed=report.collapsed,
            say=lambda line: session.say([line]),
        )
        session = Session(began, log, options, report, json_events, opened, run)
        yield session
