"""Select single tests of packages by their names in the summary, or those that failed in the last run."""

from __future__ import annotations

import contextlib
import json
import re
import subprocess
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from forge.base.errors import Problem, SelectionError, WorkspaceError
from forge.base.files import read_file, replace_file, text_or_nothing
from forge.base.names import did_you_mean
from forge.base.text import listed
from forge.base.xml import as_utf8, parse_xml
from forge.build.tasks import StepKind, Task
from forge.build.tests.recipes import ChosenTests, TestContext, known_cases_file
from forge.plugins.single_tests.cases import NOT_LOADED, selector, variables_for
from forge.testing.collecting import collect
from forge.testing.outcomes import (
    BrokenResultError,
    Case,
    NotAResultError,
    Outcome,
    counted_once,
    label,
    read_junit,
)
from forge.workspace.model import CMAKE_TYPES, PYTHON_TYPES, Package

SEPARATOR = "::"
_IN_GTEST = re.compile(r"[\w/]+\.[\w/]+")
_FILE = re.compile(rf"\.py(?={SEPARATOR}|$)")
_SECONDS = 60
_USAGE_ERROR = 4
"""pytest's exit code if it finds no test of a name on its command line; then it runs none."""


class SingleTests:
    """The tests that a command line selects; `packages` are those that it names, as a whole or not."""

    def __init__(self, words: Iterable[str], *, last_failed: bool) -> None:
        """Parse words such as 'PACKAGE' and 'PACKAGE::TEST'; raises SelectionError."""
        self._last_failed = last_failed
        cases: dict[str, tuple[str, ...]] = {}
        packages = []
        for word in words:
            package, separator, case = word.partition(SEPARATOR)
            if not separator:
                packages.append(package)
            elif not (package and case):
                hint = f"write PACKAGE{SEPARATOR}TEST, as the summary of 'forge test' prints them"
                raise SelectionError(Problem(f"'{word}' does not name a test", hint=hint))
            else:
                cases[package] = (*cases.get(package, ()), case)
        self._cases = {name: tests for name, tests in cases.items() if name not in packages}
        self.packages = tuple(dict.fromkeys((*packages, *self._cases)))

    def choose(
        self, packages: Iterable[Package], context: TestContext, variables: Mapping[str, str]
    ) -> dict[str, ChosenTests]:
        """Return the tests to run of each package that is not tested as a whole; raises SelectionError."""
        chosen = {}
        for package in packages:
            if package.name in self._cases:
                chosen[package.name] = _choose(package, self._cases[package.name], context, variables)
            elif self._last_failed and (failed := _last_failed(package, context, variables)):
                chosen[package.name] = failed
        return chosen

    def found_none(self, task: Task, code: int, outcomes: Sequence[Outcome], not_run: Path) -> bool:
        """Return whether no test of a package has the chosen names, according to its runner and results.

        `code` is the exit code of the last step, `not_run` the result file that forge writes itself.
        """
        if code == _USAGE_ERROR and task.steps[-1].kind is StepKind.PYTEST:
            # After other errors, such as a failed import of conftest.py, pytest writes no results.
            return not any(one.counts.tests for one in outcomes if one.path != str(not_run))
        cases = [
            case for one in outcomes for case in one.cases if case.suite == f"unittest.loader.{NOT_LOADED}"
        ]
        missing = any(f"has no attribute '{case.name}'" in case.text for case in cases)
        # The files of one package may be in two folders.
        once = counted_once([replace(outcome, home="") for outcome in outcomes])
        return missing or not any(outcome.counts.tests for outcome in once)


def _choose(
    package: Package, names: tuple[str, ...], context: TestContext, variables: Mapping[str, str]
) -> ChosenTests:
    """Return the arguments that run only these tests of a package; raises SelectionError."""
    if package.build_type in PYTHON_TYPES:
        return _of_python(package, _python_cases(package.name, names, context), context)
    if package.build_type not in CMAKE_TYPES:
        return ChosenTests(cargo_args=names)
    programs = _ctest_names(context, package, variables)
    results = context.results_of(package.name) / "test_results" / package.name
    recorded_cases = _recorded_cases(package.name, results, context)
    if programs:
        recorded_cases = [each for each in recorded_cases if each[0] in programs]
    chosen: list[tuple[str, Case | None, str]] = []
    for name in names:
        matches = [
            (test, case, path)
            for test, case, path in recorded_cases
            if name in _names(test, case, package.name)
        ]
        if not matches and _IN_GTEST.fullmatch(name):
            # The last run may have left out this test of a program.
            suite, _, test = name.rpartition(".")
            gtests = {(program, path) for program, _, path in recorded_cases if path.endswith(".gtest.xml")}
            # Names of tests with parameters and types have further parts.
            cases = Case(test, suite), Case(f"{test}/*", f"*/{suite}"), Case(test, f"{suite}/*")
            matches = [(program, case, path) for program, path in sorted(gtests) for case in cases]
        if name in programs:
            chosen.append((name, None, ""))
        elif matches:
            chosen += matches
        else:
            labels = (label(case, package.name) for _, case, _ in recorded_cases)
            hint = did_you_mean(name, (*programs, *labels)) or f"its tests are {listed(programs)}"
            if not recorded_cases and programs and "did you mean" not in hint:
                hint += "; tests inside of these programs are known after their first run"
            raise SelectionError(Problem(f"'{package.name}' has no test '{name}'", hint=hint))
    return _of_cmake(package.name, chosen)


def _test_ids(folder: Path) -> Iterator[tuple[str, Case, str]]:
    """Yield the tests of the JUnit files in a folder, with the CTest test and the path of each file."""
    for path in sorted(folder.glob("*.xml")):
        with contextlib.suppress(OSError, WorkspaceError, BrokenResultError, NotAResultError):
            root = parse_xml(as_utf8(read_file(path), path), path)
            outcome = read_junit(root, str(path), str(folder))
            for suite in (root, *root.all("testsuite")):
                for case in suite.all("testcase"):
                    name, class_name = (case.attributes.get(key, "") for key in ("name", "classname"))
                    yield outcome.test, Case(name, class_name), str(path)


def _recorded_cases(package: str, results: Path, context: TestContext) -> list[tuple[str, Case, str]]:
    """Return the tests in result files, and those that earlier runs of chosen tests have left out."""
    file = known_cases_file(context.layout.build_dir(package))
    try:
        kept = [(test, Case(name, suite), path) for test, suite, name, path in json.loads(file.read_bytes())]
    except (OSError, ValueError, TypeError):
        kept = []
    cases = list(dict.fromkeys((*_test_ids(results), *kept)))
    if len(cases) > len(kept):
        file.parent.mkdir(parents=True, exist_ok=True)
        words = [(test, case.suite, case.name, path) for test, case, path in cases]
        replace_file(file, json.dumps(words).encode())
    return cases


def _python_cases(package: str, names: Iterable[str], context: TestContext) -> Iterator[Case]:
    """Yield the tests that names mean; raises SelectionError for an option."""
    recorded_cases = _recorded_cases(package, context.results_of(package), context)
    for name in names:
        if name.startswith("-"):
            hint = f"write PACKAGE{SEPARATOR}TEST, as the summary of 'forge test' prints them"
            raise SelectionError(Problem(f"'{package}{SEPARATOR}{name}' does not name a test", hint=hint))
        # pytest selects by parameters only in full names, and escapes characters other than ASCII.
        spellings = {name, name.encode("unicode_escape").decode()} if "[" in name else set()
        matches = [case for _, case, _ in recorded_cases if spellings & {*_names("", case, package)}]
        yield from matches or (_dotted(name),)


def _names(test: str, case: Case, package: str) -> tuple[str, ...]:
    """Return the possible names of a test inside a CTest test, including its suite and its last part."""
    own, suite = label(case, package), case.suite.removeprefix(f"{package}.")
    return own, suite, case.name, f"{test}{SEPARATOR}{own}"


def _last_failed(package: Package, context: TestContext, variables: Mapping[str, str]) -> ChosenTests | None:
    """Return the arguments that rerun the failed tests of a package's last run, None if they are unknown.

    Tests of CTest that no longer exist are left out. If a Python file does not contain the name of a failed
    test, which may be renamed or inherited, all of its tests run.
    """
    outcomes = [one for one in collect(context.results_of(package.name)).outcomes if one.counts.bad]
    if package.build_type in PYTHON_TYPES:
        cases = [case for one in outcomes if not one.is_unreadable for case in one.cases]
        # The run crashed or took too long, or unittest could not load a module, so that nobody knows which
        # tests failed.
        if any(case.name.endswith(".missing_result") or NOT_LOADED in case.suite for case in cases):
            return None
        return _of_python(package, cases, context, if_missing_all=True) if cases else None
    if package.build_type not in CMAKE_TYPES:
        return None
    programs = _ctest_names(context, package, variables)
    junits = {one.test: one for one in outcomes if not one.by_name}
    chosen: list[tuple[str, Case | None, str]] = []
    for name in (case.name for one in outcomes if one.by_name for case in one.cases):
        if name not in programs:
            continue
        junit = junits.get(name)
        chosen += [(name, case, junit.path) for case in junit.cases] if junit else [(name, None, "")]
    return _of_cmake(package.name, chosen) if chosen else None


def _dotted(name: str) -> Case:
    """Return the test that 'suite.test[parameters]' names; pytest understands names with '::' itself."""
    head, bracket, parameters = name.partition("[")
    is_node = SEPARATOR in head or head.endswith(".py")
    suite, _, test = ("", "", head) if is_node else head.rpartition(".")
    return Case(f"{test}{bracket}{parameters}", suite)


def _of_python(
    package: Package, cases: Iterable[Case], context: TestContext, *, if_missing_all: bool = False
) -> ChosenTests:
    """Return the arguments for some tests.

    With `if_missing_all`, all tests of a file run if it lacks one of them.
    """
    source, cases = context.source(package), list(cases)
    exists = lambda path: (source / path).is_file()  # noqa: E731  (a question, not a function)
    names = [case.name.partition("[")[0] for case in cases]
    nodes: list[str] = []
    named: list[str] = []
    by_names = False
    for case, name in zip(cases, names, strict=True):
        if SEPARATOR in name or name.endswith(".py"):
            nodes.append(case.name)
            named.append(_dotted_node(case.name))
            continue
        *keyword, node = selector(case, package.name, StepKind.PYTEST, exists)
        file = node.partition(SEPARATOR)[0]
        needs_all = if_missing_all and not keyword and name not in text_or_nothing(source / file)
        nodes.append(file if needs_all else node)
        by_names |= bool(keyword)
        own_name = f"{case.suite}.{case.name}" if case.suite else case.name
        named.append(_dotted_node(file) if needs_all else own_name)
    # pytest combines file and name filters, so if the file of one test is unknown, all are selected by name
    # only.
    keywords = " or ".join(dict.fromkeys(name.rpartition(SEPARATOR)[2] for name in names))
    pytest_args = ("-k", keywords) if by_names else (*dict.fromkeys(nodes),)
    unittest_args = [
        word for name in dict.fromkeys(named) for word in ((name,) if "." in name else ("-k", name))
    ]
    return ChosenTests(pytest_args=pytest_args, unittest_args=tuple(unittest_args))


def _dotted_node(name: str) -> str:
    """Return the name that unittest has for a node of pytest."""
    return _FILE.sub("", name, count=1).replace("/", ".").replace(SEPARATOR, ".")


def _of_cmake(package: str, chosen: Iterable[tuple[str, Case | None, str]]) -> ChosenTests:
    """Return the arguments for programs, and for cases in the JUnit files at a path.

    Variables apply to all programs, so they are set only if each chosen program has one.
    """
    chosen = list(chosen)
    names = "|".join(re.escape(name) for name in dict.fromkeys(name for name, _, _ in chosen))
    variable_sets = [dict(variables_for(path, case, package)) if case else {} for _, case, path in chosen]
    variables: list[tuple[str, str]] = []
    if all(variable_sets) and len({name for each in variable_sets for name in each}) == 1:
        (variable,) = variable_sets[0]
        values = list(dict.fromkeys(each[variable] for each in variable_sets))
        if variable == "GTEST_FILTER":
            variables.append((variable, ":".join(values)))
        else:
            words = " or ".join(value.removeprefix("-k ") for value in values)
            variables.append((variable, f"-k '{words}'"))
    return ChosenTests(ctest_args=("-R", f"^({names})$"), env=tuple(variables))


def _ctest_names(context: TestContext, package: Package, variables: Mapping[str, str]) -> list[str]:
    """Return the names of a package's tests, as CTest lists them."""
    argv = (str(context.ctest), "--show-only=json-v1", *context.of(package).options.ctest_args)
    try:
        done = subprocess.run(
            argv,
            cwd=context.layout.build_dir(package.name),
            env=dict(variables),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_SECONDS,
            check=False,
        )
        return [test["name"] for test in json.loads(done.stdout)["tests"]]
    except (OSError, ValueError, LookupError, TypeError, subprocess.SubprocessError):
        return []
