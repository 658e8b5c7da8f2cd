"""Selects packages by the results of the last build and test run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from forge.base.files import text_or_nothing
from forge.base.layout import BUILD_RESULT, TEST_RESULT
from forge.workspace.selection import FilterResult, Query


def by_results(query: Query, build: Path, names: Iterable[str]) -> Iterator[FilterResult]:
    """Yield the packages that each option keeps, with the reason for leaving out others."""
    if query.select_build_failed:
        yield "did not fail to build", _ended(build, BUILD_RESULT, names, failed=True)
    if query.skip_build_finished:
        finished = _ended(build, BUILD_RESULT, names, failed=False)
        yield "already built successfully", frozenset(names) - finished
    if query.select_test_failures:
        stopped = frozenset({"SIGINT"}) if query.select_stopped_tests else frozenset[str]()
        failed = _ended(build, TEST_RESULT, names, failed=True, counted=stopped)
        yield "had no test failures", failed
    if query.skip_test_passed:
        yield "passed its tests before", frozenset(names) - _ended(build, TEST_RESULT, names, failed=False)


def _ended(
    build: Path, file: str, names: Iterable[str], *, failed: bool, counted: frozenset[str] = frozenset()
) -> frozenset[str]:
    """Return the packages whose last run failed, or succeeded.

    Interrupted runs are neither, unless their result is `counted`.
    """
    neither = {"", "SIGINT"} - counted
    words = {name: text_or_nothing(build / name / file).strip() for name in names}
    return frozenset(name for name, word in words.items() if word not in neither and (word != "0") == failed)
