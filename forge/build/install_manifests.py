"""Find the files that earlier builds installed, and remove files before a task."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING

from forge.base.files import BYTECODE, delete_tree, listed_paths
from forge.base.layout import LAYOUT_MARKER

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from forge.base.layout import Layout
    from forge.build.tasks import Task

MANIFESTS = ("install_manifest.txt", "symlink_install_manifest.txt")
"""The files in which CMake, ament and forge list installed files."""


class ManifestFiles(Mapping[str, tuple[str, ...]]):
    """The files in install manifests by package; manifests are read on demand."""

    def __init__(self, layout: Layout, links: Mapping[str, tuple[str, ...]] | None = None) -> None:
        """Store the layout of the build folders, and installed links by package that no record lists."""
        self._layout = layout
        self._links = links or {}

    def __getitem__(self, name: str) -> tuple[str, ...]:
        """Return the absolute paths known for a package; raises KeyError without a build folder and links."""
        build = self._layout.build_dir(name)
        links = self._links.get(name, ())
        if not links and not build.is_dir():
            raise KeyError(name)
        return (*listed_files(build), *links)

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
                delete_tree(found)
            else:
                found.unlink()


def listed_files(build: Path) -> Iterator[str]:
    """Yield the absolute paths in the install manifests of a build folder; duplicates are possible."""
    for name in MANIFESTS:
        yield from listed_paths(build / name)


def without_other_installs(paths: Iterable[str], install: Path) -> Iterator[str]:
    """Yield listed paths, except those in the install folder of another workspace or build.

    A copied build folder lists the files of the original workspace.
    """
    base, own = f"{install}/", {str(install): True, "/": True}

    def is_own(folder: str) -> bool:
        if folder not in own:
            if os.path.lexists(f"{folder}/{LAYOUT_MARKER}"):
                own[folder] = install.is_dir() and os.path.samefile(folder, install)
            else:
                own[folder] = is_own(os.path.dirname(folder))
        return own[folder]

    for path in paths:
        if path.startswith(base) or is_own(os.path.dirname(path)):
            yield path


def installed_links(prefix: Path, homes: Mapping[str, str]) -> dict[str, tuple[str, ...]]:
    """Return the links below a merged prefix into the folders of packages, by package.

    `homes` maps source and build folders to package names; a link belongs to the innermost. `cmake --install`
    does not list a link that exists already, so that without a record nothing else names its package.
    """
    found: dict[str, list[str]] = {}
    for path in _links_below(str(prefix)):
        folder = os.readlink(path)
        while folder not in homes and folder != (parent := os.path.dirname(folder)):
            folder = parent
        if folder in homes:
            found.setdefault(homes[folder], []).append(path)
    return {name: tuple(paths) for name, paths in found.items()}


def _links_below(root: str) -> Iterator[str]:
    """Yield the links below a folder, which may be missing."""
    waiting = [root]
    while waiting:
        try:
            entries: Iterable[os.DirEntry[str]] = list(os.scandir(waiting.pop()))
        except (FileNotFoundError, NotADirectoryError):
            continue
        for entry in entries:
            if entry.is_symlink():
                yield entry.path
            elif entry.is_dir() and entry.name != BYTECODE:
                waiting.append(entry.path)
