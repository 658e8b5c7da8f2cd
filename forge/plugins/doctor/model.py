"""The subject of checks, a workspace with its files and environment, and their results."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import field
from functools import lru_cache
from pathlib import Path

from forge.base.errors import Problem
from forge.base.files import read_text
from forge.base.frozen import frozen
from forge.base.layout import Layout
from forge.build.inputs.fingerprints import own_files
from forge.environment.prefixes import Underlays
from forge.workspace.model import Package
from forge.workspace.resolve import DependencyResolution

Files = tuple[tuple[str, os.stat_result], ...]
"""Relative paths below a package's folder, with their stats."""

_LARGEST = 1 << 20


@frozen
class CheckContext:
    """The workspace under examination; without one, `packages` is empty and `resolution` is None.

    `variables` is the environment of a build, `surroundings` that of the shell. `packages` are the selected
    ones.
    """

    root: Path
    layout: Layout
    variables: Mapping[str, str]
    surroundings: Mapping[str, str]
    python: str | None = None
    underlays: Underlays = Underlays()
    packages: Mapping[str, Package] = field(default_factory=dict)
    resolution: DependencyResolution | None = None
    files: Mapping[str, Files] = field(default_factory=dict)

    def text(self, package: Package, name: str) -> str:
        """Return the text of a package's file, '' if it is missing or very large."""
        return _text(self.root / package.path / name)

    def texts(self, package: Package, *endings: str) -> Iterator[tuple[str, str]]:
        """Yield name and text of a package's files with these suffixes, top-level ones first."""
        names = [name for name, _ in self.files.get(package.name, ()) if name.endswith(endings)]
        for name in sorted(names, key=lambda name: (name.count("/"), name)):
            yield name, self.text(package, name)


@frozen
class CheckResult:
    """The result of the checks of one topic.

    `errors` prevent builds, `warnings` may cause trouble, `notes` are informational.
    """

    topic: str
    summary: str
    errors: tuple[Problem, ...] = ()
    warnings: tuple[Problem, ...] = ()
    notes: tuple[Problem, ...] = ()


def graded(topic: str, summary: str, problems: tuple[Problem, ...], *, serious: bool) -> CheckResult:
    """Return a result whose problems are errors if they are serious, else warnings."""
    return CheckResult(topic, summary, problems if serious else (), () if serious else problems)


def files_of(root: Path, package: Package) -> Files:
    """Return the source files of a package; empty if the folder is unreadable."""
    folder = str(root / package.path)
    try:
        return tuple((os.path.relpath(path, folder), status) for path, status in own_files(folder))
    except OSError:
        return ()


@lru_cache(maxsize=4096)
def _text(path: Path) -> str:
    try:
        return "" if path.stat().st_size > _LARGEST else read_text(path)
    except OSError:
        return ""
