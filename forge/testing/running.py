"""The environment of tests, and their results: colcon's marker file, copies of result files, failures."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from typing import TYPE_CHECKING

from forge.base.files import replace_file
from forge.base.frozen import frozen
from forge.build.events import Aborted, Finished
from forge.build.install_manifests import clean_paths
from forge.build.model import BuildInputs, BuildRecord
from forge.build.tasks import TEST_FAILURES, StepKind, environment_file, short_step_line, step_line
from forge.environment.sourcing import build_environment
from forge.execution.runner import ProcessRunner, TaskLifecycle
from forge.execution.started import BUILD_FOLDER_VARIABLE, StartedProcesses
from forge.testing.collecting import collect
from forge.testing.failures import Failure, first_lines, last_lines
from forge.testing.outcomes import Counts, counted_once, find_junit

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from forge.build.events import Event
    from forge.build.tasks import Step, Task
    from forge.build.tests.recipes import TestContext
    from forge.execution.job_pool import JobPool
    from forge.testing.outcomes import Case, Outcome

RESULT = "colcon_test.rc"


@frozen
class TestSetup:
    """The setup of a test run; `needs` are the packages in each package's environment, lowest first."""

    __test__ = False  # pytest collects classes with this prefix

    context: TestContext
    needs: Mapping[str, Sequence[str]]
    variables: Mapping[str, str]

    def runner(self, job_pool: JobPool) -> ProcessRunner:
        """Return the runner of the tests."""
        lifecycle = TaskLifecycle(self._environment, lambda task, _: clean_paths(task), self._finish)
        return ProcessRunner(lifecycle, job_pool, StartedProcesses(self.context.layout.build))

    def _environment(self, task: Task) -> Mapping[str, str]:
        layout = self.context.layout
        below = [(need, layout.prefix(need)) for need in self.needs[task.name]]
        found = build_environment(below, self.variables)
        # Do not create __pycache__ in the source folder.
        return {"PYTHONDONTWRITEBYTECODE": "1", **found, BUILD_FOLDER_VARIABLE: str(layout.build)}

    def _finish(self, task: Task) -> BuildRecord:
        if self.context.options.test_result_base is not None:
            _copy_last_run(task, self.context)
        return BuildRecord(BuildInputs())


def write_result_file(event: Event, task: Task, failed_tests: frozenset[str]) -> None:
    """Write colcon's marker file with the result of a package, which selection options read."""
    match event:
        case Finished(name, code):
            result = TEST_FAILURES if not code and name in failed_tests else str(code)
        case Aborted():
            result = "SIGINT"
        case _:
            return
    if task.build_dir.is_dir():
        replace_file(task.build_dir / RESULT, f"{result}\n".encode())


def total_counts(tasks: Iterable[Task], context: TestContext) -> Counts | None:
    """Return the numbers of tests in the last run of packages, None if those that ran left no result."""
    counts = [_counts_of(task, context) for task in tasks if task.steps]
    known = [count for count in counts if count is not None]
    return sum(known, Counts()) if known or not counts else None


def _counts_of(task: Task, context: TestContext) -> Counts | None:
    """Return the numbers of tests in the last run of a package, None if they left no result."""
    results = collect(context.results_of(task.name)).outcomes
    kind = task.steps[-1].kind
    if kind is not StepKind.CTEST:
        own = str(context.results_of(task.name) / f"{kind.value}.xml")
        counts = [outcome.counts for outcome in results if outcome.path == own]
        return sum(counts, Counts()) if counts else None
    junits = [outcome for outcome in results if not outcome.by_name]
    if context.options.test_result_base is not None:
        results = collect(task.build_dir).outcomes
        junits += [outcome for outcome in results if not outcome.by_name]
    run = [outcome for outcome in results if outcome.by_name]
    names = {name for outcome in run for name, _ in outcome.by_name}
    if context.options.ctest_args:
        # Results of other tests are from earlier runs.
        junits = [junit for junit in junits if junit.test in names]
    # The files of one package may be in two folders.
    outcomes = counted_once([replace(outcome, home="") for outcome in (*run, *junits)])
    return sum((outcome.counts for outcome in outcomes), Counts())


def failures_of(
    task: Task, context: TestContext, displayed: Callable[[Path], str] = str
) -> Iterator[Failure]:
    """Yield the failed tests of a package in its last run."""
    found = collect(context.results_of(task.name)).outcomes
    step = task.steps[-1]
    if step.kind is StepKind.CTEST:
        elsewhere = context.options.test_result_base is not None
        junits = (*found, *collect(task.build_dir).outcomes) if elsewhere else found
        for case in (case for outcome in found if outcome.by_name for case in outcome.cases):
            yield _ctest_failure(case, task, junits, displayed)
        return
    own = context.results_of(task.name) / f"{step.kind.value}.xml"
    exists = lambda path: (step.cwd / path).is_file()  # noqa: E731  (a question, not a function)
    for case in (case for outcome in found if outcome.path == str(own) for case in outcome.cases):
        selector = _selector(case, task.name, step.kind, exists)
        # Without a result, or a way to select one test, repeat the whole run.
        whole = step.kind is StepKind.TEST or case.name.endswith(".missing_result")
        repeat = step if whole else _again(step, selector)
        label = f"{case.suite}.{case.name}".removeprefix(f"{task.name}.").removeprefix(".")
        yield _failure(task, label, first_lines([case]), repeat, displayed)


def _failure(
    task: Task, test: str, lines: tuple[str, ...], repeat: Step, displayed: Callable[[Path], str]
) -> Failure:
    """Return a failure that the step `repeat` repeats."""
    file = environment_file(task)
    return Failure(task.name, test, lines, step_line(repeat, file), short_step_line(repeat, file, displayed))


def _ctest_failure(
    case: Case, task: Task, junits: Sequence[Outcome], displayed: Callable[[Path], str]
) -> Failure:
    """Return a CTest failure; the JUnit file of the test is preferred to its output."""
    junit = next(
        (found for home in {j.home for j in junits} if (found := find_junit(case.name, home, junits))), None
    )
    lines = first_lines(junit.cases) if junit and junit.cases else last_lines(case.text)
    step = task.steps[0]
    argv = (step.argv[0], "-V", "-R", f"^{re.escape(case.name)}$")
    return _failure(task, case.name, lines, replace(step, argv=argv, env=()), displayed)


def _again(step: Step, selector: tuple[str, ...]) -> Step:
    """Return a step that runs one test with the framework's own command."""
    return replace(step, argv=(step.argv[0], "-m", step.kind.value, *selector), env=())


def _selector(case: Case, package: str, kind: StepKind, exists: Callable[[str], bool]) -> tuple[str, ...]:
    """Return the arguments to run a single case."""
    parts = case.suite.split(".")
    if kind is StepKind.UNITTEST:
        whole = not case.suite or " " in case.name or "_FailedTest" in case.suite
        return () if whole else (f"{case.suite}.{case.name}",)
    if parts[:1] == [package]:
        parts = parts[1:]
    for length in range(len(parts), 0, -1):
        file = "/".join(parts[:length]) + ".py"
        if exists(file):
            return ("::".join((file, *parts[length:], case.name)),)
    return ("-k", case.name.partition("[")[0])


def _copy_last_run(task: Task, context: TestContext) -> None:
    """Copy the files of the last CTest run to the folder for results."""
    tag = task.build_dir / "Testing" / "TAG"
    if not tag.is_file():
        return
    lines = tag.read_text(encoding="utf-8").splitlines()
    result = tag.parent / lines[0] / "Test.xml" if lines else tag
    if lines and result.is_file():
        target = context.results_of(task.name) / "Testing"
        (target / lines[0]).mkdir(parents=True, exist_ok=True)
        shutil.copy2(tag, target / "TAG")
        shutil.copy2(result, target / lines[0] / "Test.xml")
