"""Build folders as tools leave them: what they list as installed, and how they are cleared."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from typing import TYPE_CHECKING

from forge.files import listed_paths

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from forge.layout import Layout
    from forge.model import Task

MANIFESTS = ("install_manifest.txt", "symlink_install_manifest.txt")
"""Where CMake, ament and forge itself list what they installed."""


class ListedFiles(Mapping[str, tuple[str, ...]]):
    """What tools list as installed, by package; a build folder is looked at when it is asked for."""

    def __init__(self, layout: Layout) -> None:
        """Remember where the build folders are."""
        self._layout = layout

    def __getitem__(self, name: str) -> tuple[str, ...]:
        """Return the absolute paths that are listed for a package; raises KeyError without a build folder."""
        build = self._layout.build_dir(name)
        if not build.is_dir():
            raise KeyError(name)
        return tuple(listed_files(build))

    def __iter__(self) -> Iterator[str]:
        """Go through the packages that have one."""
        build = self._layout.build
        return (path.name for path in (build.iterdir() if build.is_dir() else ()) if path.is_dir())

    def __len__(self) -> int:
        """Count them."""
        return sum(1 for _ in self)


def clear(task: Task) -> None:
    """Remove what the task wants to be gone before it runs; names may be patterns."""
    for path in task.clean:
        for found in path.parent.glob(path.name) if path.parent.is_dir() else ():
            if found.is_dir() and not found.is_symlink():
                shutil.rmtree(found)
            else:
                found.unlink()


def listed_files(build: Path) -> Iterator[str]:
    """Yield the absolute paths that the tools list in a build folder as installed, once or more."""
    for name in MANIFESTS:
        yield from listed_paths(build / name)
