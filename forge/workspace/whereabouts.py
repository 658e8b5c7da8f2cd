"""Tells where a missing package may be: in an earlier build, a submodule, or another workspace."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from typing import TYPE_CHECKING

from forge.base.files import text_or_nothing
from forge.base.frozen import frozen

if TYPE_CHECKING:
    from pathlib import Path

    from forge.base.layout import Layout

_FEW = 3
_SUBMODULE = re.compile(r"^[ \t]*path[ \t]*=[ \t]*(\S.*?)[ \t]*$", re.MULTILINE)


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
        for path in _SUBMODULE.findall(text_or_nothing(file)):
            folder = file.parent / path
            with suppress(OSError):
                if any(folder.iterdir()):
                    continue
            if folder != file.parent and folder.is_relative_to(root):
                found.append(folder.relative_to(root))
    return found
