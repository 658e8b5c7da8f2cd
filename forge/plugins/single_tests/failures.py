"""Report failed tests: the message of each, and a command that repeats it alone."""

from __future__ import annotations

import os
import re
import shlex
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from forge.base.frozen import frozen
from forge.base.text import counted
from forge.build.tasks import Step, StepKind, Task, environment_file, step_line
from forge.build.tests.recipes import TestContext
from forge.output.reporters import Report
from forge.plugins.single_tests.cases import selector, variables_for
from forge.testing.outcomes import Case, Outcome, find_junit, first_lines, label, last_lines

_MOST = 50
"""The maximum number of tests that the table describes."""

_IN_TEXT = re.compile(r'^(?:[^\n:]*: )?([^\n:"]+\.\w+):(\d+)\b|File "([^"\n]+)", line (\d+)', re.MULTILINE)
"""Locations in the formats of compilers, gtest, assert(), pytest and Python's tracebacks."""


@frozen
class FailedTest:
    """A failed test, the lines of its message, and the step that repeats it."""

    task: Task
    name: str
    cases: Sequence[Case]
    lines: tuple[str, ...]
    repeat: Step

    def location(self) -> tuple[str | None, int | None]:
        """Return the first location in the result whose file exists; relative paths are below a folder.

        The first one is usually in the test itself, the last one in a function that it called.
        """
        folders = (self.repeat.cwd, self.task.package.path.absolute(), self.task.build_dir)
        for case in self.cases:
            texts = (*case.errors, *case.failures, case.text)
            locations = [(m[1] or m[3], m[2] or m[4]) for text in texts for m in _IN_TEXT.finditer(text)]
            for file, line in (*locations, (case.file, case.line)):
                for folder in folders if file and line.isdecimal() else ():
                    if (path := folder / file.strip()).is_file():
                        return os.path.normpath(path), int(line)
        return None, None

    def event(self) -> tuple[str, str, Mapping[str, object]]:
        file, line = self.location()
        repeat = step_line(self.repeat, environment_file(self.task))
        members = {"file": file, "line": line, "test": self.name, "message": [*self.lines], "repeat": repeat}
        return "TestFailure", self.task.name, members

    def row(self, displayed: Callable[[Path], str]) -> Iterator[str]:
        """Yield the lines of the table; the command runs in a subshell, and names programs on PATH."""
        step, (program, *arguments) = self.repeat, self.repeat.argv
        name = Path(program).name
        argv = (name if shutil.which(name) == program else program, *arguments)
        variables = "".join(f"{name}={shlex.quote(value)} " for name, value in step.env)
        source, folder = (shlex.quote(displayed(path)) for path in (environment_file(self.task), step.cwd))
        yield f"  {self.task.name}: {self.name}"
        yield from (f"      {line}" for line in self.lines)
        yield f"    repeat: (. {source} && cd {folder} && {variables}{shlex.join(argv)})"


def report(
    tasks: Iterable[Task],
    results_of: Callable[[Task], Sequence[Outcome]],
    context: TestContext,
    displayed: Callable[[Path], str],
) -> Report:
    """Return a table and events with the failed tests of packages in their last run."""
    failed = [
        each for task in tasks for each in _failed_tests(task, results_of(task), context.not_run(task.name))
    ]
    if not failed:
        return Report()
    lines = [f"{counted(len(failed), 'failed test')}:"]
    lines += (line for each in failed[:_MOST] for line in each.row(displayed))
    if len(failed) > _MOST:
        lines.append(f"  and {len(failed) - _MOST} more: {context.layout.command('test-result --verbose')}")
    return Report((*lines,), (*(each.event() for each in failed),))


def _failed_tests(task: Task, outcomes: Sequence[Outcome], not_run: Path) -> Iterator[FailedTest]:
    """Yield the failed tests of a package; the file `not_run` has an error of the test program itself."""
    step = task.steps[-1]
    for case in (case for outcome in outcomes if outcome.path == str(not_run) for case in outcome.cases):
        yield FailedTest(task, case.name, [case], first_lines([case]), step)
    results = [outcome for outcome in outcomes if outcome.path != str(not_run)]
    if step.kind is StepKind.CTEST:
        runs = [outcome for outcome in results if outcome.by_name]
        others = [outcome for outcome in results if not outcome.by_name]
        # Results of parallel tests are in the order in which they ended.
        for case in sorted((case for outcome in runs for case in outcome.cases), key=lambda each: each.name):
            # The JUnit file of the test is preferred to its output.
            homes = {one.home for one in others}
            junit = next(filter(None, (find_junit(case.name, home, others) for home in homes)), None)
            cases = junit.cases if junit and junit.cases else (case,)
            argv = (task.steps[0].argv[0], "-V", "-R", f"^{re.escape(case.name)}$")
            again = replace(task.steps[0], argv=argv, env=(), cwd=task.build_dir)
            alone = [(each, variables_for(junit.path, each, task.name)) for each in cases] if junit else []
            if alone and all(variables for _, variables in alone):
                for each, variables in alone:
                    name, repeat = label(each, task.name), replace(again, env=variables)
                    yield FailedTest(task, name, [each], first_lines([each]), repeat)
            else:
                lines = last_lines(case.text) if cases == (case,) else first_lines(cases)
                yield FailedTest(task, case.name, cases, lines, again)
        # Failures that CTest does not report: in files of tests that it considers successful.
        failed = {case.name for outcome in runs for case in outcome.cases}
        for outcome in (one for one in others if one.test not in failed):
            for case in outcome.cases:
                name = outcome.path if outcome.is_unreadable else f"{outcome.test}: {case.name}"
                yield FailedTest(task, name, [case], first_lines([case]), step)
        return
    exists = lambda path: (step.cwd / path).is_file()  # noqa: E731  (a question, not a function)
    for outcome in results:
        for case in outcome.cases:
            words = selector(case, task.name, step.kind, exists)
            # If there is no result or no way to select a single test, repeat the whole run.
            needs_all = step.kind is StepKind.TEST or case.name.endswith(".missing_result")
            single = replace(step, argv=(step.argv[0], "-m", step.kind.value, *words), env=())
            repeat = step if needs_all or outcome.is_unreadable else single
            yield FailedTest(task, label(case, task.name), [case], first_lines([case]), repeat)
