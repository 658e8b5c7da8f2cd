"""Tells where a missing package may be: in an earlier build, a submodule, or another workspace."""

from __future__ import annotations

import configparser
import os
from typing import TYPE_CHECKING

from forge.base.files import text_or_nothing
from forge.base.frozen import frozen

if TYPE_CHECKING:
    from pathlib import Path

    from forge.base.layout import Layout

_FEW = 3


@frozen
class Whereabouts:
    """Looks for packages around a workspace."""

    root: Path
    layout: Layout

    def of(self, name: str) -> str | None:
        """Return what to do about a package that is in no known prefix, or None if nothing is known of it."""
        if self._holds(self.layout.install, name):
            return (
                f"'{name}' was in the workspace in an earlier build: add it again, or rename or remove the "
                "dependency; 'forge clean stale' removes its files"
            )
        if empty := unchecked_submodules(self.root):
            fitting = [path for path in empty if path.name == name] or empty
            return submodule_remedy(fitting)
        try:
            beside = sorted(path / "install" for path in self.root.parent.iterdir() if path != self.root)
        except OSError:
            beside = []
        other = next((install for install in beside if self._holds(install, name)), None)
        return f"source the workspace that contains it: . {other}/setup.sh" if other else None

    @staticmethod
    def _holds(install: Path, name: str) -> bool:
        # Unlike Path.is_dir, os.path.isdir returns False for inaccessible folders.
        return any(os.path.isdir(prefix / "share" / name) for prefix in (install / name, install))  # noqa: PTH112


def submodule_remedy(paths: list[Path]) -> str:
    words = " ".join(map(str, paths[:_FEW])) if len(paths) <= _FEW else "--recursive"
    which = f"submodule '{paths[0]}' is" if len(paths) == 1 else f"{len(paths)} submodules are"
    return f"the {which} not checked out: git submodule update --init {words}"


def unchecked_submodules(root: Path) -> list[Path]:
    """Return the submodules of the repositories in a workspace whose folders are empty, relative to it."""
    found = []
    patterns = (".gitmodules", "*/.gitmodules", "*/*/.gitmodules")
    for file in (file for pattern in patterns for file in sorted(root.glob(pattern))):
        parser = configparser.RawConfigParser(strict=False)
        try:
            parser.read_string("\n".join(line.strip() for line in text_or_nothing(file).splitlines()))
        except configparser.Error:
            continue
        for section in parser.sections():
            folder = file.parent / parser[section].get("path", ".")
            if folder != file.parent and folder.is_relative_to(root) and not _has_entries(folder):
                found.append(folder.relative_to(root))
    return found


def _has_entries(folder: Path) -> bool:
    try:
        return any(folder.iterdir())
    except OSError:
        return False
