"""Carrying out a plan: log, job budget, warm worker, runner and report around the one loop."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import time
from contextlib import closing, nullcontext
from functools import partial
from typing import TYPE_CHECKING

from forge.audience import Audience
from forge.budget import Budget, without_jobs
from forge.capacity import processors, shortage
from forge.cluster.joining import joined, places_of, remote_runner
from forge.compile_commands import merge_compile_commands
from forge.errors import Problem, WorkspaceError, raise_if_any
from forge.execution import execute
from forge.feed import Feed
from forge.files import write_if_changed
from forge.freshness import environment_that_counts
from forge.frozen import frozen
from forge.jobs import Jobs
from forge.jobserver import common_style, joined_pool, own_pool, spoken
from forge.launching.accounts import Account, open_account
from forge.live import is_wanted, live_view
from forge.makeflags import read_make_flags
from forge.named_inputs import named_by
from forge.options import CLUSTER, cache_wanted, spelled
from forge.pictures.sampling import watched
from forge.preparation import force_of
from forge.provision import INTERFACE_GROUP, missing_problems
from forge.recipes.cmake import common_arguments
from forge.reporting import Report, without_prose
from forge.schedule import Board
from forge.settings import own_cache
from forge.toolchain import Toolchain
from forge.tools import CMAKE_TYPES, ninja_first
from forge.transcript import open_transcript
from forge.underlays import left_behind, overridden
from forge.unused_variables import defined
from forge.workspace import warn

if TYPE_CHECKING:
    import argparse
    from collections.abc import Mapping
    from contextlib import AbstractContextManager
    from pathlib import Path

    from forge.audit.tracing import Audit
    from forge.caching.package_cache import PackageCache
    from forge.interpreter import Interpreter
    from forge.launching.farms import Farm
    from forge.live import View
    from forge.manner import Manner
    from forge.model import BuildPlan
    from forge.provision import Provision
    from forge.recipes.kitchen import Kitchen
    from forge.records import Records
    from forge.reporting import Screen
    from forge.runner import Runner
    from forge.transcript import Transcript
    from forge.workspace import Loaded


STYLES = "styles.json"


@frozen
class Undertaking:
    """What a build was asked for and how, and what it found: packages, tools, interpreter, environment."""

    options: argparse.Namespace
    loaded: Loaded
    kitchen: Kitchen
    interpreter: Interpreter
    variables: Mapping[str, str]
    manner: Manner
    audit: Audit | None = None


def carry_out(
    plan: BuildPlan, undertaking: Undertaking, records: Records, handlers: dict[str, bool], begun: float
) -> int:
    """Build what the plan says and return the exit code; `begun` is when the command started."""
    options, loaded, kitchen = undertaking.options, undertaking.loaded, undertaking.kitchen
    variables, layout, manner = undertaking.variables, kitchen.layout, undertaking.manner
    mine = [name for name, task in plan.tasks.items() if not task.embedded]
    _, lacking = missing_problems(loaded.provision, mine)
    gone = left_behind(records.journal.records, loaded.packages, layout)
    warn((*lacking, *overridden(mine, layout.install, variables), *gone))
    seconds = records.seconds()
    account = _account(plan, undertaking)
    audit = undertaking.audit
    with (
        joined(options, kitchen, variables) if options.executor == CLUSTER else nullcontext() as line,
        closing(open_transcript(layout.logs, "build", sys.argv)) as transcript,
        # What a worker reads is nobody's step: under an audit each generator is a program of its own.
        nullcontext({}) if audit else manner.worker(plan) as found_by,
        closing(open_budget(options, kitchen, variables, plan, account.farm)) as budget,
        live_view(plan, seconds, wanted=not options.json and is_wanted(handlers)) as view,
        watched(wanted=options.timings) as watch,
        cache_of(undertaking, records) as cache,
        closing(audit) if audit else nullcontext(),
    ):
        audience = _audience(plan, undertaking, handlers, transcript, view)
        report, feed = audience.report, audience.feed
        surroundings = {**without_jobs(variables), **account.variables, **found_by}
        surroundings |= ninja_first(kitchen.ninja, layout.build / ".forge_programs", variables)
        jobs = Jobs(loaded.provision, layout, undertaking.interpreter, surroundings, records, cache, audit)
        toolchain = _toolchain(plan, undertaking)
        runner: Runner = jobs.runner(budget, toolchain)
        if line:
            runner = remote_runner(line, undertaking, jobs.frame(toolchain), runner, cache)
        board = _board(plan, options, places_of(options, line) if line else _places(options, budget), seconds)
        feed.announce(seconds=seconds)
        try:
            with closing(execute(plan, runner, board, records.settle)) as events:
                for event in events:
                    records.take(event, plan)
                    audience.hear(event)
        finally:
            records.finish(plan, variables)
            if handlers["compile_commands"]:
                merge_compile_commands(layout.build)
            report.outcomes = account.settle()
            _settle(cache, options, view.screen)
            passed = time.monotonic() - begun
            manner.conclude(plan, report, passed)
            if usage := watch.usage():
                feed.tell_usage(usage)
            feed.conclude(report, passed)
            _tell_of_timings(transcript.folder, options, view.screen)
    if options.strict:
        raise_if_any(records.clashes((*plan.tasks, *plan.fresh)), WorkspaceError)
    warn(records.clashes(plan.tasks))
    return report.exit_code if audit is None else _tell_of_audit(audit, plan, undertaking, records, report)


def _tell_of_audit(
    audit: Audit, plan: BuildPlan, undertaking: Undertaking, records: Records, report: Report
) -> int:
    """Say what packages read that forge does not track; return the exit code of the build."""
    from forge.audit.tracked import audited  # noqa: PLC0415  (asked for now and then)

    lines, clean = audited(audit, plan, undertaking.kitchen, records, undertaking.variables)
    print(*lines, sep="\n", file=sys.stderr if undertaking.options.json else sys.stdout, flush=True)
    return report.exit_code or int(not clean)


def _audience(
    plan: BuildPlan, undertaking: Undertaking, handlers: dict[str, bool], transcript: Transcript, view: View
) -> Audience:
    """Return who hears of the build."""
    options, kitchen, packages = undertaking.options, undertaking.kitchen, undertaking.loaded.packages
    spoken = without_prose(handlers) if options.json or undertaking.manner.quiet else handlers
    shared = defined((*kitchen.cmake_args, *kitchen.ament_cmake_args))
    report = Report(plan, packages, spoken, transcript.folder, shared)
    report.screen = view.screen
    report.python = str(undertaking.interpreter.path)
    output = handlers["console_direct"]
    feed = Feed(plan, packages, log=transcript.note, printed=options.json, output=output)
    return Audience(transcript, view, report, feed)


def cache_of(undertaking: Undertaking, records: Records) -> AbstractContextManager[PackageCache | None]:
    """Return the package cache that was asked for."""
    options, loaded, variables = undertaking.options, undertaking.loaded, undertaking.variables
    if not cache_wanted(options, variables):
        return nullcontext(None)
    from forge.caching.opening import open_cache  # noqa: PLC0415  (most builds have none)
    from forge.caching.package_cache import Circle  # noqa: PLC0415
    from forge.caching.relocation import Places  # noqa: PLC0415
    from forge.digests import FileTable  # noqa: PLC0415

    layout = undertaking.kitchen.layout
    circle = Circle(
        layout=layout,
        places=Places(loaded.workspace.root, layout),
        needs=loaded.provision.needs,
        tools=undertaking.kitchen.tools,
        records=records.journal.records,
        table=records.table,
        own=FileTable((own_cache(variables) or layout.build / ".forge_own") / "programs.json"),
        forced=frozenset(loaded.selection.names) if force_of(options) else frozenset(),
    )
    return open_cache(options, circle, records, variables)


def _settle(cache: PackageCache | None, options: argparse.Namespace, screen: Screen) -> None:
    """Let the cache keep what was built; say what it had to do with each package, if why was asked."""
    if cache is None:
        return
    cache.settle()
    if options.explain and not options.json:
        lines = (f"{name}: {cache.remark(name)}\n" for name in sorted(cache.notes))
        screen.write("".join(lines).encode(errors="surrogateescape"))


def _tell_of_timings(log: Path | None, options: argparse.Namespace, screen: Screen) -> None:
    """Write the page about a run where it was asked for, and say where the latest one always is."""
    if not options.timings or log is None:
        return
    from forge.pictures.pages import PAGE, write_timings  # noqa: PLC0415  (asked for now and then)

    write_timings(log)
    page = spelled(os.path.relpath(log.parent / "latest_build" / PAGE), options)
    screen.write(f"timings: {page}\n".encode(errors="surrogateescape"), stderr=options.json)


def _account(plan: BuildPlan, undertaking: Undertaking) -> Account:
    """Return the account of what is started before the compilers: an empty one where nothing compiles."""
    kitchen, variables = undertaking.kitchen, undertaking.variables
    if kitchen.launcher is None or not _compiles(plan):
        return Account()
    account = open_account(kitchen.launcher, kitchen.root, kitchen.layout.build, without_jobs(variables))
    unsure = None if _jobs_said(undertaking.options, variables) else account.unsure
    warn(filter(None, (account.problem, unsure)))
    return account


def _jobs_said(options: argparse.Namespace, variables: Mapping[str, str]) -> int:
    """Return how many jobs a person or a make above wants; 0 when nobody says so."""
    level = variables.get("CMAKE_BUILD_PARALLEL_LEVEL", "")
    flags = read_make_flags(variables.get("MAKEFLAGS", ""))
    return options.jobs or flags.jobs or (int(level) if level.isdigit() else 0)


def _compiles(plan: BuildPlan) -> bool:
    return any(task.package.build_type in CMAKE_TYPES for task in plan.tasks.values())


def _toolchain(plan: BuildPlan, undertaking: Undertaking) -> Toolchain | None:
    """Return what spares the packages of a plan the examination of the compilers, unless nobody wants it."""
    kitchen = undertaking.kitchen
    if undertaking.options.no_toolchain_cache:
        return None
    python = kitchen.python if _looks_for_python(plan, undertaking.loaded.provision) else None
    return toolchain_of(kitchen, undertaking.variables, python)


def _looks_for_python(plan: BuildPlan, provision: Provision) -> bool:
    """Tell if packages are built by an ament that is not forge's own, which never looks for Python."""
    own = provision.packages.get("ament_cmake")
    return not (own and own.embedded) and any(
        task.package.build_type == "ament_cmake" for task in plan.tasks.values()
    )


def toolchain_of(
    kitchen: Kitchen, variables: Mapping[str, str], python: Path | None = None
) -> Toolchain | None:
    """Return what spares new packages the examination of the compilers, and of `python`.

    None without CMake, and where ament packages are told what others are not: that may be a compiler.
    """
    if kitchen.cmake is None or kitchen.ament_cmake_args:
        return None
    named = named_by(kitchen.cmake_args, variables)
    contents = tuple((word, "") for word in named.options)
    told_apart = (*kitchen.tools, *named.tools, *contents, *environment_that_counts(variables))
    return Toolchain(kitchen.layout.build, kitchen.cmake, common_arguments(kitchen), told_apart, python)


def warm_worker(plan: BuildPlan) -> AbstractContextManager[dict[str, str]]:
    """Return what starts a worker for the plan's interface packages and gives the variables to find it.

    Without such packages there is nothing to start, and nothing to find.
    """
    if not any(INTERFACE_GROUP in task.package.manifest.groups for task in plan.tasks.values()):
        return nullcontext({})
    from forge.worker import worker  # noqa: PLC0415  (the usual build has none)

    return worker()


def open_budget(
    options: argparse.Namespace,
    kitchen: Kitchen,
    variables: Mapping[str, str],
    plan: BuildPlan,
    farm: Farm,
) -> Budget:
    """Return the job tokens of a build: those of a make above us, else as many as were asked for.

    Where nobody says a number, a farm adds its jobs to those of our processors. Which tools can share them
    is tried out, in one style for all, since one may start the other.
    """
    flags = read_make_flags(variables.get("MAKEFLAGS", ""))
    jobs = _jobs_said(options, variables)
    local = jobs or processors()
    jobs = jobs or local + (0 if flags.auth else farm.slots)
    pool = joined_pool(flags.auth) if flags.auth and not options.jobs else None
    if flags.auth and pool is None and not options.jobs:
        hint = "begin its rule with '+', or give forge its own --jobs"
        warn([Problem("the jobserver of the make above cannot be reached", hint=hint)])
    spoken_by = _styles(kitchen, variables) if _compiles(plan) else {}
    style = pool.style if pool else common_style(spoken_by)
    if pool is None and style is not None:
        pool = own_pool(style, jobs)
    fluent = frozenset(name for name, styles in spoken_by.items() if style in styles)
    short = partial(shortage, options.memory_limit, kitchen.load_limit)
    budget = Budget(jobs, pool, fluent, flags, short)
    budget.local = min(local, budget.jobs)
    return budget


def _styles(kitchen: Kitchen, variables: Mapping[str, str]) -> dict[str, frozenset[str]]:
    """Return the styles that each tool speaks: as tried by an earlier build with the same, else tried now."""
    file = (own_cache(variables) or kitchen.layout.build) / STYLES
    told = "\n".join(f"{name} {identity}" for name, identity in kitchen.tools if name in {"ninja", "make"})
    with contextlib.suppress(OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        said = json.loads(file.read_bytes())
        if said["tools"] == told:
            return {name: frozenset(styles) for name, styles in said["styles"].items()}
    tools = {"ninja": kitchen.ninja, "make": kitchen.make}
    found = {name: spoken(name, tool, variables) for name, tool in tools.items() if tool}
    styles = {name: sorted(spoken_by) for name, spoken_by in found.items()}
    with contextlib.suppress(OSError):  # a home that may only be read
        write_if_changed(file, json.dumps({"tools": told, "styles": styles}))
    return found


def _places(options: argparse.Namespace, budget: Budget) -> int:
    """Return how many packages may be under way at a time on this machine."""
    # A package that is started holds a job, so more of them would only wait; and of all that a package does
    # only compilers go to a farm.
    return min(options.parallel_workers or budget.local, budget.jobs)


def _board(plan: BuildPlan, options: argparse.Namespace, places: int, seconds: Mapping[str, float]) -> Board:
    alone = options.executor == "sequential"
    limit = 1 if alone else places
    return Board(plan, limit, seconds, continue_on_error=options.continue_on_error, in_order=alone)
