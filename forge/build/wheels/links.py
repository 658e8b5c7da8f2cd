"""Replace installed files of a wheel by symlinks to their source files."""

from __future__ import annotations

import filecmp
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.workspace.source_names import is_environment, is_source_folder

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

_SKIPPED_DIRS = frozenset({"__pycache__", "build", "dist"})
_COPYING = re.compile(r"^(?:hard linking|copying(?: and adjusting)?) (.+?) -> (.+)$", re.MULTILINE)
"""setuptools' messages about copies; the target is a folder, unless the file name changes."""
_MAX_COPY_CHAIN = 8
"""The maximum number of consecutive copies between a source and a file of the wheel."""


@frozen
class Wheel:
    """A built and installed wheel.

    `source` is the package's folder, `build` its build folder; `schemes` maps the wheel's schemes to the
    folders where they were installed; `output` is the backend's output.
    """

    source: Path
    build: Path
    schemes: Mapping[str, str]
    output: str


def link_to_sources(wheel: Wheel, installed: Iterable[Path]) -> None:
    """Replace each installed file by a symlink to the source file that it was copied from.

    If the backend does not report the source and several files match, the copy is kept.
    """
    sources: dict[str, list[Path]] = {}
    for path in _source_files(wheel.source):
        sources.setdefault(path.name, []).append(path)
    copies = _copies(wheel)
    for path in installed:
        candidates = [
            source_file
            for source_file in sources.get(path.name, ())
            if filecmp.cmp(source_file, path, shallow=False)
        ]
        original = _original(path, candidates, copies, wheel)
        if original is not None:
            path.unlink()
            path.symlink_to(original)


def _original(path: Path, candidates: list[Path], copies: Mapping[Path, Path], wheel: Wheel) -> Path | None:
    """Return the source of a file among the `candidates` with the same name and content, or None."""
    if path in copies:
        return copies[path] if copies[path] in candidates else None
    if len(candidates) > 1:
        site = Path(wheel.schemes["purelib"])
        below = path.relative_to(site).parts if path.is_relative_to(site) else ()
        candidates = [
            source_file for source_file in candidates if below and source_file.parts[-len(below) :] == below
        ]
    return candidates[0] if len(candidates) == 1 and not path.parent.name.endswith(".dist-info") else None


def _copies(wheel: Wheel) -> dict[Path, Path]:
    """Return the original source of each installed file that the backend reported to have copied."""
    made: dict[str, str] = {}
    for source, target in _COPYING.findall(wheel.output):
        if " -> " not in target:
            whole = os.path.normpath(wheel.source / source)
            made[os.path.normpath(wheel.source / target / os.path.basename(whole))] = whole  # noqa: PTH119
    found = {}
    for target in made:
        installed = _installed(target, wheel)
        if installed is not None:
            found[installed] = Path(_first(target, made))
    return found


def _first(path: str, made: Mapping[str, str]) -> str:
    for _ in range(_MAX_COPY_CHAIN):
        if path not in made:
            break
        path = made[path]
    return path


def _installed(path: str, wheel: Wheel) -> Path | None:
    """Return the installed path of a file in the wheel's staging folder, or None."""
    base = re.escape(str(wheel.build / "build"))
    match = re.match(rf"{base}/bdist\.[^/]+/wheel/(?:[^/]+\.data/(\w+)/)?(.+)", path)
    if match is None or (match[1] or "purelib") not in wheel.schemes:
        return None
    return Path(os.path.normpath(f"{wheel.schemes[match[1] or 'purelib']}/{match[2]}"))


def _source_files(source: Path) -> Iterator[Path]:
    for folder, names, files in os.walk(source):
        beside = {*names, *files}
        if folder != str(source) and is_environment(beside.__contains__):
            names.clear()
            continue
        names[:] = sorted(
            n
            for n in names
            if n not in _SKIPPED_DIRS
            and not n.startswith(".")
            and not n.endswith(".egg-info")
            and is_source_folder(n, beside.__contains__)
        )
        yield from (Path(folder) / name for name in sorted(files))
