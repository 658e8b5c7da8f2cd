"""Finds dependencies that are not provided, with their users and system packages."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.doctor.system_deps.rosdep import resolve
from forge.workspace.model import DependencyKind
from forge.workspace.resolve import is_ros_name

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from forge.doctor.system_deps.rosdep import Database
    from forge.doctor.system_deps.system import System
    from forge.workspace.model import Package

USUAL_KINDS = frozenset(DependencyKind) - {DependencyKind.DOC}
"""The default dependency types, as in rosdep."""

COMMANDS: Mapping[str, str] = {
    "apt": "sudo apt-get install",
    "dnf": "sudo dnf install",
    "pip": "{python} -m pip install",
    "gem": "sudo gem install",
    "npm": "sudo npm install -g",
    "snap": "sudo snap install",
    "pacman": "sudo pacman -S",
    "apk": "sudo apk add",
    "zypper": "sudo zypper install",
    "portage": "sudo emerge",
}
"""The install command of each package manager."""


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
    databases: Sequence[Database],
    system: System,
) -> tuple[DependencyStatus, ...]:
    """Return all dependencies of the packages of one of `kinds`, by name."""
    users: dict[str, list[str]] = {}
    for package in packages:
        for name in dict.fromkeys(package.manifest.names(kinds)):
            users.setdefault(name, []).append(package.name)
    return tuple(_need(key, sorted(users[key]), provider(key), databases, system) for key in sorted(users))


def _need(
    key: str, users: list[str], provided: str | None, databases: Sequence[Database], system: System
) -> DependencyStatus:
    found = None if provided else resolve(key, databases, system)
    if provided or found is None:
        return DependencyStatus(key, tuple(users), provided, ros=not provided and is_ros_name(key))
    return DependencyStatus(key, tuple(users), None, found.manager, found.names)


def command_lines(
    needs: Iterable[DependencyStatus], have: frozenset[tuple[str, str]], python: str
) -> Iterator[str]:
    """Yield a quoted install command for each package manager.

    `have` contains (package manager, name) of installed packages.
    """
    import shlex  # noqa: PLC0415  (rarely needed)

    wanted: dict[str, dict[str, None]] = {}
    for need in needs:
        for name in need.names:
            if need.manager and (need.manager, name) not in have:
                wanted.setdefault(need.manager, {})[name] = None
    for manager in sorted(wanted):
        command = COMMANDS.get(manager)
        # Ignore names that look like options.
        names = sorted(name for name in wanted[manager] if command and not name.startswith("-"))
        others = sorted(wanted[manager].keys() - set(names))
        if command and names:
            yield f"{command.format(python=shlex.quote(python))} {' '.join(map(shlex.quote, names))}"
        if others:
            yield f"# install manually ({manager}): {' '.join(others)}"
