"""Replace installed files of a Python package by symlinks to their source files."""

from __future__ import annotations

import filecmp
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.build.inputs.fingerprints import source_files

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

_COPYING = re.compile(r"^(?:hard linking|copying(?: and adjusting)?) (.+?) -> (.+)$", re.MULTILINE)
"""setuptools' messages about copies; the target is a folder, unless the file name changes."""
_MAX_COPY_CHAIN = 8
"""The maximum number of consecutive copies between a source and a file of the package."""


@frozen
class Installed:
    """Where a package was installed from, and to; `output` is the backend's output."""

    source: Path
    prefix: Path
    site: Path
    output: str


def link_to_sources(package: Installed, installed: Iterable[Path]) -> None:
    """Replace each installed file by a symlink to the source file that it was copied from.

    If the backend does not report the source and several files match, the copy is kept.
    """
    sources: dict[str, list[Path]] = {}
    for path in map(Path, source_files(str(package.source))):
        sources.setdefault(path.name, []).append(path)
    made: dict[str, str] = {}
    for source, target in _COPYING.findall(package.output):
        if " -> " not in target:
            whole = os.path.normpath(package.source / source)
            made[os.path.normpath(package.source / target / os.path.basename(whole))] = whole  # noqa: PTH119
    start = f"{package.prefix}{os.sep}"
    copies = {Path(target): Path(_first(target, made)) for target in made if target.startswith(start)}
    for path in installed:
        if path.is_symlink():
            continue
        candidates = [
            source_file
            for source_file in sources.get(path.name, ())
            if source_file.is_file()
            # setuptools makes scripts executable that are not so in the sources.
            and os.access(source_file, os.X_OK) >= os.access(path, os.X_OK)
            and filecmp.cmp(source_file, path, shallow=False)
        ]
        original = _original(path, candidates, copies, package)
        if original is not None:
            path.unlink()
            path.symlink_to(original)


def _original(
    path: Path, candidates: list[Path], copies: Mapping[Path, Path], package: Installed
) -> Path | None:
    """Return the source of a file among the `candidates` with the same name and content, or None."""
    if path in copies:
        return copies[path] if copies[path] in candidates else None
    if len(candidates) > 1 and path.is_relative_to(package.site):
        # A copy elsewhere, such as in build/lib, is a source as well.
        below = path.relative_to(package.site)
        usual = {package.source / below, package.source / "src" / below}
        candidates = [source_file for source_file in candidates if source_file in usual]
    is_metadata = path.parent.suffix in {".dist-info", ".egg-info"}
    return candidates[0] if len(candidates) == 1 and not is_metadata else None


def _first(path: str, made: Mapping[str, str]) -> str:
    for _ in range(_MAX_COPY_CHAIN):
        if path not in made:
            break
        path = made[path]
    return path
