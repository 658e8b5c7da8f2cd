"""`forge test`: test the packages of a workspace."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from forge.base.env_vars import SEQUENTIAL, own_cache
from forge.base.errors import Problem, WarningReporter, WorkspaceError, print_problem, raise_if_any
from forge.base.extensions import OPTIONS, find, is_installed
from forge.base.frozen import frozen
from forge.base.layout import OWN_CACHE_DIR, TEST_FILE_TABLE
from forge.base.options import flag, option, options_of
from forge.base.text import counted
from forge.build.events import Aborted, Event, Finished, StepFinished
from forge.build.folder_marks import create_output_folders, mark_layout
from forge.build.inputs.fingerprints import FileTable
from forge.build.journal import open_journal
from forge.build.tasks import TEST_FAILURES, BuildPlan, Task
from forge.build.tests.options import TestOptions
from forge.build.tests.recipes import TestContext
from forge.cli.options import FolderOptions, OptionSources
from forge.cli.preparation import build_variables, output_problems, require_packages
from forge.cli.session import Session, open_session
from forge.execution.job_pool import JobPool, open_test_job_pool
from forge.execution.lock import lock_build_dir
from forge.execution.loop import Scheduler
from forge.execution.options import JobOptions
from forge.execution.runner import LocalExecutor, TaskRunner
from forge.execution.started import StartedProcesses
from forge.output.handlers import ReportOptions
from forge.output.reporters import Report
from forge.testing import preparing, running
from forge.testing.collecting import result_folder_problems
from forge.testing.outcomes import table
from forge.testing.preparing import RestoredSetup, has_no_tests, not_runnable, plan_restored
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
        plugin = find(OPTIONS, "single-tests", "selection of", ("SingleTests",))
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
        retests = find(OPTIONS, "retest-until-pass", "option", ("Retests",)).Retests()
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
    warn(preparing.changed_since_build({name: needs[name] for name in built}, loaded, layout))
    context, lacking = preparing.prepare_context(options, loaded, layout, variables, built)
    absent |= lacking
    built = [name for name in built if name not in lacking]
    domains = None
    if is_installed(OPTIONS, "test-domains"):
        domains = find(OPTIONS, "test-domains", "option")
        context = replace(context, isolated=domains.is_isolated(variables))
    if single_tests:
        packages = [loaded.packages[name] for name in built]
        context = replace(context, chosen=single_tests.choose(packages, context, variables))
    cached = _open_cached_tests(options, context, needs, variables, warn)
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

    with (
        lock_build_dir(layout.build, wait=not folders.no_wait) as waited,
        closing(open_test_job_pool(jobs, variables)) as job_pool,
    ):
        started = StartedProcesses(layout.build)
        restored = plan_restored(built, loaded, layout)
        failed = False
        if restored.tasks:
            note = f"building the tests of {counted(len(restored.tasks), 'package')} from the cache"
            print(note, file=sys.stderr if reports.json else sys.stdout, flush=True)
            with session_of(restored) as session:
                session.start_reporters({}, restored, variables, context.python, job_pool.jobs, warn)
                session.json_events.announce()
                session.run(
                    restored,
                    TaskRunner(RestoredSetup(variables), LocalExecutor(job_pool, started), job_pool),
                    _scheduler(restored, options, jobs, job_pool),
                    lambda task: task,
                    lambda _: None,
                )
                failed = bool(session.report.tally.failed)
        unbuilt = not_runnable(built, loaded, layout, restored)
        warn((*unbuilt.values(), *preparing.built_without_tests(built, loaded, layout)))
        plan = preparing.make_test_plan(
            [name for name in built if name not in unbuilt], loaded, context, warn
        )
        with session_of(plan) as session:
            session.start_reporters(reporters, plan, variables, context.python, job_pool.jobs, warn)
            session.json_events.announce()
            # They count as failed; the others are still tested.
            for problem in dict.fromkeys(absent.values()):
                print_problem(problem)
            for name, problem in absent.items():
                session.fail_unbuilt(name, problem)
            running.write_results_of_untested(names, {**absent, **unbuilt}, context)
            session.report.not_tested = tuple(sorted((*absent, *unbuilt, *unsupported)))
            try:
                session.run(
                    plan,
                    TaskRunner(
                        setup,
                        LocalExecutor(job_pool, started, setup.surroundings),
                        job_pool,
                    ),
                    _scheduler(plan, options, jobs, job_pool),
                    lambda task: task,
                    lambda event: _record(event, plan.tasks[event.task], setup, session),
                )
            finally:
                if cached:
                    cached.close()
                code = _report_results(plan, setup, session, single_tests, json=reports.json, failed=failed)
    return code


def _open_cached_tests(
    options: TestOptions,
    context: TestContext,
    needs: Mapping[str, Sequence[str]],
    variables: Mapping[str, str],
    warn: WarningReporter,
) -> Any:
    """Return the records of passed tests for `--cached`, None if all tests are to run."""
    others = ("coverage", "pytest_with_coverage", "retest_until_fail", "retest_until_pass")
    contrary = next((name for name in others if getattr(options, name)), None)
    if options.cached and contrary:
        warn([Problem(f"all tests run: '--cached' has no effect with '--{contrary.replace('_', '-')}'")])
    if not options.cached or contrary:
        return None
    from forge.engine.observer import compile_library

    plugin = find(OPTIONS, "cached", "option", ("CachedTests",))
    layout = context.layout
    records = open_journal(layout.build).records
    folder = own_cache(variables) or layout.build / OWN_CACHE_DIR
    library = None if layout.target else compile_library(folder, variables)
    if library is None:
        warn([Problem("no pass is recorded: tests cannot be observed here without a C compiler")])
    return plugin.CachedTests(
        library,
        FileTable(layout.build / TEST_FILE_TABLE),
        context.results_of,
        lambda name: {need: records[need].installed.digest for need in needs[name] if need in records},
    )


def _scheduler(plan: BuildPlan, options: TestOptions, jobs: JobOptions, job_pool: JobPool) -> Scheduler:
    alone = options.executor == SEQUENTIAL
    limit = 1 if alone else min(jobs.parallel_workers or job_pool.jobs, job_pool.jobs)
    return Scheduler(plan, limit, continue_on_error=not options.abort_on_error, in_order=alone)


def _record(event: Event, task: Task, setup: running.TestSetup, session: Session) -> None:
    """Record the outcome of a package's tests, before it is reported.

    A result may contain failures, or be unreadable, although the program exited with 0, or be valid although
    the program failed.
    """
    if isinstance(event, StepFinished) and event.step.meaning(event.code) == TEST_FAILURES:
        setup.failed.add(task.name)
    if isinstance(event, Finished):
        fault = f"exited with code {event.code}" if event.code else ""
        if task.name in session.report.failed_tests:
            fault = "reported failed tests, but no result contains one"
        elif task.name in setup.failed and not any(one.counts.tests for one in setup.results_of(task)):
            fault = "reported failed tests, but ran no test when repeated"
        if any(outcome.counts.bad for outcome in setup.results_of(task, fault)):
            session.report.failed_tests.add(task.name)
    running.write_result_file(event, task, session.report.failed_tests)
    if setup.cached and isinstance(event, Finished | Aborted):
        has_failed = task.name in setup.failed | session.report.failed_tests
        passed = isinstance(event, Finished) and not event.code and not has_failed
        setup.cached.keep(task, setup.results_of(task) if passed else (), passed=passed)


def _report_results(
    plan: BuildPlan,
    setup: running.TestSetup,
    session: Session,
    single_tests: Any,
    *,
    json: bool,
    failed: bool,
) -> int:
    """Print the summary and a table of the failed tests; return the exit code."""
    session.collect_reports()
    report, seconds = session.report, session.seconds
    ended = {*report.tally.finished, *report.tally.failed} & plan.tasks.keys()
    report.test_counts = running.total_counts((plan.tasks[name] for name in ended), setup)
    counts, aborted = report.test_counts, report.tally.aborted
    report.no_test_ran = counts is not None and counts.tests == counts.skipped and not aborted
    flaky = setup.retests.conclude(ended, session.log.folder) if setup.retests else Report()
    report.flaky_tests = len(flaky.events)
    report.summarise(seconds)
    if flaky.lines and not json:
        report.quote("\n".join(("", *flaky.lines, "")))
    for event, package, members in flaky.events:
        session.json_events.emit(event, package, **members)
    failures = [
        failure
        for name in sorted(report.failed_tests)
        for failure in running.failures_of(plan.tasks[name], setup, report.displayed)
    ]
    if failures and not json:
        report.quote(
            "\n".join(("", *table(failures, setup.context.layout.command("test-result --verbose")), ""))
        )
    session.json_events.report_failures(failures)
    options = setup.context.options
    has_failed = options.return_code_on_test_failure and bool(report.failed_tests or report.not_tested)
    code = report.exit_code or int(failed or has_failed or (options.fail_if_no_tests and report.no_test_ran))
    without = []
    for task in (plan.tasks[name] for name in setup.context.chosen if name in ended):
        failure, not_run = report.failures.get(task.name), setup.context.not_run(task.name)
        if single_tests.found_none(task, failure.code if failure else 0, setup.results_of(task), not_run):
            without.append(task.name)
    for name in without:
        hint = f"all tests of the package: {setup.context.layout.command(f'test {name}')}"
        print_problem(Problem(f"no test of '{name}' has such a name", hint=hint))
    if without and (not code or {*report.tally.failed, *report.not_tested} <= {*without}):
        code = 2
    session.conclude(seconds, code)
    return code
