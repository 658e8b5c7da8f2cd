"""What stands around a failure, for hints: the package's files and targets, and all that can be built."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from forge.cmake_reading import targets
from forge.digests import own_files
from forge.discovery import discover_embedded
from forge.files import text_or_nothing
from forge.hints import Scene

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.model import Package


def scene_of(package: Package, packages: Mapping[str, Package], python: str) -> Scene:
    """Return what hints ask about; what cannot be read is not there."""
    folder = str(package.path)
    try:
        files = tuple(os.path.relpath(path, folder) for path, _ in own_files(folder))
    except OSError:
        files = ()
    text = text_or_nothing(package.path / "CMakeLists.txt")
    return Scene(package, {**discover_embedded(), **packages}, python, files, targets(text))
