"""`forge test`: test the packages of a workspace."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Mapping
from contextlib import AbstractContextManager, closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from forge.base.env_vars import SEQUENTIAL
from forge.base.errors import Problem, WarningReporter, WorkspaceError, print_problem, raise_if_any
from forge.base.extensions import OPTIONS, find, own_plugin
from forge.base.frozen import frozen
from forge.base.options import flag, option, options_of
from forge.base.text import counted
from forge.build.events import Event
from forge.build.folder_marks import create_output_folders, mark_layout
from forge.build.tasks import BuildPlan
from forge.build.tests.options import TestOptions
from forge.cli.options import FolderOptions, OptionSources
from forge.cli.preparation import build_variables, output_problems, require_packages
from forge.cli.session import Session, open_session
from forge.execution.job_pool import open_test_job_pool
from forge.execution.lock import lock_build_dir
from forge.execution.loop import Scheduler
from forge.execution.options import JobOptions
from forge.execution.runner import LocalExecutor, TaskRunner
from forge.execution.started import StartedProcesses
from forge.output.handlers import ReportOptions
from forge.output.reporters import Report, Start
from forge.testing import preparing, running
from forge.testing.collecting import result_folder_problems
from forge.testing.preparing import has_no_tests, not_runnable
from forge.workspace.load import load_workspace
from forge.workspace.selection import Query


@frozen
class Options:
    names: tuple[str, ...] = option(
        "packages to test, or single tests of them as the summary names them, such as "
        "my_package::Suite.case (default: all packages)",
        default=(),
        positional=True,
        metavar="PKG",
    )
    last_failed: bool = flag("run only the tests that failed in the last run of their package")
    query: Query = options_of(Query)
    sources: OptionSources = options_of(OptionSources)
    folders: FolderOptions = options_of(FolderOptions)
    tests: TestOptions = options_of(TestOptions)
    jobs: JobOptions = options_of(JobOptions)
    report: ReportOptions = options_of(ReportOptions)
    origin: str = os.curdir


def run(given: Options) -> int:
    """Run tests; returns 1 if a package could not be tested, or, if requested, if a test failed."""
    began = time.monotonic()
    root, folders, jobs = Path.cwd(), given.folders, given.jobs
    named, single_tests = given.names, None
    if given.last_failed or any("::" in name for name in named):
        plugin = find(OPTIONS, "single-tests", "selection of")
        single_tests = plugin.SingleTests(named, last_failed=given.last_failed)
        named = single_tests.packages
    query = replace(
        given.query,
        select_test_failures=given.query.select_test_failures or given.last_failed,
        select_stopped_tests=given.last_failed,
    )
    if named:
        query = replace(query, select=(*(query.select or ()), *named))
    options, reports = given.tests, given.report
    reporters = reports.reporters(*(name for name in ("coverage", "timings") if getattr(options, name)))
    retests = None
    if options.retest_until_pass:
        retests = find(OPTIONS, "retest-until-pass", "option").Retests()
    layout, warn = folders.layout(root), WarningReporter()
    if options.timings:
        folders.require_logs()
    variables = build_variables(layout, os.environ)
    loaded = load_workspace(
        root,
        query,
        variables,
        embedded=True,
        install=layout.install,
        tested=lambda package: False if has_no_tests(layout.build_dir(package.name)) else None,
    )
    warn(loaded.warnings)
    names, unsupported = preparing.tested_names(loaded, warn)
    results = {"--test-result-base": options.test_result_base}
    problems = [*output_problems(loaded, layout, names, results, prefixes=False)]
    if options.test_result_base:
        problems += result_folder_problems(names, options.test_result_base)
    raise_if_any(problems, WorkspaceError)
    require_packages(loaded)
    needs = preparing.needs_of_tests(names, loaded)
    absent = preparing.absent_problems(needs, layout, variables)
    create_output_folders(layout)
    mark_layout(layout)
    built = [name for name in names if name not in absent]
    if outdated := own_plugin(OPTIONS, "outdated-tests"):
        warn(outdated.changed_since_build({name: needs[name] for name in built}, loaded, layout))
    context, lacking = preparing.prepare_context(options, loaded, layout, variables, built)
    absent |= lacking
    built = [name for name in built if name not in lacking]
    if domains := own_plugin(OPTIONS, "test-domains"):
        context = replace(context, isolated=domains.is_isolated(variables))
    if single_tests:
        packages = [loaded.packages[name] for name in built]
        context = replace(context, chosen=single_tests.choose(packages, context, variables))
    cached = None
    if options.cached:
        cached = find(OPTIONS, "cached", "option").open_cached_tests(context, needs, variables, warn)
    setup = running.TestSetup(context, needs, variables, domains=domains, cached=cached, retests=retests)

    def session_of(plan: BuildPlan) -> AbstractContextManager[Session]:
        return open_session(
            "test",
            plan,
            loaded.packages,
            layout,
            reports,
            query=query,
            began=began + waited,
            needs=needs,
            origin=given.origin,
        )

    def scheduler_of(plan: BuildPlan) -> Scheduler:
        alone = options.executor == SEQUENTIAL
        limit = 1 if alone else min(jobs.parallel_workers or job_pool.jobs, job_pool.jobs)
        return Scheduler(plan, limit, continue_on_error=not options.abort_on_error, in_order=alone)

    def start_reporters(session: Session, starts: Mapping[str, Start]) -> None:
        session.start_reporters(
            starts, variables=variables, python=context.python, jobs=job_pool.jobs, warn=warn
        )
        session.json_events.announce()

    with (
        lock_build_dir(layout.build, wait=not folders.no_wait) as waited,
        closing(open_test_job_pool(jobs, variables)) as job_pool,
    ):
        started = StartedProcesses(layout.build)
        restored = BuildPlan({})
        if from_cache := preparing.restored_names(built, loaded, layout):
            builds = find(OPTIONS, "restored-tests", "tests from the cache")
            restored = builds.plan_restored(from_cache, loaded, layout)
        failed = False
        if restored.tasks:
            note = f"building the tests of {counted(len(restored.tasks), 'package')} from the cache"
            print(note, file=sys.stderr if reports.json else sys.stdout, flush=True)
            with session_of(restored) as session:
                start_reporters(session, {})
                runner = TaskRunner(
                    builds.RestoredSetup(variables), LocalExecutor(job_pool, started), job_pool
                )
                session.run(restored, runner, scheduler_of(restored))
                failed = bool(session.report.tally.failed)
        unbuilt = not_runnable(built, loaded, layout, restored)
        warn(unbuilt.values())
        if outdated:
            warn(outdated.built_without_tests(built, loaded, layout))
        plan = preparing.make_test_plan(
            [name for name in built if name not in unbuilt], loaded, context, warn
        )
        with session_of(plan) as session:
            start_reporters(session, reporters)
            # They count as failed; the others are still tested.
            for problem in dict.fromkeys(absent.values()):
                print_problem(problem)
            for name, problem in absent.items():
                session.fail_unbuilt(name, problem)
            running.write_results_of_untested(names, {**absent, **unbuilt}, context)
            session.report.not_tested = tuple(sorted((*absent, *unbuilt, *unsupported)))
            failed_tests = session.report.failed_tests

            def record(event: Event) -> None:
                setup.note(event, plan.tasks[event.task], failed_tests)

            try:
                executor = LocalExecutor(job_pool, started, setup.surroundings)
                session.run(plan, TaskRunner(setup, executor, job_pool), scheduler_of(plan), record=record)
            finally:
                if cached:
                    cached.close()
                code = _report_results(plan, setup, session, single_tests, failed=failed)
    return code


def _report_results(
    plan: BuildPlan, setup: running.TestSetup, session: Session, single_tests: Any, *, failed: bool
) -> int:
    """Print the summary and a table of the failed tests; return the exit code."""
    session.collect_reports()
    report, context, seconds = session.report, setup.context, session.seconds
    ended = {*report.tally.finished, *report.tally.failed} & plan.tasks.keys()
    report.test_counts = counts = running.total_counts((plan.tasks[name] for name in ended), setup)
    report.no_test_ran = counts is not None and counts.tests == counts.skipped and not report.tally.aborted
    flaky = setup.retests.conclude(ended, session.log.folder) if setup.retests else Report()
    report.flaky_tests = len(flaky.events)
    report.summarise(seconds)
    failures = Report()
    if report.failed_tests and (plugin := own_plugin(OPTIONS, "failed-tests")):
        tasks = [plan.tasks[name] for name in sorted(report.failed_tests)]
        failures = plugin.report(tasks, setup.results_of, context, report.displayed)
    for each in (flaky, failures):
        if each.lines and not session.options.json:
            report.quote("\n".join(("", *each.lines, "")))
        for event, package, members in each.events:
            session.json_events.emit(event, package, **members)
    options = context.options
    has_failed = options.return_code_on_test_failure and bool(report.failed_tests or report.not_tested)
    code = report.exit_code or int(failed or has_failed or (options.fail_if_no_tests and report.no_test_ran))
    without = []
    for task in (plan.tasks[name] for name in context.chosen if name in ended):
        failure, not_run = report.failures.get(task.name), context.not_run(task.name)
        if single_tests.found_none(task, failure.code if failure else 0, setup.results_of(task), not_run):
            without.append(task.name)
            hint = f"all tests of the package: {context.layout.command(f'test {task.name}')}"
            print_problem(Problem(f"no test of '{task.name}' has such a name", hint=hint))
    if without and (not code or {*report.tally.failed, *report.not_tested} <= {*without}):
        code = 2
    session.conclude(seconds, code)
    return code
