"""Packages that were built and are no longer in the workspace."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.errors import Problem
from forge.base.layout import IGNORE_MARK
from forge.base.text import listed

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from forge.base.layout import Layout
    from forge.build.model import BuildRecord
    from forge.workspace.model import Package


def stale_package_warnings(
    records: Mapping[str, BuildRecord], packages: Mapping[str, Package], layout: Layout, root: Path
) -> Iterator[Problem]:
    """Yield a problem for packages removed from the workspace whose installed files may still be found.

    `packages` are the discovered ones. A package that was merely not discovered, for example because of
    '--base-paths', is not removed: its folder exists, is not ignored, and contains no other package.
    """
    missing = {
        name: record
        for name, record in records.items()
        if name not in packages and record.complete and record.source
    }
    taken = {str(root / package.path) for package in packages.values()} if missing else set()
    gone = sorted(
        name
        for name, record in missing.items()
        if record.source in taken or is_removed_package(Path(record.source))
    )
    if gone:
        verb, possessive = ("is", "its") if len(gone) == 1 else ("are", "their")
        message = f"{listed(gone)} {verb} no longer in the workspace, but {possessive} files are still in"
        hint = "remove them: forge clean stale"
        yield Problem(f"{message} '{layout.install}', where other packages may find them", hint=hint)


def is_removed_package(source: Path) -> bool:
    """Return True if a folder no longer contains a package, or is ignored."""
    if not (source / "package.xml").is_file():
        return not (source / "CMakeLists.txt").is_file() and not (source / "setup.py").is_file()
    return any(
        (folder / marker).exists()
        for folder in (source, *source.parents)
        for marker in (IGNORE_MARK, "AMENT_IGNORE")
    )
