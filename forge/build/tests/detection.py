"""Inspects a package and its build folder for tests, without running code of the package."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from forge.base.errors import WorkspaceError
from forge.base.files import text_or_nothing
from forge.base.formats import read_toml
from forge.workspace.model import DependencyKind
from forge.workspace.python_metadata import PythonMetadata, read_pyproject, read_setup_cfg, read_setup_py

_BUILD_TYPE = re.compile(r"^CMAKE_BUILD_TYPE:[^=]*=(.*)$", re.MULTILINE)
_SUBFOLDER = re.compile(r'^\s*subdirs\("?([^")]+)"?\)', re.MULTILINE)
_TESTS = re.compile(r"^\s*(add_test|include)\(", re.MULTILINE)


def count_ctests(build: Path, most: int) -> int:
    """Return the number of tests that CTest finds in a build folder, or at least `most`.

    A file that a list of tests includes may contain any number of them.
    """
    waiting, count = [build], 0
    while waiting and count < most:
        folder = waiting.pop()
        text = text_or_nothing(folder / "CTestTestfile.cmake")
        count += sum(most if word == "include" else 1 for word in _TESTS.findall(text))
        waiting += [folder / name for name in _SUBFOLDER.findall(text)]
    return count


def requirements_of_tests(source: Path) -> frozenset[str]:
    """Return the normalized names of distributions that a Python package's tests require.

    Reads tests_require and test extras in setup.py, setup.cfg and pyproject.toml, and dependency groups.
    Values in setup.py that are not literals are ignored.
    """
    names = (
        dependency.name
        for facts in _facts(source)
        for dependency in facts.dependencies
        if DependencyKind.TEST in dependency.kinds
    )
    return frozenset(re.sub(r"[-_.]+", "-", name).lower() for name in names)


def _facts(source: Path) -> Iterator[PythonMetadata]:
    """Yield the metadata of each of a package's files; unreadable ones are skipped."""
    with suppress(SyntaxError, ValueError, RecursionError):
        yield read_setup_py(text_or_nothing(source / "setup.py")) or PythonMetadata()
    yield read_setup_cfg(text_or_nothing(source / "setup.cfg"))
    with suppress(WorkspaceError):
        table = read_toml(text_or_nothing(source / "pyproject.toml"), source / "pyproject.toml")
        groups = table.get("dependency-groups", {})
        yield read_pyproject(table) or PythonMetadata()
        yield read_pyproject({"project": {"optional-dependencies": groups}}) or PythonMetadata()


def has_ctests(build: Path) -> bool:
    return count_ctests(build, 1) > 0


def ctest_configuration(build: Path) -> str:
    """Return the configuration for CTest: from CMake's cache, else Release as in colcon; '' without tests."""
    if not has_ctests(build):
        return ""
    match = _BUILD_TYPE.search(text_or_nothing(build / "CMakeCache.txt"))
    configurations = {"Debug", "MinSizeRel", "RelWithDebInfo"}
    return match[1] if match and match[1] in configurations else "Release"
