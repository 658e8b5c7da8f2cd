"""One run of a plan: the log, the live view and the reporters around the build loop.

`forge build`, `forge build --watch` and `forge test` run their plans in a session.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from forge.base.errors import Problem, WarningReporter
from forge.base.layout import Layout
from forge.base.text import listed
from forge.build.events import Event, Finished, Started
from forge.build.tasks import BuildPlan, Task
from forge.cli.options import displayed
from forge.execution.loop import Scheduler, execute
from forge.execution.memory import PackageMemory
from forge.execution.runner import TaskRunner
from forge.output.console import ConsoleReporter
from forge.output.handlers import TEXT_HANDLERS, ReportOptions
from forge.output.json_events import JsonEvents
from forge.output.logs import LogWriter, open_log
from forge.output.reporters import Reporter, Run, Start, ask
from forge.workspace.model import Package
from forge.workspace.selection import Query

_MOST_NEEDS = 100_000
"""Writing this number of dependencies to the log takes a tenth of a second."""


@dataclass
class Session:
    """The reporters of one run and its loop; used by the main thread only."""

    command: str
    began: float
    """The monotonic time at which the command started."""
    log: LogWriter
    options: ReportOptions
    report: ConsoleReporter
    json_events: JsonEvents
    opened: ExitStack
    """Closes the reporters of plugins."""
    durations: Mapping[str, float]
    """The duration of earlier builds of packages."""
    profile: str = ""
    reporters: dict[str, Reporter] = field(default_factory=dict)
    complete: bool = False

    def start_reporters(
        self,
        reporters: Mapping[str, Start],
        plan: BuildPlan,
        variables: Mapping[str, str],
        python: Path,
        jobs: int,
        warn: WarningReporter,
        memory: PackageMemory | None = None,
    ) -> None:
        run = Run(
            command=self.command,
            plan=plan,
            root=Path.cwd(),
            variables=variables,
            python=python,
            jobs=jobs,
            warn=warn,
            log_folder=self.log.folder,
            clock=self.json_events.begun,
            displayed=self.report.displayed,
            profile=self.profile,
            seconds=self.durations,
            memory=memory,
            collapsed=self.report.collapsed,
            say=lambda line: self._say([line]),
        )
        if status := self.options.status:
            reporters = {"status": status, **reporters}
        for name, start in reporters.items():
            self.reporters[name] = reporter = ask(name, start, run)
            self.opened.callback(ask, name, reporter.close)
            self.report.screen = reporter.screen or self.report.screen
            self.report.folds.append(partial(ask, name, reporter.fold))
            self.report.guards.append(partial(ask, name, reporter.guard))
            self.json_events.observers.append(partial(ask, name, self._tell, reporter))
        self.report.folds_on_stderr = self.json_events.printed

    def _tell(self, reporter: Reporter, event: Mapping[str, Any]) -> None:
        self._say(reporter.observe(event))

    def _say(self, lines: Iterable[str]) -> None:
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
            ask(name, lambda each: self._say(each.write()), reporter)

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
        """Run the plan; pass each event to `record`, then to the reporters.

        See forge.execution.loop.execute() for `resolve` and for the handling of interrupts.
        """
        waits = False
        with closing(execute(plan, runner, scheduler, resolve)) as events:
            for event in events:
                record(event)
                # The log comes first: it must be complete if a later reporter fails.
                self.log.write(event, failed_tests=event.task in self.report.failed_tests)
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
        self.log.announce({name: {}})
        self.log.write(Started(name))
        self.log.write(failed)
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
    """Yield the session of a command for the packages of `query`; `needs` are dependencies for the log.

    `seconds` contains the duration of earlier builds of packages. A `quiet` session prints failures only.
    `cmake_variables` are those passed to all packages; `surroundings` is the context for hints, as in
    Failure. Embedded packages that were built before get no separate lines, except those that the
    user named. Paths are displayed relative to `origin`.
    """
    handlers, durations = options.handlers, seconds or {}
    # Embedded packages are rebuilt only for a new version of forge or new options.
    collapsed = frozenset(
        name
        for name, task in plan.tasks.items()
        if task.embedded and name in durations and name not in query.named
    )
    # Options by their names in colcon, for the log.
    values: dict[str, object] = {
        "build_base": str(layout.build),
        "install_base": str(layout.install),
        "merge_install": layout.merged,
        "symlink_install": layout.symlink,
        "base_paths": list(query.search.base_paths),
        "packages_select": None if query.select is None else list(query.select),
        "packages_skip": list(query.skip),
    }
    with closing(open_log(layout.logs, command, sys.argv, **values)) as log:
        shown = {**handlers, **dict.fromkeys(TEXT_HANDLERS if options.json or quiet else (), False)}
        report = ConsoleReporter(plan, packages, shown, log.folder, cmake_variables)
        report.surroundings = {"flags": options.flags, **surroundings}
        report.collapsed = collapsed
        root = Path.cwd()
        report.displayed = lambda path: (
            displayed(path.relative_to(root), origin) if path.is_relative_to(root) else str(path)
        )
        direct = handlers["console_direct"]
        json_events = JsonEvents(plan, packages, log=log.note, printed=options.json, output=direct)
        if log.folder is not None:
            # colcon lists other packages only when it builds. Indirect dependencies are omitted for packages
            # that are up to date, which start and end at once, and for all packages if there are too many.
            jobs = {name: needs.get(name, ()) for name in plan.fresh}
            direct = sum(len(task.needs) for task in plan.tasks.values()) > _MOST_NEEDS
            for name, task in plan.tasks.items():
                jobs[name] = needs.get(name, ()) if direct else task.needs or needs.get(name, ())
            others = packages.items() if command == "build" else ()
            unselected = [name for name, each in others if name not in jobs and not each.embedded]
            queued = {name: {need: layout.prefix(need) for need in below} for name, below in jobs.items()}
            log.announce(queued, unselected=unselected, fresh=plan.fresh)
        with ExitStack() as opened:
            yield Session(
                command, began, log, options, report, json_events, opened, durations, layout.profile
            )
