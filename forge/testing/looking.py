"""What a package and its build folder say about its tests; nothing of the package is run to know."""

from __future__ import annotations

import ast
import configparser
import re
import sys
from typing import TYPE_CHECKING, Any

from forge.testing.recipes import Look
from forge.tools import CMAKE_TYPES

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from forge.model import Package

_TEST_EXTRAS = ("test", "tests", "testing")
_BUILD_TYPE = re.compile(r"^CMAKE_BUILD_TYPE:[^=]*=(.*)$", re.MULTILINE)
_SUBFOLDER = re.compile(r'^\s*subdirs\("?([^")]+)"?\)', re.MULTILINE)
_TESTS = re.compile(r"^\s*(add_test|include)\(", re.MULTILINE)
_DISTRIBUTION = re.compile(r"\s*([A-Za-z0-9][A-Za-z0-9._-]*)")


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
        text = _text(folder / "CTestTestfile.cmake")
        if _TESTS.search(text):
            return True
        waiting += [folder / name for name in _SUBFOLDER.findall(text)]
    return False


def requirements_of_tests(source: Path) -> frozenset[str]:
    """Return the distributions that a Python package's tests are said to need, names normalised.

    From tests_require and the extras for tests in setup.py, setup.cfg and pyproject.toml, and from
    dependency groups. What is no literal in setup.py stays unknown.
    """
    words = [*_of_setup_py(source), *_of_setup_cfg(source), *_of_pyproject(source)]
    found = filter(None, map(_DISTRIBUTION.match, words))
    return frozenset(re.sub(r"[-_.]+", "-", match[1]).lower() for match in found)


def _configuration(build: Path) -> str:
    """Return the configuration that CTest is asked for: that of the cache, else Release, as colcon has it."""
    match = _BUILD_TYPE.search(_text(build / "CMakeCache.txt"))
    known = {"Debug", "MinSizeRel", "RelWithDebInfo"}
    return match[1] if match and match[1] in known else "Release"


def _of_setup_py(source: Path) -> Iterator[str]:
    try:
        tree = ast.parse(_text(source / "setup.py"))
    except (SyntaxError, ValueError):
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and _called(node) == "setup":
            given = {keyword.arg: _literal(keyword.value) for keyword in node.keywords}
            yield from _words(given.get("tests_require"))
            yield from _of_extras(given.get("extras_require"))


def _of_setup_cfg(source: Path) -> Iterator[str]:
    config = configparser.ConfigParser(interpolation=None)
    try:
        config.read_string(_text(source / "setup.cfg"))
    except configparser.Error:
        return
    yield from _words(config.get("options", "tests_require", fallback=""))
    for extra in _TEST_EXTRAS:
        yield from _words(config.get("options.extras_require", extra, fallback=""))


def _of_pyproject(source: Path) -> Iterator[str]:
    text = _text(source / "pyproject.toml")
    if not text:
        return
    if sys.version_info >= (3, 11):
        import tomllib  # noqa: PLC0415
    else:
        import tomli as tomllib  # noqa: PLC0415
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return
    for extras in (table.get("project", {}).get("optional-dependencies"), table.get("dependency-groups")):
        yield from _of_extras(extras)


def _of_extras(extras: Any) -> Iterator[str]:  # noqa: ANN401  (as written by the user)
    if isinstance(extras, dict):
        for extra in _TEST_EXTRAS:
            yield from _words(extras.get(extra))


def _words(value: Any) -> Iterable[str]:  # noqa: ANN401  (as written by the user)
    """Return requirements, which setuptools takes as a list or as lines."""
    if isinstance(value, str):
        return re.split(r"[\n;]", value)
    return [word for word in value if isinstance(word, str)] if isinstance(value, list | tuple) else ()


def _called(node: ast.Call) -> str:
    return node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")


def _literal(node: ast.expr) -> object:
    try:
        return ast.literal_eval(node)
    except ValueError:
        return None


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
