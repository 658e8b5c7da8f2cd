"""What a package and its build folder say about its tests; nothing of the package is run to know."""

from __future__ import annotations

import re
from contextlib import suppress
from typing import TYPE_CHECKING

from forge.errors import WorkspaceError
from forge.files import text_or_nothing
from forge.formats import read_toml
from forge.model import Kind
from forge.python_reading import PythonFacts, read_pyproject, read_setup_cfg, read_setup_py
from forge.testing.recipes import Look
from forge.tools import CMAKE_TYPES

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from forge.model import Package

_BUILD_TYPE = re.compile(r"^CMAKE_BUILD_TYPE:[^=]*=(.*)$", re.MULTILINE)
_SUBFOLDER = re.compile(r'^\s*subdirs\("?([^")]+)"?\)', re.MULTILINE)
_LARGEST = 1 << 30
"""How many bytes are read of what CMake generated."""
_TESTS = re.compile(r"^\s*(add_test|include)\(", re.MULTILINE)


def look(package: Package, source: Path, build: Path) -> Look:
    """Return what is known before a test runs; `source` and `build` are the package's folders."""
    if package.build_type in CMAKE_TYPES:
        return Look(configuration=_configuration(build) if has_ctests(build) else "")
    return Look(wants=requirements_of_tests(source))


def has_ctests(build: Path) -> bool:
    """Tell if CTest may find tests in a build folder; files that it includes may have some."""
    waiting = [build]
    while waiting:
        folder = waiting.pop()
        text = text_or_nothing(folder / "CTestTestfile.cmake", _LARGEST)
        if _TESTS.search(text):
            return True
        waiting += [folder / name for name in _SUBFOLDER.findall(text)]
    return False


def requirements_of_tests(source: Path) -> frozenset[str]:
    """Return the distributions that a Python package's tests are said to need, names normalised.

    From tests_require and the extras for tests in setup.py, setup.cfg and pyproject.toml, and from
    dependency groups. What is no literal in setup.py stays unknown.
    """
    names = (
        dependency.name
        for facts in _facts(source)
        for dependency in facts.dependencies
        if Kind.TEST in dependency.kinds
    )
    return frozenset(re.sub(r"[-_.]+", "-", name).lower() for name in names)


def _facts(source: Path) -> Iterator[PythonFacts]:
    """Yield what each of a package's files says; one that cannot be read says nothing."""
    with suppress(SyntaxError, ValueError, RecursionError):
        yield read_setup_py(text_or_nothing(source / "setup.py")) or PythonFacts()
    yield read_setup_cfg(text_or_nothing(source / "setup.cfg"))
    with suppress(WorkspaceError):
        table = read_toml(text_or_nothing(source / "pyproject.toml"), source / "pyproject.toml")
        groups = table.get("dependency-groups", {})
        yield read_pyproject(table) or PythonFacts()
        yield read_pyproject({"project": {"optional-dependencies": groups}}) or PythonFacts()


def _configuration(build: Path) -> str:
    """Return the configuration that CTest is asked for: that of the cache, else Release, as colcon has it."""
    match = _BUILD_TYPE.search(text_or_nothing(build / "CMakeCache.txt", _LARGEST))
    known = {"Debug", "MinSizeRel", "RelWithDebInfo"}
    return match[1] if match and match[1] in known else "Release"
