"""`forge test`: test the packages of a workspace."""

from __future__ import annotations

import os
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.errors import WorkspaceError
from forge.build.events import Finished
from forge.build.markers import begin_workspace
from forge.cli import options as shared
from forge.cli import package_options
from forge.cli.preparation import build_variables
from forge.execution.lock import lock_build_dir
from forge.execution.loop import execute
from forge.execution.scheduler import Scheduler
from forge.output.console import ConsoleReporter, handlers_of, without_prose
from forge.output.json_events import JsonEvents
from forge.output.live import is_wanted, live_view
from forge.output.logs import open_log
from forge.output.reporters import Reporters
from forge.testing.preparing import (
    absent_problems,
    make_test_plan,
    needs_of_tests,
    not_built_here,
    open_test_budget,
    prepare_context,
    tested_names,
    unbuilt_edits,
)
from forge.testing.recipes import TestOptions
from forge.testing.running import TestSetup, failures_of, note_result
from forge.testing.showing import table
from forge.workspace.load import load_workspace, warn

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable, Mapping, Sequence

    from forge.base.errors import Problem
    from forge.build.tasks import BuildPlan
    from forge.cli.main import Parser
    from forge.testing.recipes import TestContext
    from forge.testing.showing import Failure


def register(parser: Parser) -> None:
    """Add the options of `forge test`."""
    package_options.add(parser)
    shared.add_layout(parser)
    _add_test_options(parser)
    shared.add_budget(parser)
    _add_frameworks(parser)
    parser.greedy = frozenset({"--ctest-args", "--pytest-args", "--unittest-args"})


def run(options: argparse.Namespace) -> int:
    """Run tests; returns 1 if a package could not be tested, or, if requested, if a test failed."""
    begun = time.monotonic()
    root = Path.cwd()
    handlers = handlers_of(options.event_handlers)
    layout = shared.layout_of(options, root)
    variables = build_variables(layout, os.environ)
    loaded = load_workspace(
        root, package_options.query_of(options), variables, embedded=True, install=layout.install
    )
    names = tested_names(loaded)
    needs = needs_of_tests(names, loaded)
    begin_workspace(layout)
    absent = absent_problems(needs, layout, variables)
    if absent and len(absent) == len(names):
        raise WorkspaceError(*absent.values())
    built = [name for name in names if name not in absent]
    warn(not_built_here(built, loaded, layout))
    warn(unbuilt_edits({name: needs[name] for name in built}, loaded, layout))
    context = prepare_context(_options_of(options), loaded, names, layout)
    plan = make_test_plan(built, loaded, context)
    with (
        lock_build_dir(layout.build, wait=not options.no_wait),
        closing(open_log(layout.logs, "test", sys.argv)) as log_writer,
        closing(open_test_budget(shared.job_options_of(options), variables)) as budget,
        live_view(plan, {}, wanted=not options.json and is_wanted(handlers)) as view,
    ):
        shown = without_prose(handlers) if options.json else handlers
        report = ConsoleReporter(plan, loaded.packages, shown, log_writer.folder)
        report.screen = view.screen
        output = handlers["console_direct"]
        json_events = JsonEvents(
            plan, loaded.packages, log=log_writer.note, printed=options.json, output=output
        )
        reporters = Reporters(log_writer, view, report, json_events)
        json_events.announce()
        _refuse(absent, report, json_events)
        runner = TestSetup(context, needs, variables).runner(budget)
        scheduler = _scheduler(plan, options, budget.jobs)
        try:
            with closing(execute(plan, runner, scheduler, lambda task: task)) as events:
                for event in events:
                    reporters.notify(event)
                    note_result(event, plan.tasks[event.task], report.failed_tests)
        finally:
            seconds = time.monotonic() - begun
            report.summarise(seconds)
            failures = _failures(plan, context, report.failed_tests)
            if not options.json and failures:
                view.screen.write("\n".join(("", *table(failures), "")).encode(errors="surrogateescape"))
            json_events.report_failures(failures)
            code = report.exit_code or int(options.return_code_on_test_failure and bool(report.failed_tests))
            json_events.conclude(report, seconds, code)
    return code


def _options_of(options: argparse.Namespace) -> TestOptions:
    return TestOptions(
        python=options.python,
        results=Path(options.test_result_base).absolute() if options.test_result_base else None,
        framework=options.python_testing,
        until_fail=options.retest_until_fail,
        until_pass=options.retest_until_pass,
        coverage=options.pytest_with_coverage,
        ctest_args=_unshielded(options.ctest_args),
        pytest_args=_unshielded(options.pytest_args),
        unittest_args=_unshielded(options.unittest_args),
    )


def _unshielded(arguments: Sequence[str]) -> tuple[str, ...]:
    """Return the arguments of a greedy option without the leading spaces that shield them."""
    return tuple(argument.lstrip() for argument in arguments)


def _add_test_options(parser: Parser) -> None:
    group = parser.add_argument_group("test options")
    group.add_argument(
        "--test-result-base", metavar="DIR", help="folder for result files (default: the build folder)"
    )
    again = group.add_mutually_exclusive_group()
    again.add_argument(
        "--retest-until-fail",
        type=int,
        default=0,
        metavar="N",
        help="repeat passing tests up to N times, until they fail",
    )
    again.add_argument(
        "--retest-until-pass",
        type=int,
        default=0,
        metavar="N",
        help="repeat failing tests up to N times, until they pass",
    )
    group.add_argument(
        "--abort-on-error",
        action="store_true",
        help="stop when a package cannot be tested (failing tests do not stop the run)",
    )
    group.add_argument(
        "--return-code-on-test-failure",
        action="store_true",
        help="exit with code 1 if a test failed (default: exit with code 0, like colcon)",
    )
    group.add_argument("--event-handlers", nargs="*", default=[], metavar="NAME+", help=shared.EVENT_HANDLERS)
    group.add_argument(
        "--json", action="store_true", help="print only one JSON object per line for each event"
    )


def _add_frameworks(parser: Parser) -> None:
    group = parser.add_argument_group("test runners")
    group.add_argument(
        "--python",
        metavar="PATH",
        help="interpreter for Python tests (default: that of the last build)",
    )
    group.add_argument(
        "--ctest-args",
        nargs="*",
        default=[],
        metavar="ARG",
        help="arguments for CTest, for all packages; takes all arguments up to the next option of forge",
    )
    group.add_argument(
        "--python-testing",
        choices=["pytest", "unittest", "setuppy_test"],
        help="runner of Python tests; setuppy_test is colcon's name for unittest (default: pytest if the"
        " package depends on it, else unittest)",
    )
    group.add_argument("--pytest-args", nargs="*", default=[], metavar="ARG", help="arguments for pytest")
    group.add_argument("--pytest-with-coverage", action="store_true", help="measure coverage with pytest-cov")
    group.add_argument("--unittest-args", nargs="*", default=[], metavar="ARG", help="arguments for unittest")


def _refuse(absent: Mapping[str, Problem], report: ConsoleReporter, json_events: JsonEvents) -> None:
    """Report packages that cannot be tested and count them as failed; the others are still tested."""
    for name, problem in absent.items():
        print(problem.render(), file=sys.stderr)
        refused = Finished(name, 1, 0.0)
        report.show(refused)
        json_events.write(refused, report, problem)


def _scheduler(plan: BuildPlan, options: argparse.Namespace, jobs: int) -> Scheduler:
    alone = options.executor == "sequential"
    limit = 1 if alone else min(options.parallel_workers or jobs, jobs)
    return Scheduler(plan, limit, continue_on_error=not options.abort_on_error, in_order=alone)


def _failures(plan: BuildPlan, context: TestContext, names: Iterable[str]) -> list[Failure]:
    """Return the failed tests of packages with excerpts and commands to repeat them."""
    return [failure for name in sorted(names) for failure in failures_of(plan.tasks[name], context)]
