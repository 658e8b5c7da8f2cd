"""`forge test`: run the tests of the packages of a workspace."""

from __future__ import annotations

import os
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from forge import options as shared
from forge import package_options
from forge.audience import Audience
from forge.errors import WorkspaceError
from forge.execution import execute
from forge.feed import Feed
from forge.live import is_wanted, live_view
from forge.model import Finished
from forge.occupancy import occupied
from forge.preparation import build_variables
from forge.reporting import Report, handlers_of, without_prose
from forge.results import begin_workspace
from forge.schedule import Board
from forge.testing.preparing import (
    absent_problems,
    make_test_plan,
    needs_of_tests,
    not_built_here,
    open_test_budget,
    prepare_bench,
    tested_names,
    unbuilt_edits,
)
from forge.testing.running import TestJobs, failures_of, note_result
from forge.testing.showing import table
from forge.transcript import open_transcript
from forge.workspace import load_workspace, warn

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable, Mapping

    from forge.cli import Parser
    from forge.errors import Problem
    from forge.model import BuildPlan
    from forge.testing.recipes import Bench
    from forge.testing.showing import Failure


def register(parser: Parser) -> None:
    """Add the options of `forge test`."""
    package_options.add(parser)
    shared.add_layout(parser)
    _add_how_to_test(parser)
    shared.add_budget(parser)
    _add_frameworks(parser)
    parser.greedy = frozenset({"--ctest-args", "--pytest-args", "--unittest-args"})


def run(options: argparse.Namespace) -> int:
    """Test; returns 1 when a package could not be tested, and on request when a test failed."""
    begun = time.monotonic()
    root = Path.cwd()
    handlers = handlers_of(options.event_handlers)
    layout = shared.layout_of(options, root)
    variables = build_variables(layout, os.environ)
    loaded = load_workspace(root, options, variables, embedded=True, install=layout.install)
    names = tested_names(loaded)
    needs = needs_of_tests(names, loaded)
    begin_workspace(layout)
    absent = absent_problems(needs, layout, variables)
    if absent and len(absent) == len(names):
        raise WorkspaceError(*absent.values())
    built = [name for name in names if name not in absent]
    warn(not_built_here(built, loaded, layout))
    warn(unbuilt_edits({name: needs[name] for name in built}, loaded, layout))
    bench = prepare_bench(options, loaded, names, layout)
    plan = make_test_plan(built, loaded, bench)
    with (
        occupied(layout.build, wait=not options.no_wait),
        closing(open_transcript(layout.logs, "test", sys.argv)) as transcript,
        closing(open_test_budget(options, variables)) as budget,
        live_view(plan, {}, wanted=not options.json and is_wanted(handlers)) as view,
    ):
        spoken = without_prose(handlers) if options.json else handlers
        report = Report(plan, loaded.packages, spoken, transcript.folder)
        report.screen = view.screen
        output = handlers["console_direct"]
        feed = Feed(plan, loaded.packages, log=transcript.note, printed=options.json, output=output)
        audience = Audience(transcript, view, report, feed)
        feed.announce()
        _refuse(absent, report, feed)
        runner = TestJobs(bench, needs, variables).runner(budget)
        board = _board(plan, options, budget.jobs)
        try:
            with closing(execute(plan, runner, board, lambda task: task)) as events:
                for event in events:
                    audience.hear(event)
                    note_result(event, plan.tasks[event.task], report.failed_tests)
        finally:
            seconds = time.monotonic() - begun
            report.summarise(seconds)
            failures = _failures(plan, bench, report.failed_tests)
            if not options.json and failures:
                view.screen.write("\n".join(("", *table(failures), "")).encode(errors="surrogateescape"))
            feed.tell_failures(failures)
            code = report.exit_code or int(options.return_code_on_test_failure and bool(report.failed_tests))
            feed.conclude(report, seconds, code)
    return code


def _add_how_to_test(parser: Parser) -> None:
    group = parser.add_argument_group("how to test")
    group.add_argument(
        "--test-result-base", metavar="DIR", help="where result files go (default: the build folder)"
    )
    again = group.add_mutually_exclusive_group()
    again.add_argument(
        "--retest-until-fail",
        type=int,
        default=0,
        metavar="N",
        help="repeat tests up to N times while they pass",
    )
    again.add_argument(
        "--retest-until-pass", type=int, default=0, metavar="N", help="repeat failed tests up to N times"
    )
    group.add_argument(
        "--abort-on-error",
        action="store_true",
        help="stop when a package cannot be tested; failed tests are no reason to stop",
    )
    group.add_argument(
        "--return-code-on-test-failure",
        action="store_true",
        help="exit with 1 when a test failed (default: with 0, as colcon does)",
    )
    group.add_argument("--event-handlers", nargs="*", default=[], metavar="NAME+", help=shared.EVENT_HANDLERS)
    group.add_argument(
        "--json", action="store_true", help="print a line of JSON for each event, and nothing else"
    )


def _add_frameworks(parser: Parser) -> None:
    group = parser.add_argument_group("what runs the tests")
    group.add_argument(
        "--python",
        metavar="PATH",
        help="the interpreter that runs Python tests (default: that of the last build)",
    )
    group.add_argument(
        "--ctest-args",
        nargs="*",
        default=[],
        metavar="ARG",
        help="given to CTest for every package: all words up to the next option of forge",
    )
    group.add_argument(
        "--python-testing",
        choices=["pytest", "unittest", "setuppy_test"],
        help="what runs Python tests; setuppy_test is colcon's word for unittest (default: pytest where a "
        "package asks for it, else unittest)",
    )
    group.add_argument("--pytest-args", nargs="*", default=[], metavar="ARG", help="given to pytest")
    group.add_argument("--pytest-with-coverage", action="store_true", help="measure coverage with pytest-cov")
    group.add_argument("--unittest-args", nargs="*", default=[], metavar="ARG", help="given to unittest")


def _refuse(absent: Mapping[str, Problem], report: Report, feed: Feed) -> None:
    """Say which packages cannot be tested, and count them as failed: the others are tested all the same."""
    for name, problem in absent.items():
        print(problem.render(), file=sys.stderr)
        refused = Finished(name, 1, 0.0)
        report.show(refused)
        feed.write(refused, report, problem)


def _board(plan: BuildPlan, options: argparse.Namespace, jobs: int) -> Board:
    alone = options.executor == "sequential"
    limit = 1 if alone else min(options.parallel_workers or jobs, jobs)
    return Board(plan, limit, continue_on_error=not options.abort_on_error, in_order=alone)


def _failures(plan: BuildPlan, bench: Bench, names: Iterable[str]) -> list[Failure]:
    """Return what failed, with the first lines and the command to repeat it."""
    return [failure for name in sorted(names) for failure in failures_of(plan.tasks[name], bench)]
