"""The environment of tests, and what is left beside them: colcon's note, copies of results, failures."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from typing import TYPE_CHECKING

from forge.files import replace_file
from forge.folders import clear
from forge.frozen import frozen
from forge.model import TEST_FAILURES, Aborted, Finished, Parts, Record
from forge.runner import Frame, ProcessRunner
from forge.sourcing import build_environment
from forge.started import VARIABLE, StartedProcesses
from forge.steps import environment_file, step_line
from forge.testing.collecting import collect
from forge.testing.outcomes import twin_of
from forge.testing.showing import Failure, first_lines, last_lines

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from forge.budget import Budget
    from forge.model import Event, Step, Task
    from forge.testing.outcomes import Case, Outcome
    from forge.testing.recipes import Bench

RESULT = "colcon_test.rc"


@frozen
class TestJobs:
    """What the tests of one run share; `needs` is what each package sees, itself included, lowest first."""

    __test__ = False  # pytest collects what is called Test

    bench: Bench
    needs: Mapping[str, Sequence[str]]
    variables: Mapping[str, str]

    def runner(self, budget: Budget) -> ProcessRunner:
        """Return what runs the tests."""
        frame = Frame(self._environment, lambda task, _: clear(task), self._finish)
        return ProcessRunner(frame, budget, StartedProcesses(self.bench.layout.build))

    def _environment(self, task: Task) -> Mapping[str, str]:
        layout = self.bench.layout
        below = [(need, layout.prefix(need)) for need in self.needs[task.name]]
        found = build_environment(below, self.variables)
        # Tests run in the source folder, where nobody wants __pycache__.
        return {"PYTHONDONTWRITEBYTECODE": "1", **found, VARIABLE: str(layout.build)}

    def _finish(self, task: Task) -> Record:
        if self.bench.results is not None:
            _copy_last_run(task, self.bench)
        return Record(Parts())


def note_result(event: Event, task: Task, failed_tests: frozenset[str]) -> None:
    """Leave colcon's note of how the tests of a package ended, which its selection options read."""
    match event:
        case Finished(name, code):
            result = TEST_FAILURES if not code and name in failed_tests else str(code)
        case Aborted():
            result = "SIGINT"
        case _:
            return
    if task.build_dir.is_dir():
        replace_file(task.build_dir / RESULT, f"{result}\n".encode())


def failures_of(task: Task, bench: Bench) -> Iterator[Failure]:
    """Yield the tests of a package that failed in the run that has just ended."""
    found = collect(bench.results_of(task.name)).outcomes
    step = task.steps[-1]
    if step.label == "ctest":
        junits = found if bench.results is None else (*found, *collect(task.build_dir).outcomes)
        for case in (case for outcome in found if outcome.by_name for case in outcome.cases):
            yield _ctest_failure(case, task, junits)
        return
    own = bench.results_of(task.name) / f"{step.label}.xml"
    exists = lambda path: (step.cwd / path).is_file()  # noqa: E731  (a question, not a function)
    for case in (case for outcome in found if outcome.path == str(own) for case in outcome.cases):
        selector = _selector(case, task.name, step.label, exists)
        # Without a result there is no case to repeat, but a run.
        repeat = step if case.name.endswith(".missing_result") else _again(step, selector)
        label = f"{case.suite}.{case.name}".removeprefix(f"{task.name}.").removeprefix(".")
        yield Failure(task.name, label, first_lines([case]), step_line(repeat, environment_file(task)))


def _ctest_failure(case: Case, task: Task, junits: Sequence[Outcome]) -> Failure:
    """Return a failure of CTest; the JUnit file of the test, if there is one, says more than its output."""
    twin = next(
        (found for home in {j.home for j in junits} if (found := twin_of(case.name, home, junits))), None
    )
    lines = first_lines(twin.cases) if twin and twin.cases else last_lines(case.text)
    step = task.steps[0]
    argv = (step.argv[0], "-V", "-R", f"^{re.escape(case.name)}$")
    return Failure(
        task.name, case.name, lines, step_line(replace(step, argv=argv, env=()), environment_file(task))
    )


def _again(step: Step, selector: tuple[str, ...]) -> Step:
    """Return a step that runs one test by the framework's own command."""
    return replace(step, argv=(step.argv[0], "-m", step.label, *selector), env=())


def _selector(case: Case, package: str, label: str, exists: Callable[[str], bool]) -> tuple[str, ...]:
    """Return the words that make the framework run one case alone."""
    parts = case.suite.split(".")
    if label == "unittest":
        whole = not case.suite or " " in case.name or "_FailedTest" in case.suite
        return () if whole else (f"{case.suite}.{case.name}",)
    if parts[:1] == [package]:
        parts = parts[1:]
    for length in range(len(parts), 0, -1):
        file = "/".join(parts[:length]) + ".py"
        if exists(file):
            return ("::".join((file, *parts[length:], case.name)),)
    return ("-k", case.name.partition("[")[0])


def _copy_last_run(task: Task, bench: Bench) -> None:
    """Copy the files of CTest's last run to the folder for results."""
    tag = task.build_dir / "Testing" / "TAG"
    if not tag.is_file():
        return
    lines = tag.read_text(encoding="utf-8").splitlines()
    result = tag.parent / lines[0] / "Test.xml" if lines else tag
    if lines and result.is_file():
        target = bench.results_of(task.name) / "Testing"
        (target / lines[0]).mkdir(parents=True, exist_ok=True)
        shutil.copy2(tag, target / "TAG")
        shutil.copy2(result, target / lines[0] / "Test.xml")
