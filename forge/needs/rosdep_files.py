"""Where rosdep's databases are on this machine: files by name, its sources, and what it has downloaded.

Nothing is fetched. What rosdep keeps is pickled; here only plain values are taken from it, no objects.
"""

from __future__ import annotations

import hashlib
import os
import pickle
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forge.errors import Place, Problem, WorkspaceError
from forge.formats import read_yaml

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from forge.needs.rosdep import System

SOURCES = Path("/etc/ros/rosdep/sources.list.d")
OS_RELEASE = (Path("/etc/os-release"), Path("/usr/lib/os-release"))


def read_databases(files: Iterable[str]) -> list[dict[str, Any]]:
    """Return the databases in files that were named; raises WorkspaceError for what cannot be read."""
    return [_read(Path(file).expanduser()) for file in files]


def known_databases(system: System, variables: Mapping[str, str]) -> Iterator[dict[str, Any]]:
    """Yield the databases that rosdep would use here, in its order, as far as they are on this disk.

    Lists of sources name files; for what they name on the network there is rosdep's own copy. What the
    last `rosdep update` added for distributions of ROS comes last.
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
    """Return the fields of os-release, quotes taken off; none where there is no such file."""
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
    """Yield address and tags of each line 'yaml ADDRESS TAG ...'."""
    try:
        lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return
    for line in lines:
        words = line.split()
        if words[:1] == ["yaml"] and words[1:]:
            yield words[1], tuple(words[2:])


def _cached(home: Path, url: str) -> dict[str, Any]:
    """Return rosdep's copy of a database; an empty one where there is none that can be read."""
    name = hashlib.sha1(url.encode()).hexdigest()  # noqa: S324  (rosdep's name for the file)
    try:
        with (home / f"{name}.pickle").open("rb") as stream:
            value = _Plain(stream).load()
    except OSError:
        return _quietly(home / name)
    except Exception:  # noqa: BLE001  (what a spoilt pickle raises is not written down anywhere)
        return {}
    return value if isinstance(value, dict) else {}


class _Plain(pickle.Unpickler):
    """Reads mappings, lists, texts and numbers; refuses whatever would import or call something."""

    def find_class(self, module: str, name: str) -> Any:  # noqa: ANN401  (as in the standard library)
        raise pickle.UnpicklingError(f"{module}.{name} is no plain value")


def _read(path: Path) -> dict[str, Any]:
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        message = f"cannot read the rosdep file: {(error.strerror or str(error)).lower()}"
        raise WorkspaceError(Problem(message, Place(path))) from None
    except UnicodeDecodeError:
        raise WorkspaceError(Problem("the rosdep file is no UTF-8", Place(path))) from None
    return read_yaml(text, path)


def _quietly(path: Path) -> dict[str, Any]:
    try:
        return _read(path)
    except WorkspaceError:
        return {}
