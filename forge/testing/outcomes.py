"""Parses and formats result files: JUnit of pytest, gtest, Catch2 and ament, and CTest's Test.xml."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, replace
from operator import add

from forge.base.frozen import frozen
from forge.base.text import counted
from forge.base.xml import Element


@frozen
class Counts:
    tests: int = 0
    errors: int = 0
    failures: int = 0
    skipped: int = 0

    def __add__(self, other: Counts) -> Counts:
        return Counts(*map(add, astuple(self), astuple(other)))

    def __str__(self) -> str:
        return (
            f"{counted(self.tests, 'test')}, {counted(self.errors, 'error')}, "
            f"{counted(self.failures, 'failure')}, {self.skipped} skipped"
        )

    @property
    def bad(self) -> bool:
        return bool(self.errors or self.failures)


@frozen
class Case:
    """A failed or skipped test, with messages and output in the order of the file.

    `text` is the complete text, or the reason why it was skipped.
    """

    name: str
    suite: str = ""
    file: str = ""
    line: str = ""
    errors: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()
    stdout: tuple[str, ...] = ()
    stderr: tuple[str, ...] = ()
    text: str = ""


@frozen
class Outcome:
    """The contents of one result file. `home` is the folder of its tests.

    `by_name` contains the counts of each test by name, only for CTest files; `skipped` the tests that give a
    reason. A file that cannot be read is one error.
    """

    path: str
    home: str
    counts: Counts
    cases: tuple[Case, ...] = ()
    by_name: tuple[tuple[str, Counts], ...] = ()
    skipped: tuple[Case, ...] = ()
    is_unreadable: bool = False

    @property
    def test(self) -> str:
        """The name of the CTest test that a JUnit file of ament belongs to."""
        name = self.path.rpartition("/")[2].removesuffix(".xml")
        return name.removesuffix(".catch2").removesuffix(".gtest").removesuffix(".xunit")


class NotAResultError(ValueError):
    """Well-formed XML that is not a test result."""


class BrokenResultError(ValueError):
    """A test result without the number of failed tests."""


def read_junit(root: Element, path: str, home: str) -> Outcome:
    """Parse a JUnit file; raises NotAResultError if it is not one, BrokenResultError for invalid numbers."""
    if root.tag not in _SUITES:
        raise NotAResultError(f"the root element is '{root.tag}', not 'testsuite' or 'testsuites'")
    failed, skipped = [], []
    for element in _test_cases(root):
        name, suite, file, line = (
            element.attributes.get(key, "") for key in ("name", "classname", "file", "line")
        )
        wrong = [child for child in element.children if child.tag in {"error", "failure"}]
        if wrong:
            text = "\n".join(filter(None, (child.text.strip("\r\n") for child in wrong)))
            errors, failures = (
                tuple(child.attributes.get("message", "") for child in element.all(tag))
                for tag in ("error", "failure")
            )
            stdout, stderr = (
                tuple(child.text for child in element.all(tag)) for tag in ("system-out", "system-err")
            )
            failed.append(Case(name, suite, file, line, errors, failures, stdout, stderr, text))
        reasons = (child.attributes.get("message") or child.text for child in element.all("skipped"))
        if reason := " ".join(next(reasons, "").split()):
            skipped.append(Case(name, suite, text=reason))
    return Outcome(path, home, _suite_counts(root), tuple(failed), skipped=tuple(skipped))


def unreadable(path: str, home: str, reason: str) -> Outcome:
    """Return an error for a result file that cannot be read: its tests may have failed."""
    case = Case(path.rpartition("/")[2], errors=(reason,))
    return Outcome(path, home, Counts(tests=1, errors=1), (case,), is_unreadable=True)


def read_ctest(root: Element, path: str, home: str) -> Outcome:
    """Parse a CTest Test.xml; raises BrokenResultError if it is not one."""
    if root.tag != "Site" or [child.tag for child in root.children] != ["Testing"]:
        raise BrokenResultError("it does not consist of one 'Site' with one 'Testing'")
    tests = list(root.children[0].all("Test"))
    if any("Status" not in test.attributes for test in tests):
        raise BrokenResultError("a 'Test' has no 'Status'")
    verdicts, failed, skipped = [], [], []
    for test in tests:
        name, status, output = _text_of(test, "Name"), test.attributes["Status"], _ctest_output(test)
        completion = _measured(test, "Completion Status")
        last = "".join(output.rstrip().splitlines()[-1:])
        not_run = last if completion in last else ", ".join(filter(None, (completion, last)))
        # CTest fails if it could not run a test, for example if its program is missing.
        is_skipped = status == "notrun" and (completion in {"", "Disabled"} or completion.startswith("SKIP_"))
        if status == "passed":
            counts = Counts(tests=1)
        elif status == "failed":
            counts = Counts(tests=1, failures=1)
            # The reason if it did not end by itself, such as 'Timeout'.
            reason = _measured(test, "Exit Code")
            text = f"{output.rstrip()}\n{reason}".lstrip() if reason not in {"", "Failed"} else output
            failed.append(Case(name, failures=(text,) if text else (), text=text))
        elif is_skipped:
            counts = Counts(tests=1, skipped=1)
            if completion:
                skipped.append(Case(name, text=not_run))
        else:
            counts = Counts(tests=1, errors=1)
            if status == "notrun":
                failed.append(Case(name, failures=(not_run,) if not_run else (), text=not_run))
        verdicts.append((name, counts))
    total = sum((counts for _, counts in verdicts), Counts())
    return Outcome(path, home, total, tuple(failed), tuple(verdicts), tuple(skipped))


def find_junit(name: str, home: str, junits: Iterable[Outcome]) -> Outcome | None:
    """Return the JUnit file of ament's test `name` in the folder `home`, or None."""
    return next((one for one in junits if one.test == name and one.home == home and not one.by_name), None)


def counted_once(outcomes: Sequence[Outcome]) -> tuple[Outcome, ...]:
    """Return the results without CTest tests that a JUnit file also contains.

    Tests of ament write both. If only CTest reports a failure, for example because a program crashed after
    its last test, both count.
    """
    named: dict[tuple[str, str], list[Outcome]] = {}
    for outcome in outcomes:
        named.setdefault((outcome.home, outcome.test), []).append(outcome)
    once = []
    for outcome in outcomes:
        if not outcome.by_name:
            once.append(outcome)
            continue
        left = []
        for name, counts in outcome.by_name:
            junit = find_junit(name, outcome.home, named.get((outcome.home, name), ()))
            if junit is None or (counts.bad and not junit.counts.bad):
                left.append((name, counts))
        names = {name for name, _ in left}
        without_duplicates = replace(
            outcome,
            counts=sum((counts for _, counts in left), Counts()),
            cases=tuple(case for case in outcome.cases if case.name in names),
            by_name=tuple(left),
            skipped=tuple(test for test in outcome.skipped if test.name in names),
        )
        once.append(without_duplicates)
    return tuple(once)


def _suite_counts(suite: Element) -> Counts:
    """Return the counts of a suite: those of its attributes, or of its elements if these are higher.

    So a writer that crashes or miscounts hides no failed test.
    """
    numbers = [_number(suite.attributes, name) for name in ("tests", "errors", "failures")]
    numbers.append(sum(_number(suite.attributes, name) for name in ("skip", "skipped", "disabled")))
    nested = sum((_suite_counts(child) for child in suite.children if child.tag in _SUITES), Counts())
    cases = list(_own_cases(suite))
    tags = [{child.tag for child in case.children} for case in cases]
    errors = sum("error" in each for each in tags)
    failures = sum("failure" in each and "error" not in each for each in tags)
    present = nested + Counts(len(cases), errors, failures, sum("skipped" in each for each in tags))
    return Counts(*map(max, numbers, astuple(present)))


_SUITES = ("testsuite", "testsuites")


def _number(attributes: Mapping[str, str], name: str) -> int:
    value = attributes.get(name, "0")
    try:
        number = int(value)
    except ValueError:
        number = -1
    if number < 0:
        raise BrokenResultError(f"'{name}' is not a number: '{value}'")
    return number


def _test_cases(suite: Element) -> Iterator[Element]:
    yield from _own_cases(suite)
    for child in suite.children:
        if child.tag in _SUITES:
            yield from _test_cases(child)


def _own_cases(suite: Element) -> Iterator[Element]:
    """Yield the test cases of a suite; an error of the suite itself, as in its setup, is another case."""
    yield from suite.all("testcase")
    if any(child.tag in {"error", "failure"} for child in suite.children):
        yield suite


def _ctest_output(test: Element) -> str:
    measurements = (each for results in test.all("Results") for each in results.all("Measurement"))
    return next(filter(None, (_text_of(each, "Value") for each in measurements)), "")


def _measured(test: Element, name: str) -> str:
    measured = (each for results in test.all("Results") for each in results.all("NamedMeasurement"))
    named = (each for each in measured if each.attributes.get("name") == name)
    return next((_text_of(each, "Value") for each in named), "")


def _text_of(element: Element, tag: str) -> str:
    return next((child.text for child in element.all(tag)), "")


_SHOWN_LINES = 6


def label(case: Case, package: str) -> str:
    """Return the name of a test in the summary: its suite and name, without that of the package."""
    return f"{case.suite}.{case.name}".removeprefix(f"{package}.").removeprefix(".")


def first_lines(cases: Sequence[Case]) -> tuple[str, ...]:
    """Return the first lines of the cases, labeled if there are several."""
    lines: list[str] = []
    for case in cases:
        # The lines of the message, else of the complete text.
        texts = map(_filled_lines, (*case.errors, *case.failures, case.text))
        shown = next(filter(None, texts), [])[:_SHOWN_LINES]
        lines += [f"{case.name}:", *(f"  {line}" for line in shown)] if len(cases) > 1 else shown
    return tuple(lines[: 2 * _SHOWN_LINES])


def last_lines(text: str) -> tuple[str, ...]:
    return tuple(_filled_lines(text)[-_SHOWN_LINES:])


def _filled_lines(text: str) -> list[str]:
    return [line.rstrip() for line in text.splitlines() if line.strip()]
