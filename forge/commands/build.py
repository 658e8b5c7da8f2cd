"""`forge build`: build the packages of a workspace in the order in which they need each other."""

from __future__ import annotations

import os
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from forge import options as shared
from forge import package_options
from forge.errors import Problem, SelectionError, WorkspaceError, raise_if_any
from forge.launching.choice import LAUNCHERS, NONE
from forge.manner import Manner
from forge.occupancy import occupied
from forge.planning import make_whole_plan, wanted_names
from forge.preparation import (
    build_variables,
    prepare,
    refuse_what_cannot_work,
    refuse_what_would_fail,
    standing,
    tell_of_lost_underlays,
)
from forge.records import open_records
from forge.reporting import Report, handlers_of
from forge.results import begin_workspace, forget_underlays
from forge.settings import compiled_templates
from forge.snapshot import take_snapshot
from forge.templating import keep_compiled
from forge.workspace import load_workspace

if TYPE_CHECKING:
    import argparse
    from collections.abc import Mapping

    from forge.audit.tracing import Audit
    from forge.cli import Parser
    from forge.layout import Layout
    from forge.model import BuildPlan, Package


def register(parser: Parser) -> None:
    """Add the options of `forge build`."""
    package_options.add(parser)
    shared.add_layout(parser)
    _add_what_to_build(parser)
    _add_cmake(parser)
    shared.add_cache(parser)
    shared.add_budget(parser, cluster=True)
    _add_what_to_see(parser)
    parser.greedy = frozenset({"--cmake-args", "--ament-cmake-args", "--catkin-cmake-args"})


def run(options: argparse.Namespace) -> int:
    """Build once, or again and again while somebody edits; returns as `build` does."""
    if options.watch:
        from forge.watching import watch  # noqa: PLC0415  (asked for now and then)

        return watch(options, build)
    return build(options, Manner())


def build(options: argparse.Namespace, manner: Manner) -> int:
    """Build; returns 0, 1 when a package failed, 2 when an interface definition is wrong."""
    begun = time.monotonic()
    root = Path.cwd()
    handlers = handlers_of(options.event_handlers)
    level = shared.log_level_of(options)
    layout = shared.layout_of(options, root)
    _refuse_timings_without_a_log(options, layout)
    shared.refuse_half_a_cluster(options)
    if options.print_command:
        from forge.explaining import last_command  # noqa: PLC0415  (asked for now and then)

        print(last_command(layout, options.print_command))
        return 0
    if options.reset_underlays and not options.dry_run:
        forget_underlays(layout.install)
    variables = build_variables(layout, os.environ)
    tell_of_lost_underlays(layout, os.environ)
    loaded = load_workspace(root, options, variables, embedded=True, install=layout.install)
    names = wanted_names(loaded.selection, loaded.provision, loaded.provision.needs)
    refuse_what_cannot_work(loaded, names, layout)
    kitchen, interpreter = prepare(options, loaded, names, layout, variables)
    audit = _audit(options, layout, variables)
    begin_workspace(layout)
    keep_compiled(*compiled_templates(os.environ, layout.build / ".forge_templates"))
    with (
        occupied(layout.build, wait=not options.no_wait),
        closing(open_records(root, layout, interpreter)) as records,
    ):
        snapshot = take_snapshot(root, loaded.packages.values(), layout, records.journal, records.table)
        holds, named = standing(options, loaded, kitchen, variables)
        plan, outlook = make_whole_plan(names, loaded.provision, snapshot, kitchen, holds, records.rivals)
        named.save()
        records.confirm(plan, snapshot, outlook)
        refuse_what_would_fail(plan, loaded, kitchen, variables)
        if plan.tasks or not manner.checking:
            _say(plan, options, level, loaded.packages)
        if options.dry_run:
            return 0
        records.recover()
        records.retire(loaded.provision.superseded)
        if not plan.tasks:
            records.finish(plan, variables)
            report = Report(plan, loaded.packages, handlers, None)
            _conclude_at_once(plan, options, report, manner, time.monotonic() - begun)
            if options.strict:
                raise_if_any(records.clashes(plan.fresh), WorkspaceError)
            return 0
        from forge.undertaking import Undertaking, carry_out  # noqa: PLC0415  (a build of nothing is quick)

        undertaking = Undertaking(options, loaded, kitchen, interpreter, variables, manner, audit)
        return carry_out(plan, undertaking, records, handlers, begun)


def _audit(options: argparse.Namespace, layout: Layout, variables: Mapping[str, str]) -> Audit | None:
    """Return what watches the steps, if that was asked for."""
    if not options.audit:
        return None
    from forge.audit.opening import audit_of  # noqa: PLC0415  (asked for now and then)

    return audit_of(options, layout.build, variables)


def _refuse_timings_without_a_log(options: argparse.Namespace, layout: Layout) -> None:
    if options.timings and layout.logs is None:
        hint = "leave out '--log-base', or leave out '--timings'"
        message = "--timings writes into the log folder, and there is to be none"
        raise SelectionError(Problem(message, hint=hint))


def _add_what_to_build(parser: Parser) -> None:
    group = parser.add_argument_group("how to build")
    group.add_argument(
        "--symlink-install", action="store_true", help="link files into the install folder instead of copying"
    )
    group.add_argument(
        "--continue-on-error",
        action="store_true",
        help="when a package fails, go on with those that do not need it",
    )
    group.add_argument(
        "--force", action="store_true", help="build the selected packages though they are fresh"
    )
    group.add_argument(
        "--reset-underlays",
        action="store_true",
        help="forget underlays of earlier builds that are not sourced now",
    )
    group.add_argument(
        "--python",
        metavar="PATH",
        help="the interpreter to build with and for (default: that of the active virtual environment, else "
        "forge's own)",
    )
    group.add_argument(
        "--test-result-base",
        metavar="DIR",
        help="where tests of ament leave their results (default: the build folders); tell forge test, too",
    )


def _add_cmake(parser: Parser) -> None:
    group = parser.add_argument_group("what CMake is told")
    group.add_argument(
        "--cmake-args",
        nargs="*",
        default=[],
        metavar="ARG",
        help="given to CMake for every package: all words up to the next option of forge",
    )
    group.add_argument(
        "--ament-cmake-args",
        nargs="*",
        default=[],
        metavar="ARG",
        help="given to CMake for ament_cmake packages",
    )
    group.add_argument(
        "--compiler-launcher",
        choices=(*LAUNCHERS, NONE),
        default=os.environ.get("FORGE_COMPILER_LAUNCHER") or None,
        help="what is started before the C and C++ compilers of every package: a cache of what they made, or "
        "what sends their work to other machines (default: none)",
    )
    group.add_argument(
        "--no-toolchain-cache",
        action="store_true",
        help="let CMake examine the compilers for every new package",
    )
    group.add_argument(
        "--cmake-force-configure",
        action="store_true",
        help="run CMake's configure step even when nothing changed",
    )
    group.add_argument(
        "--cmake-clean-cache",
        action="store_true",
        help="the same, and let CMake forget the options of before",
    )
    group.add_argument(
        "--cmake-clean-first", action="store_true", help="remove what was compiled before, and compile again"
    )
    group.add_argument(
        "--cmake-target",
        metavar="TARGET",
        help="build this target, too, before everything else; a package that has none of that name fails",
    )
    group.add_argument(
        "--cmake-target-skip-unavailable",
        action="store_true",
        help="where a package has none of that name, go on without",
    )
    group.add_argument(
        "--catkin-cmake-args", nargs="*", default=[], metavar="ARG", help="for packages of ROS 1: no effect"
    )
    group.add_argument(
        "--catkin-skip-building-tests", action="store_true", help="for packages of ROS 1: no effect"
    )


def _add_what_to_see(parser: Parser) -> None:
    group = parser.add_argument_group("what to see")
    group.add_argument("--event-handlers", nargs="*", default=[], metavar="NAME+", help=shared.EVENT_HANDLERS)
    group.add_argument(
        "--json", action="store_true", help="print a line of JSON for each event, and nothing else"
    )
    group.add_argument(
        "--explain",
        action="store_true",
        help="say why each package is built or fresh: the file, option, tool or dependency",
    )
    group.add_argument(
        "--watch",
        action="store_true",
        help="build, then build again whenever a source is saved, until Ctrl-C",
    )
    group.add_argument(
        "--timings",
        action="store_true",
        help="write a page that shows where the time went, and a trace, into the log folder",
    )
    group.add_argument(
        "--audit",
        action="store_true",
        help="rebuild the selected packages under strace, from empty build folders, and report what they "
        "read that forge does not track",
    )
    group.add_argument("--dry-run", action="store_true", help="print the plan and every command, run nothing")
    group.add_argument(
        "--print-command", metavar="PKG", help="print a line that repeats the last step of a package by hand"
    )


def _say(plan: BuildPlan, options: argparse.Namespace, level: int, packages: Mapping[str, Package]) -> None:
    """Print what the plan is, where it was asked for: on stdout as an answer, on stderr as talk."""
    if options.json and options.dry_run:
        from forge.feed import Feed  # noqa: PLC0415  (asked for now and then)

        Feed(plan, packages, printed=True).announce(steps=True)
        return
    # With --json every reason is told anyway.
    asked = (options.explain or options.dry_run) and not options.json
    if not asked and level > shared.LOG_LEVELS["info"]:
        return
    from forge.explaining import commands, explain  # noqa: PLC0415  (asked for now and then)

    whole = options.dry_run if asked else level <= shared.LOG_LEVELS["debug"]
    lines = (*explain(plan), *(commands(plan) if whole else ()))
    print(*lines, sep="\n", file=sys.stdout if asked else sys.stderr)


def _conclude_at_once(
    plan: BuildPlan, options: argparse.Namespace, report: Report, manner: Manner, seconds: float
) -> None:
    """Tell that there was nothing to do."""
    if options.timings and not manner.quiet:
        print("timings: nothing was built, so there is no new page", file=sys.stderr)
    if not options.json:
        manner.conclude(plan, report, seconds)
        return
    from forge.feed import Feed  # noqa: PLC0415  (asked for now and then)

    feed = Feed(plan, report.packages, printed=not manner.checking)
    feed.announce()
    feed.conclude(report, seconds)
