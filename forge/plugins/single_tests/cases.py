"""The arguments and variables that run a single test alone."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from forge.base.frozen import Pairs
from forge.build.tasks import StepKind
from forge.testing.outcomes import Case, label

_PYTEST_NAME = re.compile(r"test\w*(\[.*\])?")
NOT_LOADED = "_FailedTest"
"""The class of unittest's errors for modules and tests that it cannot load."""


def variables_for(path: str, case: Case, package: str) -> Pairs:
    """Return the variables that make a program started by CTest run one test; () if it supports none.

    `path` is the JUnit file of the program, whose name identifies the test framework.
    """
    # A program that crashed wrote no result; ament's says so in a case with the name of the program.
    is_program = (case.suite, f"{case.name}.gtest.xml") == (f"{package}.{package}", Path(path).name)
    if path.endswith(".gtest.xml") and case.suite and case.suite != package and not is_program:
        return (("GTEST_FILTER", label(case, package)),)
    if path.endswith(".xunit.xml") and _PYTEST_NAME.fullmatch(case.name):
        return (("PYTEST_ADDOPTS", f"-k {case.name.partition('[')[0]}"),)
    return ()


def selector(case: Case, package: str, kind: StepKind, exists: Callable[[str], bool]) -> tuple[str, ...]:
    """Return the arguments with which pytest or unittest runs one test."""
    parts = case.suite.split(".") if case.suite else []
    if kind is StepKind.UNITTEST:
        needs_all = not case.suite or " " in case.name or NOT_LOADED in case.suite
        return () if needs_all else (f"{case.suite}.{case.name}",)
    if parts[:1] == [package]:
        parts = parts[1:]
    for length in range(len(parts), 0, -1):
        file = "/".join(parts[:length]) + ".py"
        if exists(file):
            return ("::".join((file, *parts[length:], case.name)),)
    return ("-k", case.name.partition("[")[0])
