"""Result files to counts and cases: JUnit as pytest, gtest and ament write it, and CTest's Test.xml; pure."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from forge.xml_tree import Element


@frozen
class Counts:
    """How many tests there were, and how many of them went wrong or were left out."""

    tests: int = 0
    errors: int = 0
    failures: int = 0
    skipped: int = 0

    def __add__(self, other: Counts) -> Counts:
        """Return the sum of both."""
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
        """Tell if any test went wrong."""
        return bool(self.errors or self.failures)


@frozen
class Case:
    """A test that went wrong. Messages and outputs are in the order of the file; `text` is the long story."""

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
    """What one result file says. `home` is the folder whose tests it tells of.

    `by_name` holds the verdict on each test of a CTest file, which alone has these, by its name.
    """

    path: str
    home: str
    counts: Counts
    cases: tuple[Case, ...] = ()
    by_name: tuple[tuple[str, Counts], ...] = ()

    @property
    def test(self) -> str:
        """The name of the CTest test that a JUnit file of ament belongs to."""
        return self.path.rpartition("/")[2].removesuffix(".xml").removesuffix(".gtest").removesuffix(".xunit")


class NotAResultError(ValueError):
    """The file is good XML, but tells of no tests."""


def read_junit(root: Element, path: str, home: str) -> Outcome:
    """Return what a JUnit file says; raises NotAResultError when the root or its counts are none."""
    suites = {"testsuite": [root], "testsuites": list(root.all("testsuite"))}.get(root.tag)
    if suites is None:
        raise NotAResultError(f"the root is neither 'testsuite' nor 'testsuites' but '{root.tag}'")
    counts = sum((_suite_counts(suite.attributes) for suite in suites), Counts())
    cases = [case for suite in suites for case in map(_junit_case, suite.all("testcase"))]
    return Outcome(path, home, counts, tuple(case for case in cases if case.errors or case.failures))


def read_ctest(root: Element, path: str, home: str) -> Outcome:
    """Return what a Test.xml of CTest says; raises NotAResultError when it is none."""
    if root.tag != "Site" or [child.tag for child in root.children] != ["Testing"]:
        raise NotAResultError("it does not consist of one 'Site' with one 'Testing'")
    tests = list(root.children[0].all("Test"))
    if any("Status" not in test.attributes for test in tests):
        raise NotAResultError("a 'Test' has no 'Status'")
    verdicts = tuple((_text_of(test, "Name"), _verdict(test.attributes["Status"])) for test in tests)
    failed = tuple(_ctest_case(test) for test in tests if test.attributes["Status"] == "failed")
    return Outcome(path, home, sum((counts for _, counts in verdicts), Counts()), failed, verdicts)


def twin_of(name: str, home: str, junits: Iterable[Outcome]) -> Outcome | None:
    """Return the JUnit file that ament's test `name` of that home left, or None."""
    found = (junit for junit in junits if junit.test == name and junit.home == home and not junit.by_name)
    return next(found, None)


def counted_once(outcomes: Sequence[Outcome]) -> tuple[Outcome, ...]:
    """Return the outcomes without the tests in CTest's files that a JUnit file tells of too.

    ament's tests leave both. Where the JUnit file is content and CTest is not, as when a program dies
    after its last test, both count: no failure gets lost.
    """
    named: dict[tuple[str, str], list[Outcome]] = {}
    for outcome in outcomes:
        named.setdefault((outcome.home, outcome.test), []).append(outcome)
    return tuple(_without_twins(outcome, named) if outcome.by_name else outcome for outcome in outcomes)


def _without_twins(outcome: Outcome, named: Mapping[tuple[str, str], list[Outcome]]) -> Outcome:
    left = []
    for name, counts in outcome.by_name:
        twin = twin_of(name, outcome.home, named.get((outcome.home, name), ()))
        if twin is None or (counts.bad and not twin.counts.bad):
            left.append((name, counts))
    names = {name for name, _ in left}
    return replace(
        outcome,
        counts=sum((counts for _, counts in left), Counts()),
        cases=tuple(case for case in outcome.cases if case.name in names),
        by_name=tuple(left),
    )


def _suite_counts(attributes: Mapping[str, str]) -> Counts:
    return Counts(
        _number(attributes, "tests", required=True),
        _number(attributes, "errors"),
        _number(attributes, "failures", required=True),
        sum(_number(attributes, name) for name in ("skip", "skipped", "disabled")),
    )


def _number(attributes: Mapping[str, str], name: str, *, required: bool = False) -> int:
    said = attributes.get(name, "" if required else "0")
    try:
        number = int(said)
    except ValueError:
        number = -1
    if number < 0:
        raise NotAResultError(f"'{name}' is no number but '{said}'")
    return number


def _junit_case(case: Element) -> Case:
    told = case.attributes
    wrong = [child for child in case.children if child.tag in {"error", "failure"}]
    return Case(
        told.get("name", ""),
        told.get("classname", ""),
        told.get("file", ""),
        told.get("line", ""),
        tuple(_messages(case, "error")),
        tuple(_messages(case, "failure")),
        tuple(child.text for child in case.all("system-out")),
        tuple(child.text for child in case.all("system-err")),
        "\n".join(filter(None, (child.text.strip("\r\n") for child in wrong))),
    )


def _messages(case: Element, tag: str) -> Iterator[str]:
    return (child.attributes.get("message", "") for child in case.all(tag))


def _ctest_case(test: Element) -> Case:
    output = ""
    for results in test.all("Results"):
        for measurement in results.all("Measurement"):
            output = output or _text_of(measurement, "Value")
    return Case(_text_of(test, "Name"), failures=(output,) if output else (), text=output)


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
