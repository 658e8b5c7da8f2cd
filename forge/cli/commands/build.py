"""`forge build`: build the packages of a workspace in topological order."""

from __future__ import annotations

import os
import sys
import time
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.env_vars import compiled_templates
from forge.base.errors import Problem, SelectionError, WorkspaceError, raise_if_any
from forge.base.layout import TEMPLATES_DIR
from forge.base.templating import keep_compiled
from forge.build.cleaning import stale_package_warnings
from forge.build.folder_marks import is_own_install_base
from forge.build.markers import create_output_folders, other_layout
from forge.build.planning import make_whole_plan
from forge.build.snapshot import take_snapshot
from forge.build.state import open_state
from forge.cli.build_mode import BuildMode
from forge.cli.build_options import BuildOptions
from forge.cli.options import LOG_LEVELS, add_options, read_options
from forge.cli.preparation import (
    build_variables,
    check_before_planning,
    check_plan,
    global_inputs,
    packages_to_build,
    prepare,
    report_left_out,
    warn_of_underlays,
    with_packages_of_underlays,
)
from forge.environment.install_state import forget_underlays
from forge.execution.lock import lock_build_dir, lock_install_dir
from forge.output.console import ConsoleReporter
from forge.toolchain.cmake_variables import builds_tests
from forge.workspace.load import load_workspace

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from forge.base.layout import Layout
    from forge.build.audit.tracing import Audit
    from forge.build.recipes.context import BuildContext
    from forge.build.state import BuildState
    from forge.build.tasks import BuildPlan
    from forge.cli.main import Parser
    from forge.workspace.load import LoadedWorkspace
    from forge.workspace.model import Package


def register(parser: Parser) -> None:
    add_options(parser, BuildOptions)


def run(namespace: argparse.Namespace) -> int:
    """Build once, or repeatedly with --watch; returns like `build`."""
    options = read_options(BuildOptions, namespace)
    options.check()
    if options.watch:
        from forge.cli.watch.watching import watch

        return watch(options, lambda: read_options(BuildOptions, namespace.read_again()), build)
    return build(options, BuildMode())


def build(options: BuildOptions, mode: BuildMode) -> int:
    """Build; returns 0, 1 if a package failed, 2 if an interface definition is invalid."""
    began = time.monotonic()
    root = Path.cwd()
    layout = options.folders.layout(root, symlink=options.symlink_install)
    _ = options.reporters, options.folders.level  # raises ForgeError for invalid values
    if options.timings and layout.logs is None:
        hint = "remove '--timings', or choose a log folder with '--log-base'"
        message = "--timings needs a log folder, but logs are disabled"
        raise SelectionError(Problem(message, hint=hint))
    if options.print_command:
        from forge.output.explaining import last_command

        print(last_command(layout, options.print_command))
        return 0
    if options.reset_underlays and not options.dry_run and is_own_install_base(layout.install):
        forget_underlays(layout.install)
    variables = build_variables(layout, os.environ, options.rosdistro)
    warn_of_underlays(layout, os.environ, variables, mode.warn)
    cmake = options.cmake
    tested = partial(builds_tests, cmake_args=cmake.cmake_args, ament_cmake_args=cmake.ament_cmake_args)
    loaded = load_workspace(
        root,
        options.query,
        variables,
        embedded=True,
        install=layout.install,
        tested=tested,
    )
    mode.warn(loaded.warnings)
    selected = packages_to_build(loaded, options, mode.warn)
    if options.query.no_test_dependencies:
        mode.warn(_still_tested((loaded.packages[name] for name in selected), tested))
    names = check_before_planning(loaded, selected, layout, options, variables)
    loaded = with_packages_of_underlays(loaded, names, layout, variables, mode.warn)
    target, cross = options.folders.target, None
    if target:
        cross = target.prepare(layout, variables, options.cross)
        variables |= cross.variables
    context, interpreter = prepare(options, loaded, names, layout, variables, mode.warn, cross)
    audit = _audit(options, layout, variables)
    create_output_folders(layout)
    keep_compiled(*compiled_templates(os.environ, layout.build / TEMPLATES_DIR))
    with (
        lock_build_dir(layout.build, wait=not options.folders.no_wait) as waited,
        lock_install_dir(layout.install, wait=not options.folders.no_wait) as waited_again,
        closing(open_state(root, layout, interpreter)) as state,
    ):
        began += waited + waited_again
        # Another forge may have begun to install here with the other layout at the same time.
        raise_if_any(filter(None, (other_layout(layout),)), WorkspaceError)
        plan, announcements = _make_plan(options, loaded, names, context, variables, state)
        check_plan(plan, loaded, context, variables, mode.warn)
        if not mode.quiet:
            for line in announcements:
                print(line, file=sys.stderr, flush=True)
        if plan.tasks or not mode.silent_if_up_to_date:
            _print_plan(plan, options, loaded.packages)
        if not options.dry_run:
            state.recover()
            state.remove_embedded(loaded.resolution.superseded)
        mode.warn(stale_package_warnings(state.journal.records, loaded.packages, layout, root))
        code = 0
        if plan.tasks:
            from forge.cli.build_run import PreparedBuild, run_plan, warn_of_packages

            prepared = PreparedBuild(options, loaded, context, interpreter, variables, mode, audit, began)
            warn_of_packages(plan, prepared)
            if options.dry_run:
                return 0
            if cross:
                mode.warn(cross.prepare_compilers(task.package for task in plan.tasks.values()))
            code = run_plan(plan, prepared, state)
        elif not options.dry_run:
            state.finish(plan, variables)
            _report_up_to_date(plan, options, loaded.packages, mode, time.monotonic() - began)
            if options.query.strict:
                raise_if_any(state.merged_prefix.conflicts(plan.fresh), WorkspaceError)
        return max(code, report_left_out(selected, names))


def _still_tested(packages: Iterable[Package], tested: Callable[[Package], bool | None]) -> Iterator[Problem]:
    """Yield a warning about packages that --no-test-dependencies does not change."""
    names = sorted(each.name for each in packages if each.only_tested_with and tested(each))
    if names:
        which = f"'{names[0]}'" if len(names) == 1 else f"{len(names)} packages, such as '{names[0]}'"
        message = f"'--no-test-dependencies' has no effect on {which}: BUILD_TESTING is turned on"
        yield Problem(message, hint="remove the option, or BUILD_TESTING from the arguments for CMake")


def _make_plan(
    options: BuildOptions,
    loaded: LoadedWorkspace,
    names: Sequence[str],
    context: BuildContext,
    variables: Mapping[str, str],
    state: BuildState,
) -> tuple[BuildPlan, tuple[str, ...]]:
    """Compare inputs with the journal, and record what is up to date.

    Returns the tasks to run, and the announcements of those whose sources did not change.
    """
    snapshot = take_snapshot(
        context.root, loaded.packages.values(), context.layout, state.journal, state.table
    )
    shared_inputs, named_inputs = global_inputs(options, loaded, context, variables)
    plan, hashes = make_whole_plan(
        names, loaded.resolution, snapshot, context, shared_inputs, state.merged_prefix.packages_to_reinstall
    )
    named_inputs.save()
    state.confirm_up_to_date(plan, snapshot, hashes)
    if not plan.tasks:
        return plan, ()
    from forge.build.announcing import announcements

    return plan, tuple(announcements(plan, snapshot))


def _audit(options: BuildOptions, layout: Layout, variables: Mapping[str, str]) -> Audit | None:
    """Return the audit of this build, None without --audit; raises HostError if strace is missing."""
    if not options.audit:
        return None
    from forge.build.audit.tracing import start_audit

    return start_audit(layout.build, variables)


def _print_plan(plan: BuildPlan, options: BuildOptions, packages: Mapping[str, Package]) -> None:
    """Print the plan for --explain and --dry-run on stdout, or for --log-level info on stderr."""
    if options.report.json and options.dry_run:
        from forge.output.json_events import JsonEvents

        JsonEvents(plan, packages, printed=True).announce(steps=True)
        return
    # With --json the events contain the reasons.
    requested = (options.explain or options.dry_run) and not options.report.json
    level = options.folders.level
    if not requested and level > LOG_LEVELS["info"]:
        return
    from forge.output.explaining import commands, explain

    with_commands = options.dry_run if requested else level <= LOG_LEVELS["debug"]
    lines = (*explain(plan, packages, options.query.named), *(commands(plan) if with_commands else ()))
    print(*lines, sep="\n", file=sys.stdout if requested else sys.stderr)


def _report_up_to_date(
    plan: BuildPlan, options: BuildOptions, packages: Mapping[str, Package], mode: BuildMode, seconds: float
) -> None:
    report = ConsoleReporter(plan, packages, options.report.handlers, None)
    if options.timings and not mode.quiet:
        print("timings: nothing was built, no report written", file=sys.stderr)
    if not options.report.json:
        mode.conclude(plan, report, seconds)
        return
    from forge.output.json_events import JsonEvents

    json_events = JsonEvents(plan, packages, printed=not mode.silent_if_up_to_date)
    json_events.announce()
    json_events.conclude(report, seconds)
