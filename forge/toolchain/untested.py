"""Tells which packages are built without their tests, by CMake's variable BUILD_TESTING."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge.base.cmake_syntax import definitions
from forge.base.files import text_or_nothing
from forge.toolchain.programs import CMAKE_TYPES

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from forge.workspace.model import Package

VARIABLE = "BUILD_TESTING"
_FALSE = re.compile(r"(0|OFF|NO|FALSE|N|IGNORE|(.*-)?NOTFOUND)?", re.IGNORECASE)
_CACHED = re.compile(rf"^{VARIABLE}:\w+=(.*)$", re.MULTILINE)


def is_defined(arguments: Sequence[str]) -> bool:
    """Tell whether CMake's arguments decide whether tests are built."""
    return any(name == VARIABLE for name, _ in definitions(arguments))


def builds_tests(package: Package, cmake_args: Sequence[str], ament_cmake_args: Sequence[str]) -> bool | None:
    """Tell whether CMake's arguments, for all packages and its own, turn the tests of a package on or off.

    Returns None if they do not set the variable. Packages that are not built by CMake follow the arguments
    for all packages.
    """
    words = [*cmake_args]
    if package.build_type in CMAKE_TYPES:
        words += package.option_values("cmake-args")
    if package.build_type == "ament_cmake":
        words += (*ament_cmake_args, *package.option_values("ament-cmake-args"))
    values = [value for name, value in definitions(words) if name == VARIABLE]
    return _FALSE.fullmatch(values[-1]) is None if values else None


def was_built_without_tests(build_dir: Path) -> bool:
    """Tell whether the last build of a CMake package left out its tests."""
    match = _CACHED.search(text_or_nothing(build_dir / "CMakeCache.txt"))
    return match is not None and _FALSE.fullmatch(match[1].strip()) is not None
