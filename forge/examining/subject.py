"""What is examined: a workspace as a build would see it, its files with their stats, and the environment."""

from __future__ import annotations

import os
from dataclasses import field
from functools import lru_cache
from typing import TYPE_CHECKING

from forge.digests import own_files
from forge.files import read_text
from forge.frozen import frozen
from forge.prefixes import Underlays

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from forge.layout import Layout
    from forge.model import Package
    from forge.provision import Provision

Files = tuple[tuple[str, os.stat_result], ...]
"""Paths below a package's folder, with '/' between parts, and what they look like."""

_LARGEST = 1 << 20


@frozen
class Subject:
    """A workspace as it is examined; without one, `packages` are none and `provision` is None.

    `variables` are those of a build, `surroundings` those of the shell. `packages` are the selected ones.
    """

    root: Path
    layout: Layout
    variables: Mapping[str, str]
    surroundings: Mapping[str, str]
    python: str | None = None
    underlays: Underlays = Underlays()
    packages: Mapping[str, Package] = field(default_factory=dict)
    provision: Provision | None = None
    files: Mapping[str, Files] = field(default_factory=dict)

    def text(self, package: Package, name: str) -> str:
        """Return the text of a package's file; nothing if it is not there, or is very large."""
        return _text(self.root / package.path / name)

    def texts(self, package: Package, *endings: str) -> Iterator[tuple[str, str]]:
        """Yield name and text of a package's files that end so, those in its own folder first."""
        for name, _ in sorted(
            self.files.get(package.name, ()), key=lambda pair: (pair[0].count("/"), pair[0])
        ):
            if name.endswith(endings):
                yield name, self.text(package, name)


def files_of(root: Path, package: Package) -> Files:
    """Return the files of a package as a build counts them; none where the folder cannot be read."""
    folder = str(root / package.path)
    try:
        return tuple((os.path.relpath(path, folder), status) for path, status in own_files(folder))
    except OSError:
        return ()


@lru_cache(maxsize=4096)
def _text(path: Path) -> str:
    try:
        if path.stat().st_size > _LARGEST:
            return ""
        return read_text(path)
    except OSError:
        return ""
