"""Reads rosdep's databases on this machine and looks up keys such as 'python3-numpy' in them (REP 111).

A database maps a key to operating systems, and these to rules. A rule is a list of names, or names by package
manager, or either of these by version of the system, where '*' matches all others.

Nothing is downloaded. rosdep's cache is pickled; only plain values are loaded from it, no objects.
"""

from __future__ import annotations

import hashlib
import os
import pickle
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forge.base.errors import Location, Problem, WorkspaceError
from forge.base.files import text_or_nothing
from forge.base.formats import read_yaml
from forge.base.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from forge.plugins.system_deps.system import System

    Database = Mapping[str, Any]

SOURCES = Path("/etc/ros/rosdep/sources.list.d")


@frozen
class Resolved:
    """The packages of a key; without names nothing has to be installed."""

    manager: str
    names: tuple[str, ...]


def read_databases(files: Iterable[str]) -> list[dict[str, Any]]:
    """Return the databases in the given files; raises WorkspaceError for unreadable ones."""
    return [_read(Path(file).expanduser()) for file in files]


def known_databases(system: System, rosdistro: str, variables: Mapping[str, str]) -> Iterator[dict[str, Any]]:
    """Yield the databases that rosdep would use, in its order, if they are available locally.

    Lists of sources name local files, or URLs for which rosdep's cache is used. The data that the last
    `rosdep update` added for ROS distributions comes last.
    """
    tags = {rosdistro, system.name, system.version}
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


def resolve(key: str, databases: Sequence[Database], system: System) -> Resolved | None:
    """Return the packages of a key for a system; None if it is unknown or has no package.

    The first database with a rule for the key and the system wins; rules for all systems, '*', come last.
    """
    rules = [rules for database in databases if isinstance(rules := database.get(key), dict)]
    anywhere = next((each["*"] for each in rules if isinstance(each.get("*"), dict)), None)
    rule = next((each[system.name] for each in rules if system.name in each), anywhere)
    rule, manager = _by_manager(rule, system)
    if manager is None and isinstance(rule, dict):
        versions = {str(version): part for version, part in rule.items()}
        rule, manager = _by_manager(versions.get(system.version, versions.get("*")), system)
        if versions.get(system.version, "") is None:
            return None
    names = _names(rule)
    return None if names is None else Resolved(manager or system.manager, names)


def covers(databases: Iterable[Database], system: System) -> bool:
    """Tell whether any database has a rule for the system."""
    every = (rules for database in databases for rules in database.values())
    return any(isinstance(rules, dict) and system.name in rules for rules in every)


def has_ros_packages(databases: Iterable[Database]) -> bool:
    """Tell whether a database is that of a ROS distribution, which `rosdep update` marks."""
    every = (rules for database in databases for rules in database.values())
    return any(isinstance(rules, dict) and "_is_ros" in rules for rules in every)


def _by_manager(rule: object, system: System) -> tuple[object, str | None]:
    """Return the part of a rule for the first matching package manager, and its name; else the rule."""
    if isinstance(rule, dict):
        for manager in system.managers:
            if manager in rule:
                return rule[manager], usual_manager(manager)
    return rule, None


def usual_manager(manager: str) -> str:
    """Return the current name of a package manager."""
    return "dnf" if manager == "yum" else manager


def _names(rule: object) -> tuple[str, ...] | None:
    match rule:
        case {"packages": packages}:
            return _names(packages)
        case dict():
            return ()
        case str():
            return tuple(rule.split())
        case list():
            return tuple(map(str, rule))
        case _:
            return None


def _sources(variables: Mapping[str, str]) -> Iterator[tuple[str, tuple[str, ...]]]:
    folders = variables.get("ROSDEP_SOURCE_PATH", str(SOURCES)).split(os.pathsep)
    for folder in map(Path, folders):
        for file in sorted(folder.glob("*.list")):
            yield from _listed(file)


def _listed(file: Path) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield URL and tags of each line 'yaml URL TAG ...'."""
    for line in text_or_nothing(file).splitlines():
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
    except Exception:
        return {}
    return value if isinstance(value, dict) else {}


class _Plain(pickle.Unpickler):
    """Unpickles mappings, lists, strings and numbers; rejects anything that needs imports."""

    def find_class(self, module: str, name: str) -> Any:
        raise pickle.UnpicklingError(f"{module}.{name} is not a plain value")


def _read(path: Path) -> dict[str, Any]:
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        message = f"cannot read the rosdep file: {(error.strerror or str(error)).lower()}"
        raise WorkspaceError(Problem(message, Location(path))) from None
    except UnicodeDecodeError:
        raise WorkspaceError(Problem("the rosdep file is not valid UTF-8", Location(path))) from None
    return read_yaml(text, path)


def _quietly(path: Path) -> dict[str, Any]:
    try:
        return _read(path)
    except WorkspaceError:
        return {}
