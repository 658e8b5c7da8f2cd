"""Dependencies of the workspace: who needs and who provides them; the lines of `forge deps`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.workspace.model import DependencyKind
from forge.workspace.resolve import is_ros_name

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from forge.workspace.model import Package

USUAL_KINDS = frozenset(DependencyKind) - {DependencyKind.DOC}
"""The default dependency types, as in rosdep."""


@frozen
class Resolved:
    """The packages of a key; without names nothing has to be installed."""

    manager: str
    names: tuple[str, ...]


@frozen
class DependencyStatus:
    """A dependency of packages in the workspace.

    `provider` is the prefix or workspace that provides it, None without one. Otherwise `manager` provides it
    as `names`; without a manager it is unknown. `ros` tells whether the name is that of a ROS package.
    """

    key: str
    users: tuple[str, ...]
    provider: str | None = None
    manager: str | None = None
    names: tuple[str, ...] = ()
    ros: bool = False


def needs_of(
    packages: Iterable[Package],
    kinds: frozenset[DependencyKind],
    provider: Callable[[str], str | None],
    resolve: Callable[[str], Resolved | None],
) -> tuple[DependencyStatus, ...]:
    """Return all dependencies of the packages of one of `kinds`, by name."""
    users: dict[str, list[str]] = {}
    for package in packages:
        for name in dict.fromkeys(package.manifest.names(kinds)):
            users.setdefault(name, []).append(package.name)
    return tuple(_need(key, sorted(users[key]), provider(key), resolve) for key in sorted(users))


def _need(
    key: str, users: list[str], provided: str | None, resolve: Callable[[str], Resolved | None]
) -> DependencyStatus:
    found = None if provided else resolve(key)
    if provided or found is None:
        return DependencyStatus(key, tuple(users), provided, ros=not provided and is_ros_name(key))
    return DependencyStatus(key, tuple(users), None, found.manager, found.names)


def is_installed(need: DependencyStatus, have: frozenset[tuple[str, str]]) -> bool:
    """Tell whether all packages of a dependency are in `have`, which contains (package manager, name)."""
    return need.manager is not None and all((need.manager, name) in have for name in need.names)
