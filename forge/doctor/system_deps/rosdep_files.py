"""Reads rosdep's databases on this machine: given files, its sources, and its cache.

Nothing is downloaded. rosdep's cache is pickled; only plain values are loaded from it, no objects.
"""

from __future__ import annotations

import hashlib
import os
import pickle
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forge.base.errors import Place, Problem, WorkspaceError
from forge.base.formats import read_yaml

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from forge.doctor.system_deps.rosdep import System

SOURCES = Path("/etc/ros/rosdep/sources.list.d")
OS_RELEASE = (Path("/etc/os-release"), Path("/usr/lib/os-release"))


def read_databases(files: Iterable[str]) -> list[dict[str, Any]]:
    """Return the databases in the given files; raises WorkspaceError for unreadable ones."""
    return [_read(Path(file).expanduser()) for file in files]


def known_databases(system: System, variables: Mapping[str, str]) -> Iterator[dict[str, Any]]:
    """Yield the databases that rosdep would use, in its order, if they are available locally.

    Lists of sources name local files, or URLs for which rosdep's cache is used. The data that the last
    `rosdep update` added for ROS distributions comes last.
    """
    tags = {variables.get("ROS_DISTRO", ""), system.name, system.version}
    home = Path(variables.get("ROS_HOME") or "~/.ros").expanduser() / "rosdep" / "sources.cache"
    seen = set()
    for url, wanted in (*_sources(variables), *_listed(home / "index")):
        if url in seen or not tags.issuperset(wanted):
            continue
        seen.add(url)
        local = Path(url.removeprefix("file://"))
        database = _quietly(local) if url.startswith("file://") else _cached(home, url)
        if database:
            yield database


def os_release(files: Iterable[Path] = OS_RELEASE) -> dict[str, str]:
    """Return the unquoted fields of os-release; empty without such a file."""
    for file in files:
        try:
            lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            continue
        pairs = (line.partition("=") for line in lines if "=" in line and not line.startswith("#"))
        return {name.strip(): value.strip().strip("\"'") for name, _, value in pairs}
    return {}


def _sources(variables: Mapping[str, str]) -> Iterator[tuple[str, tuple[str, ...]]]:
    folders = variables.get("ROSDEP_SOURCE_PATH", str(SOURCES)).split(os.pathsep)
    for folder in map(Path, folders):
        for file in sorted(folder.glob("*.list")):
            yield from _listed(file)


def _listed(file: Path) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield URL and tags of each line 'yaml URL TAG ...'."""
    try:
        lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return
    for line in lines:
        words = line.split()
        if words[:1] == ["yaml"] and words[1:]:
            yield words[1], tuple(words[2:])


def _cached(home: Path, url: str) -> dict[str, Any]:
    """Return rosdep's cached copy of a database; empty if there is no readable one."""
    name = hashlib.sha1(url.encode()).hexdigest()  # noqa: S324  (rosdep's name for the file)
    try:
        with (home / f"{name}.pickle").open("rb") as stream:
            value = _Plain(stream).load()
    except OSError:
        return _quietly(home / name)
    except Exception:  # noqa: BLE001  (corrupt pickles raise arbitrary exceptions)
        return {}
    return value if isinstance(value, dict) else {}


class _Plain(pickle.Unpickler):
    """Unpickles mappings, lists, strings and numbers; rejects anything that needs imports."""

    def find_class(self, module: str, name: str) -> Any:  # noqa: ANN401  (as in the standard library)
        raise pickle.UnpicklingError(f"{module}.{name} is not a plain value")


def _read(path: Path) -> dict[str, Any]:
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        message = f"cannot read the rosdep file: {(error.strerror or str(error)).lower()}"
        raise WorkspaceError(Problem(message, Place(path))) from None
    except UnicodeDecodeError:
        raise WorkspaceError(Problem("the rosdep file is not valid UTF-8", Place(path))) from None
    return read_yaml(text, path)


def _quietly(path: Path) -> dict[str, Any]:
    try:
        return _read(path)
    except WorkspaceError:
        return {}
