"""The ament resource index: share/ament_index/resource_index/TYPE/NAME below each prefix.

Prefixes are ordered by decreasing priority, as in AMENT_PREFIX_PATH.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

INDEX = Path("share/ament_index/resource_index")


def prefixes(variables: Mapping[str, str]) -> tuple[Path, ...]:
    """Return the existing prefixes in AMENT_PREFIX_PATH."""
    paths = variables.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    # Unlike Path.is_dir, os.path.isdir returns False for inaccessible folders.
    return tuple(Path(path) for path in dict.fromkeys(paths) if os.path.isdir(path))  # noqa: PTH112


def resources(kind: str, where: Iterable[Path]) -> dict[str, Path]:
    """Return each resource of a type with its prefix; the first prefix wins."""
    prefix_of_name: dict[str, Path] = {}
    for prefix in where:
        folder = prefix / INDEX / kind
        if folder.is_dir():
            for entry in sorted(folder.iterdir()):
                if not entry.name.startswith(".") and entry.is_file():
                    prefix_of_name.setdefault(entry.name, prefix)
    return prefix_of_name


def prefix_of(package: str, where: Iterable[Path]) -> Path | None:
    """Return the first prefix that contains the package, or None."""
    return next((prefix for prefix in where if (prefix / INDEX / "packages" / package).is_file()), None)


def content(kind: str, name: str, prefix: Path) -> str:
    """Return the content of a resource; raises OSError if it is missing."""
    return (prefix / INDEX / kind / name).read_text(encoding="utf-8")
