"""Collects the context of a failure for hints."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from forge.base.files import text_or_nothing
from forge.build.inputs.fingerprints import own_files
from forge.output.failure_hints import FailureContext
from forge.workspace.cmake_metadata import targets
from forge.workspace.discovery import discover_embedded

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.workspace.model import Package


def failure_context(package: Package, packages: Mapping[str, Package], python: str) -> FailureContext:
    """Return the context of a failed package; unreadable files are left out."""
    folder = str(package.path)
    try:
        files = tuple(os.path.relpath(path, folder) for path, _ in own_files(folder))
    except OSError:
        files = ()
    text = text_or_nothing(package.path / "CMakeLists.txt")
    return FailureContext(package, {**discover_embedded(), **packages}, python, files, targets(text))
