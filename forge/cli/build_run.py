"""Runs the plan of `forge build`: opens its resources, runs it in a session, and finishes the records."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path

from forge.base.env_vars import SEQUENTIAL, own_cache, without_secrets
from forge.base.errors import WorkspaceError, raise_if_any
from forge.base.extensions import OPTIONS, find, own_plugin
from forge.base.layout import MEMORY_FILE, OWN_CACHE_DIR, PROGRAMS_DIR
from forge.build.events import Event
from forge.build.recipes.context import active_extensions
from forge.build.state import BuildState
from forge.build.tasks import BuildPlan
from forge.cli.preparation import PreparedBuild
from forge.cli.session import Session, open_session
from forge.engine.observation import COLOURS_VARIABLE
from forge.engine.observer import compile_library
from forge.environment.prefixes import find_underlays, provider
from forge.execution.executor import Executor, ExecutorContext
from forge.execution.job_pool import open_job_pool, without_job_variables
from forge.execution.loop import Scheduler
from forge.execution.memory import PackageMemory
from forge.execution.observer import Observer
from forge.execution.runner import LocalExecutor, TaskRunner
from forge.execution.started import StartedProcesses
from forge.execution.task_setup import TaskSetup
from forge.toolchain.cmake_variables import defined
from forge.toolchain.compiler_launchers import LauncherStats
from forge.toolchain.programs import ninja_first, program_of
from forge.toolchain.resources import LIBRARY_PATH_BELOW, memory
from forge.workspace.model import CMAKE_TYPES
from forge.workspace.resolve import GENERATORS


def run_plan(plan: BuildPlan, build: PreparedBuild, state: BuildState) -> int:
    """Run the plan of a build, and finish its records; returns 1 if a package failed."""
    options, context, mode = build.options, build.context, build.mode
    compiles = any(task.package.build_type in CMAKE_TYPES for task in plan.tasks.values())
    if build.cross:
        mode.warn(build.cross.prepare_compilers(task.package for task in plan.tasks.values()))
    state.begin()
    audit = None
    if options.audit:
        audit = find(OPTIONS, "audit", "option").Audit(
            context, build.loaded.resolution.packages, state.journal.records, build.variables
        )
    launcher_stats = LauncherStats()
    if context.launcher and compiles:
        plugin = find(OPTIONS, "compiler-launcher", "option")
        launcher_stats = plugin.open_launcher_stats(
            context.launcher, context.root, context.layout.build, without_job_variables(build.variables)
        )
        if launcher_stats.problem:
            mode.warn([launcher_stats.problem])
    own = own_cache(build.variables) or context.layout.build / OWN_CACHE_DIR
    executor_context = ExecutorContext(
        options.execution,
        replace(options.jobs, load_limit=context.load_limit),
        context.layout.build,
        {name: program_of(identity) for name, identity in context.tools},
        mode.warn,
    )
    # Programs for another machine cannot load the library.
    unobserved = options.no_observer or context.layout.target
    library = None if unobserved else compile_library(own, build.variables)
    with (
        options.execution.connected(executor_context) as remote,
        _workers(plan, build, library, compiles=compiles) as worker_variables,
        closing(
            open_job_pool(
                options.jobs,
                context,
                build.variables,
                compiles=compiles,
                remote_slots=launcher_stats.slots,
                warn=mode.warn,
            )
        ) as job_pool,
        _session(plan, build, state) as session,
        (
            find(OPTIONS, "cache", "option").open_cache(build, state, observed=bool(library) and not remote)
            if options.cache.wanted
            else nullcontext()
        ) as cache,
    ):
        variables = {
            **without_job_variables(build.variables),
            **launcher_stats.variables,
            **worker_variables,
        }
        if not (audit or context.launcher):
            # These variables make compilers faster.
            variables[LIBRARY_PATH_BELOW] = build.variables.get("LD_LIBRARY_PATH", "")
            gcc_heap = own_plugin(OPTIONS, "gcc-heap")
            if gcc_heap and compiles and not remote and job_pool.local:
                variables |= gcc_heap.heap_variables(memory(), job_pool.local)
        screen = session.report.screen
        coloured = screen.palette().enabled and screen.palette(stderr=True).enabled
        if coloured and not options.report.json and not remote:
            variables[COLOURS_VARIABLE] = "1"
            session.log.coloured = True
        variables |= ninja_first(context.ninja, context.layout.build / PROGRAMS_DIR, build.variables)
        probe = None if options.cmake.no_toolchain_cache else own_plugin(OPTIONS, "toolchain-cache")
        lifecycle = TaskSetup(
            build.loaded.resolution,
            context.layout,
            build.interpreter,
            variables,
            state,
            cache,
            probe and probe.seed_of(plan, build, state, library),
            audit and audit.collect,
            observes=library is not None and not remote and not audit,
        )
        packages_memory: PackageMemory | None = None
        if not remote and (plugin := own_plugin(OPTIONS, "package-memory")):
            packages_memory = plugin.MeasuredMemory(
                context.layout.build / MEMORY_FILE, options.jobs.memory_limit
            )
        executor: Executor = remote or LocalExecutor(
            job_pool,
            StartedProcesses(context.layout.build),
            Observer(context.layout, library).surroundings,
            packages_memory,
        )
        # Each package that is built on this machine holds a job.
        runner = TaskRunner(lifecycle, executor, None if remote else job_pool)
        slots = options.jobs.parallel_workers or executor.slots
        slots = slots if remote else min(slots, job_pool.jobs)
        session.start_reporters(
            options.reporters,
            variables=build.variables,
            python=build.interpreter.path,
            jobs=job_pool.jobs,
            warn=mode.warn,
            memory=packages_memory,
        )
        session.json_events.announce(seconds=state.seconds())
        alone = options.execution.executor == SEQUENTIAL
        scheduler = Scheduler(
            plan,
            1 if alone else slots,
            state.seconds(),
            continue_on_error=options.continue_on_error,
            in_order=alone,
            **({"fits": packages_memory.fits} if packages_memory else {}),
        )

        def record(event: Event) -> None:
            state.record_event(event, plan)
            if packages_memory:
                packages_memory.note(event)

        try:
            session.run(plan, runner, scheduler, state.resolve, record)
        finally:
            if packages_memory:
                packages_memory.close()
            state.finish(plan, build.variables)
            merging = own_plugin(OPTIONS, "compile_commands")
            if merging and options.report.handlers["compile_commands"]:
                merging.merge_compile_commands(context.layout.build)
            mode.warn(lifecycle.kept)
            session.report.launcher_summaries = launcher_stats.finish()
            if cache is not None:
                cache.finish()
                if options.explain and not options.report.json:
                    session.write("".join(f"{name}: {cache.remark(name)}\n" for name in sorted(cache.notes)))
            seconds = session.seconds
            session.collect_reports()
            mode.conclude(plan, session.report, seconds)
            session.conclude(seconds)
    if options.query.strict:
        raise_if_any(state.merged_prefix.conflicts((*plan.tasks, *plan.fresh)), WorkspaceError)
    if state.is_final or session.report.exit_code:
        mode.warn(state.merged_prefix.conflicts(plan.tasks))
    untracked = False
    if audit:
        records = state.journal.records
        lines, clean = audit.report(name for name in plan.tasks if records[name].complete)
        print(*lines, sep="\n", file=sys.stderr if options.report.json else sys.stdout, flush=True)
        untracked = not clean
    return session.report.exit_code or int(untracked)


@contextmanager
def _workers(
    plan: BuildPlan, build: PreparedBuild, library: Path | None, *, compiles: bool
) -> Iterator[dict[str, str]]:
    """Yield the variables for the workers that run short commands of packages."""
    if build.options.audit:
        # Reads in a worker could not be attributed to a step.
        yield {}
        return
    context = build.context
    with ExitStack() as stack:
        has_rosidl = GENERATORS not in context.embedded
        environment = dict(stack.enter_context(build.mode.worker(plan, library, has_rosidl=has_rosidl)))
        if context.recipes and compiles:
            packages = [task.package for task in plan.tasks.values()]
            variables, compilers = without_secrets(build.variables), build.compilers
            for extension in active_extensions(context):
                environment |= stack.enter_context(extension.running(packages, context, variables, compilers))
        yield environment


def _session(plan: BuildPlan, build: PreparedBuild, state: BuildState) -> AbstractContextManager[Session]:
    context, packages = build.context, build.loaded.packages
    advice = own_plugin(OPTIONS, "missing-packages")

    def prefix_of(name: str) -> Path | None:
        if name in packages:
            return context.layout.prefix(name)
        return provider(name, find_underlays(build.variables, context.layout.install))

    return open_session(
        "build",
        plan,
        packages,
        context.layout,
        build.options.report,
        query=build.options.query,
        began=build.began,
        needs=build.loaded.resolution.needs,
        seconds=state.seconds(),
        quiet=build.mode.quiet,
        cmake_variables=defined((*context.cmake_args, *context.ament_cmake_args)),
        python=str(build.interpreter.path),
        prefix_of=prefix_of,
        whereabouts=partial(advice.whereabouts, context.root, context.layout) if advice else lambda _: None,
        origin=build.options.origin,
    )


def warn_of_packages(plan: BuildPlan, build: PreparedBuild) -> None:
    """Warn about missing dependencies and overridden underlay packages, and announce downloads."""
    loaded, layout = build.loaded, build.context.layout
    own = [name for name, task in plan.tasks.items() if not task.embedded]
    if advice := own_plugin(OPTIONS, "missing-packages"):
        place_of = partial(advice.whereabouts, loaded.workspace.root, layout)
        skip_keys = build.options.skip_keys
        build.mode.warn(advice.missing_dependencies(loaded.resolution, own, skip_keys, place_of))
    if advice := own_plugin(OPTIONS, "advice-surroundings"):
        build.mode.warn(advice.overridden(own, layout.install, build.variables))
    if explain := own_plugin(OPTIONS, "explain"):
        explain.announce_downloads(plan, layout)
