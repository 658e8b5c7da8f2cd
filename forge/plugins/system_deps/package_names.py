"""Looks up the system packages of dependencies: in rosdep's data, else by the names of ROS distributions."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from forge.base.errors import Problem
from forge.base.frozen import frozen
from forge.base.names import did_you_mean
from forge.plugins.system_deps import rosdep_library
from forge.plugins.system_deps.rosdep import Resolved, covers, has_ros_packages, known_databases, resolve
from forge.workspace.resolve import resembles_ros_name

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from forge.plugins.system_deps.rosdep import Database
    from forge.plugins.system_deps.system import System

_SURE = 0.7
_DISTRIBUTIONS = (
    *("ardent", "bouncy", "crystal", "dashing", "eloquent", "foxy", "galactic", "humble", "iron", "jazzy"),
    *("kilted", "rolling"),
)
"""The distributions of ROS 2 (REP 2000); later ones are unknown here."""
_PACKAGED = frozenset({"apt", "dnf"})
"""Package managers for which ROS distributions publish packages."""


@frozen
class PackageNames:
    """A lookup of the packages of a key, and what is known about the system and the ROS distribution."""

    resolve: Callable[[str], Resolved | None]
    has_data: bool
    covers_system: bool
    lists_ros_packages: bool


def mistyped_distribution(name: str) -> Iterator[Problem]:
    """Yield a warning if a name only resembles that of a distribution of ROS 2."""
    hint = None if name in _DISTRIBUTIONS else did_you_mean(name, _DISTRIBUTIONS, _SURE)
    if hint:
        yield Problem(f"unknown ROS distribution '{name}'", hint=hint)


def find_package_names(
    files: Sequence[Database], system: System, rosdistro: str, variables: Mapping[str, str]
) -> PackageNames:
    """Return the lookup in the given databases and in rosdep's, by rosdep itself where it is installed.

    Without data of the ROS distribution, packages whose names resemble ROS packages are named like rosdep
    would: 'ros-humble-nav2-msgs'.
    """
    look_up: Callable[[str], Resolved | None]
    if rosdep_library.is_installed():
        databases = (*files, *rosdep_library.cached_databases(system, rosdistro))
        look_up = rosdep_library.resolver(databases, system)
    else:
        databases = (*files, *known_databases(system, rosdistro, variables))
        look_up = partial(resolve, databases=databases, system=system)
    listed = has_ros_packages(databases)

    def find(key: str) -> Resolved | None:
        found = look_up(key)
        if found or listed or not rosdistro or system.manager not in _PACKAGED:
            return found
        name = f"ros-{rosdistro}-{key.replace('_', '-')}"
        return Resolved(system.manager, (name,)) if resembles_ros_name(key) else None

    return PackageNames(find, bool(databases), covers(databases, system), listed)
