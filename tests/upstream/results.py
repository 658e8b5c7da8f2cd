"""Counts the test results of a workspace, as `forge test-result` does, by package."""

from collections.abc import Collection, Iterator
from pathlib import Path

from forge.testing.collecting import collect
from forge.testing.outcomes import Counts, Outcome, counted_once
from tests.upstream.figures import Count


def count_tests(workspace: Path, packages: Collection[str]) -> dict[str, Count]:
    """Return passed and all tests of those packages that the workspace has results of.

    A skipped test has not passed; a test that the suite itself disables is not counted. A suite whose name is
    that of an embedded package is in a package with `_tests` after the name.
    """
    found = {}
    for package in packages:
        outcomes = _outcomes(workspace, package)
        if outcomes:
            counts = sum((outcome.counts for outcome in outcomes), Counts())
            skipped = sum(len(outcome.skipped) for outcome in outcomes)
            total = counts.tests - (counts.skipped - skipped)
            found[package] = (total - counts.errors - counts.failures - skipped, total)
    return found


def missed_tests(workspace: Path, packages: Collection[str]) -> Iterator[str]:
    """Yield the tests that failed or were skipped, as 'package: suite.name'."""
    for package in packages:
        for outcome in _outcomes(workspace, package):
            names = [(case.suite, case.name) for case in outcome.cases]
            names += [(test.suite, test.name) for test in outcome.skipped]
            yield from (f"{package}: {suite}.{name}" for suite, name in names)


def _outcomes(workspace: Path, package: str) -> tuple[Outcome, ...]:
    folders = (workspace / "build" / name for name in (package, f"{package}_tests"))
    return tuple(outcome for folder in folders for outcome in counted_once(collect(folder).outcomes))
