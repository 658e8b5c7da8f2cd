"""Finds the languages that a project enables in its CMake files, which are read as text."""

from __future__ import annotations

from collections.abc import Iterable

from forge.base.files import text_or_nothing
from forge.workspace.cmake_text import calls, cmake_files
from forge.workspace.model import CMAKE_TYPES, Package

_BEFORE_PROJECT = frozenset({"cmake_minimum_required", "cmake_policy", "message", "set"})
PROJECT_DETAILS = frozenset({"COMPAT_VERSION", "DESCRIPTION", "HOMEPAGE_URL", "SPDX_LICENSE", "VERSION"})
_ENABLING = frozenset({"enable_language", "project"})
_WITHOUT_CXX = frozenset({"ASM", "C", "Fortran", "NONE", "OPTIONAL"})
"""Languages that need no C++ compiler, and other keywords of project(). Any other word may be a variable."""


def compiled_packages(packages: Iterable[Package]) -> list[Package]:
    """Return the packages whose project() enables a language, that is, unless it specifies NONE."""
    compiled = []
    for package in packages:
        text = _project_text(package) if package.build_type in CMAKE_TYPES else ""
        project = next((call for call in calls(text) if call.command == "project"), None)
        if text and (project is None or "NONE" not in project.words):
            compiled.append(package)
    return compiled


def any_enables_cxx(packages: Iterable[Package]) -> bool:
    """Return whether one of the packages may enable C++ in any of its CMake files."""
    for package in compiled_packages(packages):
        has_project = any(call.command in _ENABLING for call in calls(_project_text(package)))
        if not has_project or any(map(enables_cxx, map(text_or_nothing, cmake_files(package.path)))):
            return True
    return False


def enables_cxx(text: str) -> bool:
    """Return whether a CMake file may enable C++, as project() does unless it lists other languages."""
    for call in calls(text):
        words = [word for word in call.words if word != "LANGUAGES"]
        if call.command == "project":
            details = [at for at, word in enumerate(words) if word in PROJECT_DETAILS]
            words = [word for at, word in enumerate(words) if at and not {at, at - 1} & {*details}]
        if call.command in _ENABLING and (not words or not _WITHOUT_CXX.issuperset(words)):
            return True
    return False


def _project_text(package: Package) -> str:
    return text_or_nothing(package.path / "CMakeLists.txt")


def certainly_compiles(text: str) -> bool:
    """Return whether project() enables C or C++, and no command before it may choose a compiler."""
    for call in calls(text):
        if call.command == "project" and not call.conditions:
            following = call.words[1] if call.words[1:] else "VERSION"
            named = not {"C", "CXX"}.isdisjoint(call.words)
            return named or (following in PROJECT_DETAILS and "LANGUAGES" not in call.words)
        if call.command not in _BEFORE_PROJECT or "COMPILER" in str(call.words):
            return False
    return False
