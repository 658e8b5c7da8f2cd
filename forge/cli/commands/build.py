"""`forge build`: build the packages of a workspace in topological order."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

from forge.base.env_vars import compiled_templates
from forge.base.errors import Problem, SelectionError, WorkspaceError, raise_if_any
from forge.base.extensions import OPTIONS, find, own_plugin
from forge.base.layout import LAST_COMMAND, SCRATCH_DIR, TEMPLATES_DIR, Layout
from forge.base.templating import keep_compiled
from forge.base.text import listed
from forge.build.folder_marks import create_output_folders, mark_layout
from forge.build.state import BuildState
from forge.build.tasks import BuildPlan
from forge.cli.build_options import BuildOptions
from forge.cli.main import Parser
from forge.cli.options import LOG_LEVELS, add_options, read_options
from forge.cli.preparation import BuildMode, PreparedBuild, check_plan, make_plan, prepare
from forge.execution.lock import lock_build_dir, lock_install_dir
from forge.output.console import ConsoleReporter


def register(parser: Parser) -> None:
    add_options(parser, BuildOptions)


def run(namespace: argparse.Namespace) -> int:
    """Build once, or repeatedly with --watch; returns like `build`."""

    def read(source: argparse.Namespace) -> BuildOptions:
        options = read_options(BuildOptions, source)
        options.check()
        return options

    options = read(namespace)
    if options.watch:
        plugin = find(OPTIONS, "watch", "option")
        code: int = plugin.watch(options, lambda: read(namespace.read_again()), build)
        return code
    return build(options, BuildMode())


def build(options: BuildOptions, mode: BuildMode) -> int:
    """Build; returns 0, 1 if a package failed, 2 if an interface definition is invalid."""
    layout = options.folders.layout(Path.cwd(), symlink=options.symlink_install)
    if options.print_command:
        print(last_command(layout, options.print_command))
        return 0
    prepared = prepare(options, layout, mode)
    loaded = prepared.loaded
    with (
        _output_folders(layout, options) as waited,
        closing(BuildState(prepared.context.root, layout, prepared.interpreter, prepared.variables)) as state,
    ):
        prepared = replace(prepared, began=prepared.began + waited)
        plan, snapshot = make_plan(prepared, state)
        check_plan(plan, prepared)
        asked = options.explain or options.dry_run or options.folders.level <= LOG_LEVELS["info"]
        if (asked or (plan.tasks and not mode.quiet)) and (explain := own_plugin(OPTIONS, "explain")):
            explain.print_plan(plan, snapshot, prepared)
        elif options.dry_run and not options.report.json:
            print(*plan.tasks, sep="\n")
        if options.dry_run and options.report.json:
            from forge.output.json_events import JsonEvents

            JsonEvents(plan, loaded.packages, printed=True).announce(steps=True)
        if not options.dry_run:
            state.recover()
            state.remove_embedded(loaded.resolution.superseded)
        if advice := own_plugin(OPTIONS, "advice-preflight"):
            records = state.journal.records
            mode.warn(advice.stale_package_warnings(records, loaded.packages, layout, Path.cwd()))
        code = 0
        if plan.tasks:
            from forge.cli.build_run import run_plan, warn_of_packages

            warn_of_packages(plan, prepared)
            if options.dry_run:
                return 0
            code = run_plan(plan, prepared, state)
            if code == 0 and not state.is_final:
                # Only a build reveals which files packages have in common, and thereby the right order.
                plan, _ = make_plan(prepared, state)
                if not mode.quiet:
                    names = listed([*plan.tasks])
                    print(
                        f"note: reinstalling {names} in order, because they install the same file",
                        file=sys.stderr,
                        flush=True,
                    )
                code = run_plan(plan, prepared, state)
        elif not options.dry_run:
            _finish_up_to_date(plan, prepared, state)
        return code


@contextmanager
def _output_folders(layout: Layout, options: BuildOptions) -> Iterator[float]:
    """Create, lock and mark the output folders, except in a first dry run; yields the seconds waited."""
    if options.dry_run and not layout.build.exists():
        yield 0
        return
    create_output_folders(layout)
    keep_compiled(*compiled_templates(os.environ, layout.build / TEMPLATES_DIR))
    with (
        lock_build_dir(layout.build, wait=not options.folders.no_wait) as waited,
        lock_install_dir(layout.install, wait=not options.folders.no_wait) as waited_again,
    ):
        mark_layout(layout)
        yield waited + waited_again


def _finish_up_to_date(plan: BuildPlan, build: PreparedBuild, state: BuildState) -> None:
    """Finish the records, and report that all packages are up to date."""
    options, mode, packages = build.options, build.mode, build.loaded.packages
    state.finish(plan, build.variables)
    seconds = time.monotonic() - build.began
    report = ConsoleReporter(plan, packages, options.report.handlers, None)
    if options.has_timings and not mode.quiet:
        print("timings: nothing was built, no report written", file=sys.stderr)
    if options.report.json:
        from forge.output.json_events import JsonEvents

        json_events = JsonEvents(plan, packages, printed=not mode.silent_if_up_to_date)
        json_events.announce()
        json_events.conclude(report, seconds)
    else:
        mode.conclude(plan, report, seconds)
    if options.query.strict:
        raise_if_any(state.merged_prefix.conflicts(plan.fresh), WorkspaceError)


def last_command(layout: Layout, package: str) -> str:
    """Return a command line that repeats the last step of a package; raises SelectionError for none."""
    file = layout.build_dir(package) / SCRATCH_DIR / LAST_COMMAND
    try:
        return file.read_text(encoding="utf-8").rstrip("\n")
    except OSError:
        message = f"no step of '{package}' has run in '{layout.build}'"
        hint = layout.command(f"build --packages-up-to {package}")
        raise SelectionError(Problem(message, hint=hint)) from None
