"""Which source file each file of a wheel is a copy of, and links instead of copies."""

from __future__ import annotations

import filecmp
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

_LITTER = frozenset({"__pycache__", "build", "dist"})
_COPYING = re.compile(r"^(?:hard linking|copying(?: and adjusting)?) (.+?) -> (.+)$", re.MULTILINE)
"""How setuptools says each copy that it makes; of the target it names the folder, unless the name changes."""
_MOST_COPIES = 8
"""Copies in a row that are followed from a file of the wheel to its source."""


@frozen
class Wheel:
    """Where a wheel came from and went to.

    `source` is the package's folder, `build` the one where it was put together; `schemes` are the folders in
    which its parts were installed, by wheel's names for them; `said` is what the backend printed.
    """

    source: Path
    build: Path
    schemes: Mapping[str, str]
    said: str


def link_to_sources(wheel: Wheel, installed: Iterable[Path]) -> None:
    """Replace each installed file by a link to the source file that it is a copy of.

    Where the backend does not say which one that is, and several would do, the copy stays.
    """
    sources: dict[str, list[Path]] = {}
    for path in _source_files(wheel.source):
        sources.setdefault(path.name, []).append(path)
    copies = _copies(wheel)
    for path in installed:
        alike = [one for one in sources.get(path.name, ()) if filecmp.cmp(one, path, shallow=False)]
        original = _original(path, alike, copies, wheel)
        if original is not None:
            path.unlink()
            path.symlink_to(original)


def _original(path: Path, alike: list[Path], copies: Mapping[Path, Path], wheel: Wheel) -> Path | None:
    """Return which of the source files of the same name and content a file is a copy of, if that is known."""
    if path in copies:
        return copies[path] if copies[path] in alike else None
    if len(alike) > 1:
        site = Path(wheel.schemes["purelib"])
        below = path.relative_to(site).parts if path.is_relative_to(site) else ()
        alike = [one for one in alike if below and one.parts[-len(below) :] == below]
    return alike[0] if len(alike) == 1 and not path.parent.name.endswith(".dist-info") else None


def _copies(wheel: Wheel) -> dict[Path, Path]:
    """Return the first source of each installed file of which the backend says that it copied it."""
    made: dict[str, str] = {}
    for source, target in _COPYING.findall(wheel.said):
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
    for _ in range(_MOST_COPIES):
        if path not in made:
            break
        path = made[path]
    return path


def _installed(path: str, wheel: Wheel) -> Path | None:
    """Return where a file was installed that was put into the folder of the wheel's contents."""
    base = re.escape(str(wheel.build / "build"))
    match = re.match(rf"{base}/bdist\.[^/]+/wheel/(?:[^/]+\.data/(\w+)/)?(.+)", path)
    if match is None or (match[1] or "purelib") not in wheel.schemes:
        return None
    return Path(os.path.normpath(f"{wheel.schemes[match[1] or 'purelib']}/{match[2]}"))


def _source_files(source: Path) -> Iterator[Path]:
    for folder, names, files in os.walk(source):
        names[:] = sorted(
            n for n in names if n not in _LITTER and not n.startswith(".") and not n.endswith(".egg-info")
        )
        yield from (Path(folder) / name for name in sorted(files))
