"""Read the install manifests in build folders, and remove files before a task."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from typing import TYPE_CHECKING

from forge.base.files import listed_paths

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from forge.base.layout import Layout
    from forge.build.tasks import Task

MANIFESTS = ("install_manifest.txt", "symlink_install_manifest.txt")
"""The files in which CMake, ament and forge list installed files."""


class ListedFiles(Mapping[str, tuple[str, ...]]):
    """The files in install manifests by package; manifests are read on demand."""

    def __init__(self, layout: Layout) -> None:
        """Store the layout of the build folders."""
        self._layout = layout

    def __getitem__(self, name: str) -> tuple[str, ...]:
        """Return the absolute paths listed for a package; raises KeyError without a build folder."""
        build = self._layout.build_dir(name)
        if not build.is_dir():
            raise KeyError(name)
        return tuple(listed_files(build))

    def __iter__(self) -> Iterator[str]:
        """Yield the packages that have a build folder."""
        build = self._layout.build
        return (path.name for path in (build.iterdir() if build.is_dir() else ()) if path.is_dir())

    def __len__(self) -> int:
        """Return the number of build folders."""
        return sum(1 for _ in self)


def clean_paths(task: Task) -> None:
    """Remove the files in `task.clean`; names may be glob patterns."""
    for path in task.clean:
        for found in path.parent.glob(path.name) if path.parent.is_dir() else ():
            if found.is_dir() and not found.is_symlink():
                shutil.rmtree(found)
            else:
                found.unlink()


def listed_files(build: Path) -> Iterator[str]:
    """Yield the absolute paths in the install manifests of a build folder; duplicates are possible."""
    for name in MANIFESTS:
        yield from listed_paths(build / name)
