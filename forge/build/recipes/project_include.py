"""The file that CMake includes at the end of project(), by which packages are built faster; pure."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from forge.base.frozen import Pairs


def cache_entries(folder: Path) -> Pairs:
    """Return the CMake variable that includes the file in forge's folder of a build folder."""
    return (("CMAKE_PROJECT_INCLUDE", str(_include(folder))),)


def files(folder: Path, parts: tuple[tuple[Path, str], ...]) -> tuple[tuple[Path, str], ...]:
    """Return the file and its `parts`, to be written into that folder; it includes those for CMake."""
    from forge.base.templating import render

    included = [path.name for path, _ in parts if path.suffix == ".cmake"]
    return (_include(folder), render("cmake/project.cmake.j2", parts=included)), *parts


def _include(folder: Path) -> Path:
    return folder / "project.cmake"
