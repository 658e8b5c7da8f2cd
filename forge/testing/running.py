"""The environment of tests, and their results: colcon's marker file, copies of result files, failures."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import field, replace
from pathlib import Path
from typing import Any

from forge.base.errors import Problem
from forge.base.files import delete_tree, replace_file
from forge.base.frozen import frozen
from forge.base.layout import TEST_RESULT
from forge.build.events import Aborted, Event, Finished, StepFinished
from forge.build.folder_marks import mark_result_dir
from forge.build.model import BuildInputs, BuildRecord
from forge.build.tasks import TEST_FAILURES, Step, StepKind, Task
from forge.build.tests.recipes import TestContext, error_result, parallel_folder
from forge.environment.sourcing import build_environment
from forge.execution.runner import TaskLifecycle
from forge.execution.started import BUILD_FOLDER_VARIABLE
from forge.testing.collecting import collect, last_run
from forge.testing.outcomes import Counts, Outcome, counted_once


@frozen
class TestSetup(TaskLifecycle):
    """The setup of a test run; `needs` are the packages in each package's environment, lowest first."""

    __test__ = False  # pytest collects classes with this prefix

    context: TestContext
    needs: Mapping[str, Sequence[str]]
    variables: Mapping[str, str]
    before: dict[str, dict[str, object]] = field(default_factory=dict)
    """The result files of earlier runs and their states, by package."""
    failed: set[str] = field(default_factory=set)
    """Packages with failed tests, perhaps not in the last repetition."""
    results: dict[str, tuple[Outcome, ...]] = field(default_factory=dict)
    domains: Any = None
    """The plugin that gives tests their own ROS domains, None without it."""
    cached: Any = None
    """The plugin behind '--cached', None without the option."""
    retests: Any = None
    """The plugin behind '--retest-until-pass', None without the option."""

    def results_of(self, task: Task, fault: str = "") -> tuple[Outcome, ...]:
        """Return the results of a package; an error stands for none, and `fault` for no failure."""
        if not task.steps:
            return ()
        if task.name not in self.results:
            # Placeholders represent missing results.
            own, not_run = self._own(task), self.context.not_run(task.name)
            for path, text in task.files:
                if path == own and not own.exists():
                    replace_file(path, text.encode())
                elif path == not_run and _result_of_ctest(task).exists():
                    path.unlink(missing_ok=True)
                elif path == not_run:
                    replace_file(path, text.encode())
            self.results[task.name] = self._found(task)
        if fault and not any(outcome.counts.bad for outcome in self.results[task.name]):
            program = task.steps[-1].kind.value
            result = error_result(task.name, program, f"{program} {fault}")
            replace_file(self.context.not_run(task.name), result.encode())
            self.results[task.name] = self._found(task)
        return self.results[task.name]

    @contextmanager
    def surroundings(
        self, task: Task, step: Step, variables: Mapping[str, str], is_stopped: Callable[[], bool]
    ) -> Iterator[tuple[Mapping[str, str], bool]]:
        """Yield the environment of a step, and whether it is observed; then keep its results for retests."""
        isolated = self.domains.isolated if self.domains else lambda _, variables, __: nullcontext(variables)
        with isolated(step, variables, is_stopped) as environment:
            if self.cached:
                environment = self.cached.variables(task, environment)
            yield environment, self.cached is not None
        if self.retests:
            self.retests.add(task.name, self._found(task))

    def _own(self, task: Task) -> Path:
        return self.context.results_of(task.name) / f"{task.steps[-1].kind.value}.xml"

    def _found(self, task: Task) -> tuple[Outcome, ...]:
        folder, before = self.context.results_of(task.name), self.before.get(task.name, {})
        outcomes = list(collect(folder).outcomes)
        if folder != task.build_dir:
            # CTest's own results were copied from there.
            ctest = str(task.build_dir / "Testing")
            outcomes += [one for one in collect(task.build_dir).outcomes if not one.path.startswith(ctest)]
        own = {str(self._own(task)), str(self.context.not_run(task.name))}
        runs_ctest = task.steps[-1].kind is StepKind.CTEST
        return tuple(
            one
            for one in outcomes
            if one.path in own or (runs_ctest and before.get(one.path) != _state(one.path))
        )

    def restore(self, task: Task) -> BuildRecord | None:
        if self.cached is None or not task.steps:
            return None
        record = self.cached.find(task, self.environment(task))
        if record is None:
            return None
        self.before[task.name] = {
            path: state for path, state in self._states(task).items() if path not in record.results
        }
        outcomes = self._found(task)
        if {one.path for one in outcomes} != {*record.results} or any(one.counts.bad for one in outcomes):
            self.cached.refuse(task)
            return None
        self.cached.note_replay(task, record, outcomes)
        self.results_of(task)
        return BuildRecord(BuildInputs())

    def remark(self, task: Task) -> str:
        remarks: Mapping[str, str] = self.cached.remarks if self.cached else {}
        return remarks.get(task.name, "")

    def begin(self, task: Task, environment: Mapping[str, str]) -> None:
        if self.context.options.test_result_base is not None:
            mark_result_dir(self.context.results_of(task.name))
        for path in task.clean:  # names may be glob patterns
            for entry in path.parent.glob(path.name) if path.parent.is_dir() else ():
                if entry.is_dir() and not entry.is_symlink():
                    delete_tree(entry)
                else:
                    entry.unlink()
        self.before[task.name] = self._states(task)
        if self.cached and task.steps:
            self.cached.begin(task, environment)
        if any(step.tests_at_once for step in task.steps):
            link, results = _link_to_results(task), task.build_dir / "Testing"
            results.mkdir(exist_ok=True)
            if link.is_dir() and not link.is_symlink():
                delete_tree(link)  # CTest created it after a test removed the build folder
            link.parent.mkdir(parents=True, exist_ok=True)
            link.unlink(missing_ok=True)
            link.symlink_to(os.path.relpath(results, link.parent))

    def _states(self, task: Task) -> dict[str, object]:
        # Tests of ament may write to another folder than CTest.
        folders = dict.fromkeys((self.context.results_of(task.name), task.build_dir))
        files = (path for folder in folders for path in folder.rglob("*.xml"))
        return {str(path): _state(path) for path in files}

    def undo(self, task: Task) -> None:
        if (link := _link_to_results(task)).is_symlink():
            link.unlink()  # colcon would count results there again
        if self.cached:
            self.cached.end(task)

    def environment(self, task: Task) -> Mapping[str, str]:
        layout = self.context.layout
        below = [(need, layout.prefix(need)) for need in self.needs[task.name]]
        environment = build_environment(below, self.variables)
        # Do not create __pycache__ in the source folder.
        discovery = self.domains.discovery(environment) if self.domains else {}
        own = {"PYTHONDONTWRITEBYTECODE": "1", **discovery}
        return {**own, **environment, BUILD_FOLDER_VARIABLE: str(layout.build)}

    def install(self, task: Task) -> BuildRecord:
        self.undo(task)
        if self.retests:
            self.retests.complete(task.name)
        if self.context.options.test_result_base is not None:
            result, target = _result_of_ctest(task), self.context.results_of(task.name) / "Testing"
            is_there = result.name == "Test.xml" and result.is_file()
            if is_there and not (target.exists() and target.samefile(result.parent.parent)):
                (target / result.parent.name).mkdir(parents=True, exist_ok=True)
                shutil.copy2(result.parent.with_name("TAG"), target / "TAG")
                shutil.copy2(result, target / result.parent.name / result.name)
        self.results_of(task)
        return BuildRecord(BuildInputs())

    def note(self, event: Event, task: Task, failed_tests: set[str]) -> None:
        """Add a package to `failed_tests` if one of its tests has failed, and write colcon's marker file.

        A result may contain failures, or be unreadable, although the program exited with 0, or be valid
        although the program failed. Options that select packages read the marker file.
        """
        match event:
            case StepFinished(_, step, code):
                if step.meaning(code) == TEST_FAILURES:
                    self.failed.add(task.name)
                return
            case Finished(name, code):
                fault = f"exited with code {code}" if code else ""
                if name in failed_tests:
                    fault = "reported failed tests, but no result contains one"
                elif name in self.failed and not any(one.counts.tests for one in self.results_of(task)):
                    fault = "reported failed tests, but ran no test when repeated"
                if any(outcome.counts.bad for outcome in self.results_of(task, fault)):
                    failed_tests.add(name)
                result = TEST_FAILURES if not code and name in failed_tests else str(code)
                passed = not code and name not in self.failed | failed_tests
            case Aborted():
                result, passed = "SIGINT", False
            case _:
                return
        if task.build_dir.is_dir():
            replace_file(task.build_dir / TEST_RESULT, f"{result}\n".encode())
        if self.cached:
            self.cached.keep(task, self.results_of(task) if passed else (), passed=passed)


def write_results_of_untested(
    names: Iterable[str], untested: Mapping[str, Problem], context: TestContext
) -> None:
    """Write a JUnit file for each package that cannot be tested; remove those of an earlier run."""
    for name in names:
        path = context.not_run(name)
        if name in untested:
            result = error_result(name, path.stem, untested[name].message)
            # Write the marker first; without it, the folder would not belong to forge.
            replace_file(context.layout.build_dir(name) / TEST_RESULT, b"1\n")
            mark_result_dir(context.results_of(name))
            replace_file(path, result.encode(errors="surrogateescape"))
        else:
            path.unlink(missing_ok=True)


def total_counts(tasks: Iterable[Task], setup: TestSetup) -> Counts | None:
    """Return the test counts of the last run of packages, None if the executed ones left no result."""
    ran = [task for task in tasks if task.steps]
    results = [setup.results_of(task) for task in ran]
    if ran and not any(results):
        return None
    # The files of one package may be in two folders.
    once = (counted_once([replace(outcome, home="") for outcome in outcomes]) for outcomes in results)
    return sum((outcome.counts for outcomes in once for outcome in outcomes), Counts())


def _link_to_results(task: Task) -> Path:
    return parallel_folder(task.build_dir) / "Testing"


def _state(path: str | Path) -> object:
    """Return a value that changes when a file is rewritten, None if it is missing."""
    try:
        status = os.stat(path)  # noqa: PTH116
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns, status.st_size


def _result_of_ctest(task: Task) -> Path:
    """Return the result of CTest's last run, which may be missing."""
    return Path(last_run(str(task.build_dir / "Testing" / "TAG")))
