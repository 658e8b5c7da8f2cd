"""Tells from CMake files whether packages enable C++."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.files import text_or_nothing
from forge.toolchain.programs import PROJECT_DETAILS, compiled_packages
from forge.workspace.cmake_text import calls, cmake_files

if TYPE_CHECKING:
    from collections.abc import Iterable

    from forge.workspace.cmake_text import Call
    from forge.workspace.model import Package

_ENABLING = frozenset({"enable_language", "project"})
_WITHOUT_CXX = frozenset({"ASM", "C", "Fortran", "NONE", "OPTIONAL"})
"""Languages that need no C++ compiler, and words beside them. Any other word may also be a variable."""


def any_enables_cxx(packages: Iterable[Package]) -> bool:
    """Tell whether one of the packages may enable C++ in any of its CMake files."""
    for package in compiled_packages(packages):
        top = text_or_nothing(package.path / "CMakeLists.txt")
        has_project = any(call.command in _ENABLING for call in calls(top))
        if not has_project or any(map(enables_cxx, map(text_or_nothing, cmake_files(package.path)))):
            return True
    return False


def enables_cxx(text: str) -> bool:
    """Tell whether a CMake file may enable C++, as project() does unless it lists other languages."""
    return any(_names_cxx(call) for call in calls(text) if call.command in _ENABLING)


def _names_cxx(call: Call) -> bool:
    words = [word for word in call.words if word != "LANGUAGES"]
    if call.command == "project":
        details = {at + 1 for at, word in enumerate(words) if word in PROJECT_DETAILS}
        words = [
            word for at, word in enumerate(words) if at and at not in details and word not in PROJECT_DETAILS
        ]
    return not words or not _WITHOUT_CXX.issuperset(words)
