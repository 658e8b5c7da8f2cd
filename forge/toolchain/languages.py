"""Tells from CMake files whether packages enable C++."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.files import text_or_nothing
from forge.toolchain.programs import compiled_packages

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from forge.workspace.model import Package

_COMMENT = re.compile(r"#\[\[.*?\]\]|#[^\n]*", re.DOTALL)
_CALL = re.compile(r"\b(project|enable_language)\s*\(([^()]*)", re.IGNORECASE)
_DETAIL = re.compile(
    r'\b(?:COMPAT_VERSION|DESCRIPTION|HOMEPAGE_URL|SPDX_LICENSE|VERSION)\s+("[^"]*"|[^\s"]+)'
)
_WITHOUT_CXX = frozenset({"ASM", "C", "Fortran", "NONE", "OPTIONAL"})
"""Languages that need no C++ compiler, and words beside them. Any other word may also be a variable."""


def any_enables_cxx(packages: Iterable[Package]) -> bool:
    """Tell whether one of the packages may enable C++ in any of its CMake files."""
    return any(map(_may_enable_cxx, compiled_packages(packages)))


def enables_cxx(text: str) -> bool:
    """Tell whether a CMake file may enable C++, as project() does unless it lists other languages."""
    return any(_names_cxx(*match.groups()) for match in _CALL.finditer(_COMMENT.sub("", text)))


def _names_cxx(command: str, arguments: str) -> bool:
    words = _DETAIL.sub("", arguments).split()
    if command.lower() == "project":
        words = [word for word in words[1:] if word != "LANGUAGES"]
    return not words or not _WITHOUT_CXX.issuperset(words)


def _may_enable_cxx(package: Package) -> bool:
    top = text_or_nothing(package.path / "CMakeLists.txt")
    return not _CALL.search(top) or any(map(enables_cxx, map(text_or_nothing, _cmake_files(package.path))))


def _cmake_files(package: Path) -> Iterator[Path]:
    for folder, _, names in os.walk(package):
        for name in names:
            if name == "CMakeLists.txt" or name.endswith(".cmake"):
                yield Path(folder, name)
