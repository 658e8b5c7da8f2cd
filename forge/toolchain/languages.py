"""Tells from CMake files whether packages enable C++."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.files import text_or_nothing
from forge.toolchain.programs import compiled_packages
from forge.workspace.cmake_text import calls

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from forge.workspace.cmake_text import Call
    from forge.workspace.model import Package

_ENABLING = frozenset({"enable_language", "project"})
_DETAILS = frozenset({"COMPAT_VERSION", "DESCRIPTION", "HOMEPAGE_URL", "SPDX_LICENSE", "VERSION"})
_WITHOUT_CXX = frozenset({"ASM", "C", "Fortran", "NONE", "OPTIONAL"})
"""Languages that need no C++ compiler, and words beside them. Any other word may also be a variable."""


def any_enables_cxx(packages: Iterable[Package]) -> bool:
    """Tell whether one of the packages may enable C++ in any of its CMake files."""
    return any(map(_may_enable_cxx, compiled_packages(packages)))


def enables_cxx(text: str) -> bool:
    """Tell whether a CMake file may enable C++, as project() does unless it lists other languages."""
    return any(_names_cxx(call) for call in calls(text) if call.command in _ENABLING)


def _names_cxx(call: Call) -> bool:
    words = [word for word in call.words if word != "LANGUAGES"]
    if call.command == "project":
        details = {at + 1 for at, word in enumerate(words) if word in _DETAILS}
        words = [word for at, word in enumerate(words) if at and at not in details and word not in _DETAILS]
    return not words or not _WITHOUT_CXX.issuperset(words)


def _may_enable_cxx(package: Package) -> bool:
    top = text_or_nothing(package.path / "CMakeLists.txt")
    has_project = any(call.command in _ENABLING for call in calls(top))
    return not has_project or any(map(enables_cxx, map(text_or_nothing, _cmake_files(package.path))))


def _cmake_files(package: Path) -> Iterator[Path]:
    for folder, _, names in os.walk(package):
        for name in names:
            if name == "CMakeLists.txt" or name.endswith(".cmake"):
                yield Path(folder, name)
