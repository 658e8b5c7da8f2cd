"""The attempts of tests that are repeated until they pass: find flaky tests, and complete the result files.

A repetition with CTest runs only the failed tests, but replaces the results of all tests. So the results of
earlier attempts are kept and added to those of the last one.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

from forge.base.files import replace_file
from forge.base.frozen import frozen
from forge.base.text import counted
from forge.output.reporters import Report
from forge.testing.outcomes import Case, Outcome, counted_once, first_lines, label

_SHOWN = 20


@frozen
class Attempt:
    """The failed tests of one attempt with the paths of their results, and the contents of these files."""

    failed: Mapping[str, tuple[Case, str]]
    files: Mapping[str, bytes]


@frozen
class FlakyTest:
    """A test that failed and passed when repeated, first at this attempt."""

    package: str
    test: str
    passed_at: int
    lines: tuple[str, ...]


class Retests:
    """The attempts at the tests of each package in one run of `forge test`."""

    def __init__(self) -> None:
        self._attempts: dict[str, list[Attempt]] = {}

    def add(self, package: str, outcomes: Iterable[Outcome]) -> None:
        """Keep the results of an attempt."""
        failed, files = {}, {}
        for outcome in counted_once([replace(each, home="") for each in outcomes]):
            if outcome.counts.bad or outcome.by_name:
                with contextlib.suppress(OSError):
                    files[outcome.path] = Path(outcome.path).read_bytes()
            for case in () if outcome.is_unreadable else outcome.cases:
                name = case.name if outcome.by_name else label(case, package)
                failed[name] = case, outcome.path
        self._attempts.setdefault(package, []).append(Attempt(failed, files))

    def complete(self, package: str) -> None:
        """Add the results of earlier attempts to the files of the last one: other tests, and failures."""
        if package in self._attempts:
            complete_results(self._attempts[package])

    def conclude(self, packages: Container[str], log: Path | None) -> Report:
        """Return a table and events with the flaky tests of `packages`; write all attempts below `log`."""
        flaky: list[FlakyTest] = []
        for name, attempts in sorted(self._attempts.items()):
            flaky += flaky_tests(name, attempts) if name in packages else ()
            if log is not None:
                write_attempts(log / name, attempts)
        events = (
            (
                "FlakyTest",
                each.package,
                {"test": each.test, "passed_at": each.passed_at, "message": [*each.lines]},
            )
            for each in flaky
        )
        return Report((*flaky_table(flaky),), (*events,))


def flaky_tests(package: str, attempts: Sequence[Attempt]) -> Iterator[FlakyTest]:
    """Yield the tests that failed in an attempt and passed in the last one, whose results are complete."""
    for name in sorted({name for attempt in attempts for name in attempt.failed}):
        failures = [attempt.failed.get(name) for attempt in attempts]
        first = next(filter(None, failures))
        if failures[-1] is None and _has_passed(*first):
            passed_at = failures.index(None, failures.index(first)) + 1
            yield FlakyTest(package, name, passed_at, first_lines([first[0]]))


def _has_passed(case: Case, path: str) -> bool:
    """Return whether a file contains a test; a result of CTest must report its success."""
    with contextlib.suppress(OSError, ET.ParseError):
        root = ET.parse(path).getroot()  # noqa: S314  (results of tests that have just run here)
        if root.find("Testing") is None:
            return any(_is(element, case) for element in root.iter("testcase"))
        return any(
            test.findtext("Name") == case.name and test.get("Status") == "passed"
            for test in root.iter("Test")
        )
    return False


def _is(element: ET.Element, case: Case) -> bool:
    return (element.get("name"), element.get("classname", "")) == (case.name, case.suite)


def complete_results(attempts: Sequence[Attempt]) -> None:
    """Add the results of earlier attempts to the files of the last one: other tests, and failures.

    A test that passed in the end gets an element 'flakyFailure' for each failed attempt, as Maven's Surefire
    writes it; a test that never passed gets 'rerunFailure' for the attempts before the last.
    """
    *earlier, last = attempts
    for path in {path for attempt in earlier for path in attempt.files}:
        with contextlib.suppress(OSError, ET.ParseError):
            content = Path(path).read_bytes()
            tree = ET.parse(io.BytesIO(content))  # noqa: S314  (results of tests that have just run here)
            tests = tree.find("Testing")
            if tests is not None:
                names = {test.findtext("Name") for test in tests.iter("Test")}
                for attempt in reversed(earlier):
                    _add_tests(tests, names, attempt.files.get(path, b""))
            for attempt in earlier:
                _add_failures(tree.getroot(), path, attempt, last)
            text = ET.tostring(tree.getroot(), encoding="utf-8", xml_declaration=True)
            if text != content:
                replace_file(Path(path), text)


def _add_tests(tests: ET.Element, known: set[str | None], content: bytes) -> None:
    """Add the tests of another Test.xml of CTest that are missing."""
    for test in ET.fromstring(content).iter("Test") if content else ():  # noqa: S314
        if (name := test.findtext("Name")) is not None and name not in known:
            known.add(name)
            tests.append(test)


def _add_failures(root: ET.Element, path: str, attempt: Attempt, last: Attempt) -> None:
    for name, (case, file) in attempt.failed.items():
        for element in root.iter("testcase") if file == path else ():
            if _is(element, case):
                tag = "rerunFailure" if name in last.failed else "flakyFailure"
                message = next(iter((*case.errors, *case.failures)), "")
                ET.SubElement(element, tag, message=message, type="failure").text = case.text


def write_attempts(folder: Path, attempts: Sequence[Attempt]) -> None:
    """Write the result files of all attempts but the last below the log folder of a package."""
    for number, attempt in enumerate(attempts[:-1], 1):
        for path, content in attempt.files.items():
            file = folder / f"attempt_{number}" / Path(path).name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)


def flaky_table(tests: Sequence[FlakyTest]) -> Iterator[str]:
    """Yield the flaky tests, each with the message of its first failure."""
    if tests:
        yield f"{counted(len(tests), 'flaky test')}:"
    for test in tests[:_SHOWN]:
        yield f"  {test.package}: {test.test} (passed at attempt {test.passed_at})"
        yield from (f"      {line}" for line in test.lines)
    if len(tests) > _SHOWN:
        yield f"  and {len(tests) - _SHOWN} more"
