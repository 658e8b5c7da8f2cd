"""Parses result files: JUnit as written by pytest, gtest, Catch2 and ament, and CTest's Test.xml."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from forge.base.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from forge.base.xml import Element


@frozen
class Counts:
    """Numbers of tests, errors, failures and skipped tests."""

    tests: int = 0
    errors: int = 0
    failures: int = 0
    skipped: int = 0

    def __add__(self, other: Counts) -> Counts:
        """Return the sum."""
        return Counts(
            self.tests + other.tests,
            self.errors + other.errors,
            self.failures + other.failures,
            self.skipped + other.skipped,
        )

    def __str__(self) -> str:
        return (
            f"{_many(self.tests, 'test')}, {_many(self.errors, 'error')}, "
            f"{_many(self.failures, 'failure')}, {self.skipped} skipped"
        )

    @property
    def bad(self) -> bool:
        """Tell whether any test failed."""
        return bool(self.errors or self.failures)


@frozen
class Case:
    """A failed test. Messages and outputs are in the order of the file; `text` is the complete text."""

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
class SkippedTest:
    """A test that was skipped for a reason."""

    name: str
    suite: str
    reason: str


@frozen
class Outcome:
    """The contents of one result file. `home` is the folder of its tests.

    `by_name` contains the counts of each test by name, only for CTest files.
    """

    path: str
    home: str
    counts: Counts
    cases: tuple[Case, ...] = ()
    by_name: tuple[tuple[str, Counts], ...] = ()
    skipped: tuple[SkippedTest, ...] = ()

    @property
    def test(self) -> str:
        """The name of the CTest test that a JUnit file of ament belongs to."""
        name = self.path.rpartition("/")[2].removesuffix(".xml")
        return name.removesuffix(".catch2").removesuffix(".gtest").removesuffix(".xunit")


class NotAResultError(ValueError):
    """Well-formed XML that is not a test result."""


def read_junit(root: Element, path: str, home: str) -> Outcome:
    """Parse a JUnit file; raises NotAResultError if it is not one."""
    suites = {"testsuite": [root], "testsuites": list(root.all("testsuite"))}.get(root.tag)
    if suites is None:
        raise NotAResultError(f"the root element is '{root.tag}', not 'testsuite' or 'testsuites'")
    counts = sum((_suite_counts(suite.attributes) for suite in suites), Counts())
    elements = [case for suite in suites for case in suite.all("testcase")]
    failed = tuple(case for case in map(_junit_case, elements) if case.errors or case.failures)
    return Outcome(path, home, counts, failed, skipped=tuple(filter(None, map(_junit_skip, elements))))


def read_ctest(root: Element, path: str, home: str) -> Outcome:
    """Parse a CTest Test.xml; raises NotAResultError if it is not one."""
    if root.tag != "Site" or [child.tag for child in root.children] != ["Testing"]:
        raise NotAResultError("it does not consist of one 'Site' with one 'Testing'")
    tests = list(root.children[0].all("Test"))
    if any("Status" not in test.attributes for test in tests):
        raise NotAResultError("a 'Test' has no 'Status'")
    verdicts = tuple((_text_of(test, "Name"), _verdict(test.attributes["Status"])) for test in tests)
    failed = tuple(_ctest_case(test) for test in tests if test.attributes["Status"] == "failed")
    skipped = tuple(map(_ctest_skip, (test for test in tests if test.attributes["Status"] == "notrun")))
    counts = sum((counts for _, counts in verdicts), Counts())
    return Outcome(path, home, counts, failed, verdicts, tuple(filter(None, skipped)))


def find_junit(name: str, home: str, junits: Iterable[Outcome]) -> Outcome | None:
    """Return the JUnit file of ament's test `name` in that home, or None."""
    found = (junit for junit in junits if junit.test == name and junit.home == home and not junit.by_name)
    return next(found, None)


def counted_once(outcomes: Sequence[Outcome]) -> tuple[Outcome, ...]:
    """Return the results without CTest tests that a JUnit file also contains.

    Tests of ament write both. If only CTest reports a failure, for example because a program crashed after
    its last test, both count.
    """
    named: dict[tuple[str, str], list[Outcome]] = {}
    for outcome in outcomes:
        named.setdefault((outcome.home, outcome.test), []).append(outcome)
    return tuple(_without_duplicates(outcome, named) if outcome.by_name else outcome for outcome in outcomes)


def _without_duplicates(outcome: Outcome, named: Mapping[tuple[str, str], list[Outcome]]) -> Outcome:
    left = []
    for name, counts in outcome.by_name:
        junit = find_junit(name, outcome.home, named.get((outcome.home, name), ()))
        if junit is None or (counts.bad and not junit.counts.bad):
            left.append((name, counts))
    names = {name for name, _ in left}
    return replace(
        outcome,
        counts=sum((counts for _, counts in left), Counts()),
        cases=tuple(case for case in outcome.cases if case.name in names),
        by_name=tuple(left),
        skipped=tuple(test for test in outcome.skipped if test.name in names),
    )


def _suite_counts(attributes: Mapping[str, str]) -> Counts:
    return Counts(
        _number(attributes, "tests", required=True),
        _number(attributes, "errors"),
        _number(attributes, "failures", required=True),
        sum(_number(attributes, name) for name in ("skip", "skipped", "disabled")),
    )


def _number(attributes: Mapping[str, str], name: str, *, required: bool = False) -> int:
    value = attributes.get(name, "" if required else "0")
    try:
        number = int(value)
    except ValueError:
        number = -1
    if number < 0:
        raise NotAResultError(f"'{name}' is not a number: '{value}'")
    return number


def _junit_case(case: Element) -> Case:
    fields = case.attributes
    wrong = [child for child in case.children if child.tag in {"error", "failure"}]
    return Case(
        fields.get("name", ""),
        fields.get("classname", ""),
        fields.get("file", ""),
        fields.get("line", ""),
        tuple(_messages(case, "error")),
        tuple(_messages(case, "failure")),
        tuple(child.text for child in case.all("system-out")),
        tuple(child.text for child in case.all("system-err")),
        "\n".join(filter(None, (child.text.strip("\r\n") for child in wrong))),
    )


def _junit_skip(case: Element) -> SkippedTest | None:
    reasons = (child.attributes.get("message") or child.text for child in case.all("skipped"))
    reason = " ".join(next(reasons, "").split())
    fields = case.attributes
    return SkippedTest(fields.get("name", ""), fields.get("classname", ""), reason) if reason else None


def _messages(case: Element, tag: str) -> Iterator[str]:
    return (child.attributes.get("message", "") for child in case.all(tag))


def _ctest_case(test: Element) -> Case:
    output = ""
    for results in test.all("Results"):
        for measurement in results.all("Measurement"):
            output = output or _text_of(measurement, "Value")
    return Case(_text_of(test, "Name"), failures=(output,) if output else (), text=output)


def _ctest_skip(test: Element) -> SkippedTest | None:
    """Return the reason that CTest gives, with the last line that the test printed."""
    measured = (each for results in test.all("Results") for each in results.all("NamedMeasurement"))
    named = (each for each in measured if each.attributes.get("name") == "Completion Status")
    status = next((_text_of(each, "Value") for each in named), "")
    last = "".join(_ctest_case(test).text.rstrip().splitlines()[-1:])
    reason = last if status in last else ", ".join(filter(None, (status, last)))
    return SkippedTest(_text_of(test, "Name"), "", reason) if status else None


def _text_of(element: Element, tag: str) -> str:
    return next((child.text for child in element.all(tag)), "")


def _verdict(status: str) -> Counts:
    match status:
        case "passed":
            return Counts(tests=1)
        case "failed":
            return Counts(tests=1, failures=1)
        case "notrun":
            return Counts(tests=1, skipped=1)
        case _:
            return Counts(tests=1, errors=1)


def _many(count: int, word: str) -> str:
    return f"{count} {word}{'' if count == 1 else 's'}"
