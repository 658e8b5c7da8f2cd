"""Runs a build plan: sets up logs, job pool, worker, runner and reporters around the main loop."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import time
from contextlib import closing, nullcontext
from functools import partial
from typing import TYPE_CHECKING

from forge.base.env_vars import own_cache
from forge.base.errors import Problem, WorkspaceError, raise_if_any
from forge.base.files import write_if_changed
from forge.base.frozen import frozen
from forge.build.cleaning import stale_package_warnings
from forge.build.compile_commands import merge_compile_commands
from forge.build.inputs.named_inputs import named_by
from forge.build.recipes.cmake import common_arguments
from forge.build.up_to_date import relevant_environment
from forge.cli.options import CLUSTER, cache_wanted, spelled
from forge.cli.preparation import force_of
from forge.environment.underlays import overridden
from forge.execution.job_pool import JobPool, without_job_variables
from forge.execution.jobserver import common_style, create_pool, join_pool, supported_styles
from forge.execution.loop import execute
from forge.execution.makeflags import read_make_flags
from forge.execution.scheduler import Scheduler
from forge.execution.task_setup import TaskSetup
from forge.output.charts.sampling import sample_usage
from forge.output.console import ConsoleReporter, without_prose
from forge.output.json_events import JsonEvents
from forge.output.live import is_wanted, live_view
from forge.output.logs import open_log
from forge.output.reporters import Reporters
from forge.toolchain.cmake_warnings import defined
from forge.toolchain.compiler_launchers.accounts import LauncherStats, open_launcher_stats
from forge.toolchain.compiler_probe import Toolchain
from forge.toolchain.programs import CMAKE_TYPES, ninja_first
from forge.toolchain.resources import processors, shortage
from forge.workspace.load import warn
from forge.workspace.resolve import INTERFACE_GROUP, missing_problems

if TYPE_CHECKING:
    import argparse
    from collections.abc import Mapping
    from contextlib import AbstractContextManager
    from pathlib import Path

    from forge.build.audit.tracing import Audit
    from forge.build.recipes.context import BuildContext
    from forge.build.state import Records
    from forge.build.tasks import BuildPlan
    from forge.cache.package_cache import PackageCache
    from forge.cli.build_mode import BuildMode
    from forge.execution.dask.connection import Connection
    from forge.execution.runner import Runner
    from forge.output.console import Screen
    from forge.output.live import View
    from forge.output.logs import LogWriter
    from forge.toolchain.compiler_launchers.farms import HostPool
    from forge.toolchain.interpreter import Interpreter
    from forge.workspace.load import Loaded
    from forge.workspace.resolve import DependencyResolution


STYLES = "styles.json"
_MAX_STORED_STYLES = 8
"""Workspaces and virtual environments have different tools, and share the file."""


@frozen
class BuildRequest:
    """The options of a build and what was prepared for it: packages, context, interpreter, environment."""

    options: argparse.Namespace
    loaded: Loaded
    context: BuildContext
    interpreter: Interpreter
    variables: Mapping[str, str]
    mode: BuildMode
    audit: Audit | None = None


def run_build(
    plan: BuildPlan, request: BuildRequest, records: Records, handlers: dict[str, bool], begun: float
) -> int:
    """Run the plan and return the exit code; `begun` is the monotonic start time of the command."""
    options, loaded, context = request.options, request.loaded, request.context
    variables, layout, mode = request.variables, context.layout, request.mode
    own = [name for name, task in plan.tasks.items() if not task.embedded]
    _, lacking = missing_problems(loaded.resolution, own)
    gone = stale_package_warnings(records.journal.records, loaded.packages, layout)
    warn((*lacking, *overridden(own, layout.install, variables), *gone))
    seconds = records.seconds()
    launcher_stats = _launcher_stats(plan, request)
    audit = request.audit
    with (
        _connection(options, context) as connection,
        closing(open_log(layout.logs, "build", sys.argv)) as log_writer,
        # Reads of a worker belong to no step: under an audit each generator is a separate process.
        nullcontext({}) if audit else mode.worker(plan) as worker_variables,
        closing(open_budget(options, context, variables, plan, launcher_stats.host_pool)) as budget,
        live_view(plan, seconds, wanted=not options.json and is_wanted(handlers)) as view,
        sample_usage(wanted=options.timings) as sampler,
        cache_of(request, records) as cache,
        closing(audit) if audit else nullcontext(),
    ):
        reporters = _reporters(plan, request, handlers, log_writer, view)
        report, json_events = reporters.report, reporters.json_events
        surroundings = {**without_job_variables(variables), **launcher_stats.variables, **worker_variables}
        surroundings |= ninja_first(context.ninja, layout.build / ".forge_programs", variables)
        jobs = TaskSetup(loaded.resolution, layout, request.interpreter, surroundings, records, cache, audit)
        toolchain = _toolchain(plan, request)
        runner: Runner = jobs.runner(budget, toolchain)
        slots = _local_slots(options, budget)
        if connection:
            from forge.execution.dask.dask_runner import DaskRunner  # noqa: PLC0415  (only with a cluster)

            runner = DaskRunner(connection, jobs.lifecycle(toolchain))
            slots = options.parallel_workers or connection.cluster.slots
        scheduler = _scheduler(plan, options, slots, seconds)
        json_events.announce(seconds=seconds)
        try:
            with closing(execute(plan, runner, scheduler, records.resolve)) as events:
                for event in events:
                    records.record_event(event, plan)
                    reporters.notify(event)
        finally:
            records.finish(plan, variables)
            if handlers["compile_commands"]:
                merge_compile_commands(layout.build)
            report.outcomes = launcher_stats.finish()
            _store_results(cache, options, view.screen)
            passed = time.monotonic() - begun
            mode.conclude(plan, report, passed)
            if usage := sampler.usage():
                json_events.report_usage(usage)
            json_events.conclude(report, passed)
            _write_timings(log_writer.folder, options, view.screen)
    if options.strict:
        raise_if_any(records.conflicts((*plan.tasks, *plan.fresh)), WorkspaceError)
    warn(records.conflicts(plan.tasks))
    return report.exit_code if audit is None else _report_audit(audit, plan, request, records, report)


def _connection(
    options: argparse.Namespace, context: BuildContext
) -> AbstractContextManager[Connection | None]:
    """Return a context with the connection to a Dask cluster, None for a local build."""
    if options.executor != CLUSTER:
        return nullcontext()
    from forge.execution.dask.connection import connected  # noqa: PLC0415  (only needed with a cluster)
    from forge.execution.dask.messages import WorkerLimits  # noqa: PLC0415

    resources = tuple(options.worker_resources)
    limits = WorkerLimits(options.jobs, options.memory_limit, context.load_limit, resources)
    return connected(options.scheduler, context, limits)


def _report_audit(
    audit: Audit, plan: BuildPlan, request: BuildRequest, records: Records, report: ConsoleReporter
) -> int:
    """Print untracked reads of the packages; return the exit code of the build."""
    from forge.build.audit.tracked import audit_report  # noqa: PLC0415  (rarely needed)

    lines, clean = audit_report(audit, plan, request.context, records, request.variables)
    print(*lines, sep="\n", file=sys.stderr if request.options.json else sys.stdout, flush=True)
    return report.exit_code or int(not clean)


def _reporters(
    plan: BuildPlan, request: BuildRequest, handlers: dict[str, bool], log_writer: LogWriter, view: View
) -> Reporters:
    """Return the reporters of the build."""
    options, context, packages = request.options, request.context, request.loaded.packages
    shown = without_prose(handlers) if options.json or request.mode.quiet else handlers
    shared = defined((*context.cmake_args, *context.ament_cmake_args))
    report = ConsoleReporter(plan, packages, shown, log_writer.folder, shared)
    report.screen = view.screen
    report.python = str(request.interpreter.path)
    output = handlers["console_direct"]
    json_events = JsonEvents(plan, packages, log=log_writer.note, printed=options.json, output=output)
    return Reporters(log_writer, view, report, json_events)


def cache_of(request: BuildRequest, records: Records) -> AbstractContextManager[PackageCache | None]:
    """Return the package cache as a context, None without one."""
    options, loaded, variables = request.options, request.loaded, request.variables
    if not cache_wanted(options, variables):
        return nullcontext(None)
    from forge.build.inputs.fingerprints import FileTable  # noqa: PLC0415
    from forge.cache.package_cache import CacheContext  # noqa: PLC0415
    from forge.cache.relocation import Relocator  # noqa: PLC0415
    from forge.cli.opening_cache import open_cache  # noqa: PLC0415  (only needed with a cache)

    layout = request.context.layout
    own = own_cache(variables) or layout.build / ".forge_own"
    context = CacheContext(
        layout=layout,
        relocator=Relocator(loaded.workspace.root, layout),
        needs=loaded.resolution.needs,
        tools=request.context.tools,
        records=records.journal.records,
        table=records.table,
        own=FileTable(own / "programs.json"),
        programs=FileTable(own / "read_programs.json"),
        forced=frozenset(loaded.selection.names) if force_of(options) else frozenset(),
    )
    return open_cache(options, context, records, variables)


def _store_results(cache: PackageCache | None, options: argparse.Namespace, screen: Screen) -> None:
    """Store built packages in the cache; with --explain print how each package used it."""
    if cache is None:
        return
    cache.finish()
    if options.explain and not options.json:
        lines = (f"{name}: {cache.remark(name)}\n" for name in sorted(cache.notes))
        screen.write("".join(lines).encode(errors="surrogateescape"))


def _write_timings(log: Path | None, options: argparse.Namespace, screen: Screen) -> None:
    """Write the report of --timings and print its path."""
    if not options.timings or log is None:
        return
    from forge.output.charts.pages import PAGE, write_timings  # noqa: PLC0415  (rarely needed)

    write_timings(log)
    page = spelled(os.path.relpath(log.parent / "latest_build" / PAGE), options)
    screen.write(f"timings: {page}\n".encode(errors="surrogateescape"), stderr=options.json)


def _launcher_stats(plan: BuildPlan, request: BuildRequest) -> LauncherStats:
    """Return the statistics of the compiler launcher, empty if nothing is compiled."""
    context, variables = request.context, request.variables
    if context.launcher is None or not _compiles(plan):
        return LauncherStats()
    launcher_stats = open_launcher_stats(
        context.launcher, context.root, context.layout.build, without_job_variables(variables)
    )
    unsure = None if _requested_jobs(request.options, variables) else launcher_stats.unsure
    warn(filter(None, (launcher_stats.problem, unsure)))
    return launcher_stats


def _requested_jobs(options: argparse.Namespace, variables: Mapping[str, str]) -> int:
    """Return the number of jobs from options, a parent make or variables; 0 if none is set."""
    level = variables.get("CMAKE_BUILD_PARALLEL_LEVEL", "")
    flags = read_make_flags(variables.get("MAKEFLAGS", ""))
    return options.jobs or flags.jobs or (int(level) if level.isdigit() else 0)


def _compiles(plan: BuildPlan) -> bool:
    return any(task.package.build_type in CMAKE_TYPES for task in plan.tasks.values())


def _toolchain(plan: BuildPlan, request: BuildRequest) -> Toolchain | None:
    """Return the cached compiler detection for CMake packages, None with --no-toolchain-cache."""
    context = request.context
    if request.options.no_toolchain_cache:
        return None
    python = context.python if _looks_for_python(plan, request.loaded.resolution) else None
    return toolchain_of(context, request.variables, python)


def _looks_for_python(plan: BuildPlan, resolution: DependencyResolution) -> bool:
    """Tell whether packages use an ament_cmake other than the embedded one, which never looks for Python."""
    own = resolution.packages.get("ament_cmake")
    return not (own and own.embedded) and any(
        task.package.build_type == "ament_cmake" for task in plan.tasks.values()
    )


def toolchain_of(
    context: BuildContext, variables: Mapping[str, str], python: Path | None = None
) -> Toolchain | None:
    """Return a Toolchain that lets new packages skip CMake's detection of compilers and of `python`.

    None without CMake, and if ament packages get extra arguments, which may select another compiler.
    """
    if context.cmake is None or context.ament_cmake_args:
        return None
    named = named_by(context.cmake_args, variables)
    contents = tuple((word, "") for word in named.options)
    identity = (*context.tools, *named.tools, *contents, *relevant_environment(variables))
    return Toolchain(context.layout.build, context.cmake, common_arguments(context), identity, python)


def warm_worker(plan: BuildPlan) -> AbstractContextManager[dict[str, str]]:
    """Return a context that starts a worker for interface packages and yields the variables to reach it.

    Without interface packages in the plan no worker is started.
    """
    if not any(INTERFACE_GROUP in task.package.manifest.groups for task in plan.tasks.values()):
        return nullcontext({})
    from forge.cli.worker import worker  # noqa: PLC0415  (only for interface packages)

    return worker()


def open_budget(
    options: argparse.Namespace,
    context: BuildContext,
    variables: Mapping[str, str],
    plan: BuildPlan,
    host_pool: HostPool,
) -> JobPool:
    """Return the job pool of a build: that of a parent make, else a new one with the requested size.

    Without a requested number, jobs of a compiler farm are added to the local processors. All tools share one
    jobserver style, because one may start the other; supported styles are detected by trial.
    """
    flags = read_make_flags(variables.get("MAKEFLAGS", ""))
    jobs = _requested_jobs(options, variables)
    local = jobs or processors()
    jobs = jobs or local + (0 if flags.auth else host_pool.slots)
    pool = join_pool(flags.auth) if flags.auth and not options.jobs else None
    if flags.auth and pool is None and not options.jobs:
        hint = "start the make rule with '+', or pass --jobs to forge"
        warn([Problem("cannot connect to the jobserver of the parent make", hint=hint)])
    spoken_by = _styles(context, variables) if _compiles(plan) else {}
    style = pool.style if pool else common_style(spoken_by)
    if pool is None and style is not None:
        pool = create_pool(style, jobs)
    fluent = frozenset(name for name, styles in spoken_by.items() if style in styles)
    short = partial(shortage, options.memory_limit, context.load_limit)
    budget = JobPool(jobs, pool, fluent, flags, short)
    budget.local = min(local, budget.jobs)
    return budget


def _styles(context: BuildContext, variables: Mapping[str, str]) -> dict[str, frozenset[str]]:
    """Return the jobserver styles that each tool supports; results are cached by tool version."""
    file = (own_cache(variables) or context.layout.build) / STYLES
    identity = "\n".join(
        f"{name} {identity}" for name, identity in context.tools if name in {"ninja", "make"}
    )
    stored = {}
    with contextlib.suppress(OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        stored = json.loads(file.read_bytes())["styles"]
        return {name: frozenset(styles) for name, styles in stored[identity].items()}
    tools = {"ninja": context.ninja, "make": context.make}
    found = {name: supported_styles(name, tool, variables) for name, tool in tools.items() if tool}
    others = [*stored.items()][-_MAX_STORED_STYLES + 1 :] if isinstance(stored, dict) else []
    styles = {name: sorted(of_tool) for name, of_tool in found.items()}
    with contextlib.suppress(OSError):  # read-only cache folder
        write_if_changed(file, json.dumps({"styles": {**dict(others), identity: styles}}))
    return found


def _local_slots(options: argparse.Namespace, budget: JobPool) -> int:
    """Return the maximum number of packages to process in parallel on this machine."""
    # Each started package holds a job; jobs of a farm do not count, because it only runs compilers.
    return min(options.parallel_workers or budget.local, budget.jobs)


def _scheduler(
    plan: BuildPlan, options: argparse.Namespace, slots: int, seconds: Mapping[str, float]
) -> Scheduler:
    alone = options.executor == "sequential"
    limit = 1 if alone else slots
    return Scheduler(plan, limit, seconds, continue_on_error=options.continue_on_error, in_order=alone)
