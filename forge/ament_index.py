"""The ament resource index: share/ament_index/resource_index/TYPE/NAME below each prefix.

Prefixes come first to last in the order in which they win, as in AMENT_PREFIX_PATH.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

INDEX = Path("share/ament_index/resource_index")


def prefixes(variables: Mapping[str, str]) -> tuple[Path, ...]:
    """Return the prefixes that the environment's AMENT_PREFIX_PATH names and that exist."""
    paths = variables.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    # Unlike Path.is_dir, os.path.isdir says no to a folder that others may not enter.
    return tuple(Path(path) for path in dict.fromkeys(paths) if os.path.isdir(path))  # noqa: PTH112


def resources(kind: str, where: Iterable[Path]) -> dict[str, Path]:
    """Return each resource of a kind with the prefix that holds it; the first prefix wins."""
    found: dict[str, Path] = {}
    for prefix in where:
        folder = prefix / INDEX / kind
        if folder.is_dir():
            for entry in sorted(folder.iterdir()):
                if not entry.name.startswith(".") and entry.is_file():
                    found.setdefault(entry.name, prefix)
    return found


def prefix_of(package: str, where: Iterable[Path]) -> Path | None:
    """Return the first prefix with a marker of the package, or None."""
    return next((prefix for prefix in where if (prefix / INDEX / "packages" / package).is_file()), None)


def content(kind: str, name: str, prefix: Path) -> str:
    """Return the text of a resource; raises OSError when it is not there."""
    return (prefix / INDEX / kind / name).read_text(encoding="utf-8")
