"""`forge build`: build the packages of a workspace in topological order."""

from __future__ import annotations

import os
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.env_vars import compiled_templates
from forge.base.errors import Problem, SelectionError, WorkspaceError, raise_if_any
from forge.base.templating import keep_compiled
from forge.build.markers import begin_workspace
from forge.build.planning import make_whole_plan, names_to_build
from forge.build.snapshot import take_snapshot
from forge.build.state import open_records
from forge.cli import options as shared
from forge.cli import package_options
from forge.cli.build_mode import BuildMode
from forge.cli.preparation import (
    build_variables,
    check_before_planning,
    check_plan,
    global_inputs,
    prepare,
    warn_of_lost_underlays,
)
from forge.environment.recorded import forget_underlays
from forge.execution.lock import lock_build_dir
from forge.output.console import ConsoleReporter, handlers_of
from forge.toolchain.compiler_launchers.choice import LAUNCHERS, NONE
from forge.workspace.load import load_workspace

if TYPE_CHECKING:
    import argparse
    from collections.abc import Mapping

    from forge.base.layout import Layout
    from forge.build.audit.tracing import Audit
    from forge.build.tasks import BuildPlan
    from forge.cli.main import Parser
    from forge.workspace.model import Package


def register(parser: Parser) -> None:
    """Add the options of `forge build`."""
    package_options.add(parser)
    shared.add_layout(parser)
    _add_build_options(parser)
    _add_cmake(parser)
    shared.add_cache(parser)
    shared.add_budget(parser, cluster=True)
    _add_output_options(parser)
    parser.greedy = frozenset({"--cmake-args", "--ament-cmake-args", "--catkin-cmake-args"})


def run(options: argparse.Namespace) -> int:
    """Build once, or repeatedly with --watch; returns like `build`."""
    if options.watch:
        from forge.cli.watch.watching import watch  # noqa: PLC0415  (rarely needed)

        return watch(options, build)
    return build(options, BuildMode())


def build(options: argparse.Namespace, mode: BuildMode) -> int:
    """Build; returns 0, 1 if a package failed, 2 if an interface definition is invalid."""
    begun = time.monotonic()
    root = Path.cwd()
    handlers = handlers_of(options.event_handlers)
    level = shared.log_level_of(options)
    layout = shared.layout_of(options, root)
    _refuse_timings_without_a_log(options, layout)
    shared.refuse_half_a_cluster(options)
    if options.print_command:
        from forge.output.explaining import last_command  # noqa: PLC0415  (rarely needed)

        print(last_command(layout, options.print_command))
        return 0
    if options.reset_underlays and not options.dry_run:
        forget_underlays(layout.install)
    variables = build_variables(layout, os.environ)
    warn_of_lost_underlays(layout, os.environ)
    loaded = load_workspace(
        root, package_options.query_of(options), variables, embedded=True, install=layout.install
    )
    names = names_to_build(loaded.selection, loaded.resolution, loaded.resolution.needs)
    check_before_planning(loaded, names, layout)
    context, interpreter = prepare(options, loaded, names, layout, variables)
    audit = _audit(options, layout, variables)
    begin_workspace(layout)
    keep_compiled(*compiled_templates(os.environ, layout.build / ".forge_templates"))
    with (
        lock_build_dir(layout.build, wait=not options.no_wait),
        closing(open_records(root, layout, interpreter)) as records,
    ):
        snapshot = take_snapshot(root, loaded.packages.values(), layout, records.journal, records.table)
        holds, named = global_inputs(options, loaded, context, variables)
        plan, hashes = make_whole_plan(
            names, loaded.resolution, snapshot, context, holds, records.overwritten_packages
        )
        named.save()
        records.confirm_up_to_date(plan, snapshot, hashes)
        check_plan(plan, loaded, context, variables)
        if plan.tasks or not mode.checking:
            _print_plan(plan, options, level, loaded.packages)
        if options.dry_run:
            return 0
        records.recover()
        records.remove_embedded(loaded.resolution.superseded)
        if not plan.tasks:
            records.finish(plan, variables)
            report = ConsoleReporter(plan, loaded.packages, handlers, None)
            _report_up_to_date(plan, options, report, mode, time.monotonic() - begun)
            if options.strict:
                raise_if_any(records.conflicts(plan.fresh), WorkspaceError)
            return 0
        from forge.cli.session import BuildRequest, run_build  # noqa: PLC0415  (not needed if all is up to date)

        request = BuildRequest(options, loaded, context, interpreter, variables, mode, audit)
        return run_build(plan, request, records, handlers, begun)


def _audit(options: argparse.Namespace, layout: Layout, variables: Mapping[str, str]) -> Audit | None:
    """Return the audit of this build, None without --audit."""
    if not options.audit:
        return None
    from forge.cli.opening_audit import audit_of  # noqa: PLC0415  (rarely needed)

    return audit_of(options, layout.build, variables)


def _refuse_timings_without_a_log(options: argparse.Namespace, layout: Layout) -> None:
    if options.timings and layout.logs is None:
        hint = "remove '--timings', or choose a log folder with '--log-base'"
        message = "--timings needs a log folder, but logs are disabled"
        raise SelectionError(Problem(message, hint=hint))


def _add_build_options(parser: Parser) -> None:
    group = parser.add_argument_group("build options")
    group.add_argument(
        "--symlink-install",
        action="store_true",
        help="install symbolic links instead of copies where possible",
    )
    group.add_argument(
        "--continue-on-error",
        action="store_true",
        help="keep building packages that do not depend on a failed package",
    )
    group.add_argument(
        "--force", action="store_true", help="rebuild the selected packages even if they are up to date"
    )
    group.add_argument(
        "--reset-underlays",
        action="store_true",
        help="forget underlays of earlier builds unless they are sourced now",
    )
    group.add_argument(
        "--python",
        metavar="PATH",
        help="interpreter to build with and for (default: that of the active virtual environment, else "
        "the one that runs forge)",
    )
    group.add_argument(
        "--test-result-base",
        metavar="DIR",
        help="folder for results of ament's tests (default: the build folders); pass the same folder to "
        "'forge test'",
    )


def _add_cmake(parser: Parser) -> None:
    group = parser.add_argument_group("CMake options")
    group.add_argument(
        "--cmake-args",
        nargs="*",
        default=[],
        metavar="ARG",
        help="arguments for CMake, for all packages; takes all arguments up to the next option of forge",
    )
    group.add_argument(
        "--ament-cmake-args",
        nargs="*",
        default=[],
        metavar="ARG",
        help="arguments for CMake, for ament_cmake packages only",
    )
    group.add_argument(
        "--compiler-launcher",
        choices=(*LAUNCHERS, NONE),
        default=os.environ.get("FORGE_COMPILER_LAUNCHER") or None,
        help="compiler cache or distributed compiler to run the C and C++ compilers through (default: none)",
    )
    group.add_argument(
        "--no-toolchain-cache", action="store_true", help="let CMake detect compilers in each package"
    )
    group.add_argument(
        "--cmake-force-configure", action="store_true", help="run CMake's configure step in any case"
    )
    group.add_argument(
        "--cmake-clean-cache",
        action="store_true",
        help="remove CMake's cache before configuring (implies --cmake-force-configure)",
    )
    group.add_argument(
        "--cmake-clean-first", action="store_true", help="run the target 'clean' before building"
    )
    group.add_argument(
        "--cmake-target",
        metavar="TARGET",
        help="build this target before the default target; packages without it fail",
    )
    group.add_argument(
        "--cmake-target-skip-unavailable",
        action="store_true",
        help="ignore packages without the target of --cmake-target",
    )
    _add_catkin(group)


def _add_catkin(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--catkin-cmake-args",
        nargs="*",
        default=[],
        metavar="ARG",
        help="no effect, for compatibility with colcon",
    )
    group.add_argument(
        "--catkin-skip-building-tests", action="store_true", help="no effect, for compatibility with colcon"
    )


def _add_output_options(parser: Parser) -> None:
    group = parser.add_argument_group("output options")
    group.add_argument("--event-handlers", nargs="*", default=[], metavar="NAME+", help=shared.EVENT_HANDLERS)
    group.add_argument(
        "--json", action="store_true", help="print only one JSON object per line for each event"
    )
    group.add_argument(
        "--explain",
        action="store_true",
        help="explain why each package is built or up to date: the file, option, tool or dependency",
    )
    group.add_argument(
        "--watch",
        action="store_true",
        help="build, then rebuild whenever a source file changes, until Ctrl-C",
    )
    group.add_argument(
        "--timings",
        action="store_true",
        help="write an HTML report of build times and a trace file into the log folder",
    )
    group.add_argument(
        "--audit",
        action="store_true",
        help="rebuild the selected packages from empty build folders under strace, and report files they"
        " read that forge does not track",
    )
    group.add_argument(
        "--dry-run", action="store_true", help="print the build plan and all commands without running them"
    )
    group.add_argument(
        "--print-command", metavar="PKG", help="print a command line that repeats the last step of a package"
    )


def _print_plan(
    plan: BuildPlan, options: argparse.Namespace, level: int, packages: Mapping[str, Package]
) -> None:
    """Print the plan for --explain and --dry-run on stdout, or for --log-level info on stderr."""
    if options.json and options.dry_run:
        from forge.output.json_events import JsonEvents  # noqa: PLC0415  (rarely needed)

        JsonEvents(plan, packages, printed=True).announce(steps=True)
        return
    # With --json the events contain the reasons.
    asked = (options.explain or options.dry_run) and not options.json
    if not asked and level > shared.LOG_LEVELS["info"]:
        return
    from forge.output.explaining import commands, explain  # noqa: PLC0415  (rarely needed)

    whole = options.dry_run if asked else level <= shared.LOG_LEVELS["debug"]
    lines = (*explain(plan), *(commands(plan) if whole else ()))
    print(*lines, sep="\n", file=sys.stdout if asked else sys.stderr)


def _report_up_to_date(
    plan: BuildPlan, options: argparse.Namespace, report: ConsoleReporter, mode: BuildMode, seconds: float
) -> None:
    """Report that all packages are up to date."""
    if options.timings and not mode.quiet:
        print("timings: nothing was built, no report written", file=sys.stderr)
    if not options.json:
        mode.conclude(plan, report, seconds)
        return
    from forge.output.json_events import JsonEvents  # noqa: PLC0415  (rarely needed)

    json_events = JsonEvents(plan, report.packages, printed=not mode.checking)
    json_events.announce()
    json_events.conclude(report, seconds)
