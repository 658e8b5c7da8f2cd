"""What packages need and nobody in reach has: by name, by user, and as package managers call it; pure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.frozen import frozen
from forge.model import Kind
from forge.provision import is_ros_name
from forge.rosdep import resolve

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from forge.model import Package
    from forge.rosdep import Database, System

USUAL_KINDS = frozenset(Kind) - {Kind.DOC}
"""What counts where nobody says which dependencies are meant, as for rosdep."""

COMMANDS: Mapping[str, str] = {
    "apt": "sudo apt-get install",
    "dnf": "sudo dnf install",
    "pip": "{python} -m pip install",
    "gem": "sudo gem install",
    "npm": "sudo npm install -g",
    "snap": "sudo snap install",
    "pacman": "sudo pacman -S",
    "apk": "sudo apk add",
}
"""How each package manager is asked for packages."""


@frozen
class Need:
    """A name that packages of the workspace depend on.

    `provider` says who in reach has it: a prefix or the workspace; None when nobody. Otherwise `manager` has
    it as `names`; without a manager nobody knows it. `ros` tells that it is a package of ROS by its name.
    """

    key: str
    users: tuple[str, ...]
    provider: str | None = None
    manager: str | None = None
    names: tuple[str, ...] = ()
    ros: bool = False


def needs_of(
    packages: Iterable[Package],
    kinds: frozenset[Kind],
    provider: Callable[[str], str | None],
    database: Database,
    system: System,
) -> tuple[Need, ...]:
    """Return everything that the packages depend on in one of `kinds`, by name."""
    users: dict[str, list[str]] = {}
    for package in packages:
        for name in dict.fromkeys(package.manifest.names(kinds)):
            users.setdefault(name, []).append(package.name)
    return tuple(_need(key, sorted(users[key]), provider(key), database, system) for key in sorted(users))


def _need(key: str, users: list[str], provided: str | None, database: Database, system: System) -> Need:
    found = None if provided else resolve(key, database, system)
    if provided or found is None:
        return Need(key, tuple(users), provided, ros=not provided and is_ros_name(key))
    return Need(key, tuple(users), None, found.manager, found.names)


def command_lines(needs: Iterable[Need], have: frozenset[tuple[str, str]], python: str) -> Iterator[str]:
    """Yield a line for each package manager that installs what is not there yet, quoted for a shell.

    `have` are (package manager, name) of what is installed.
    """
    import shlex  # noqa: PLC0415  (no other command writes lines for a shell from here)

    wanted: dict[str, dict[str, None]] = {}
    for need in needs:
        for name in need.names:
            if need.manager and (need.manager, name) not in have:
                wanted.setdefault(need.manager, {})[name] = None
    for manager in sorted(wanted):
        command = COMMANDS.get(manager)
        # What looks like an option is no name.
        names = sorted(name for name in wanted[manager] if command and not name.startswith("-"))
        others = sorted(wanted[manager].keys() - set(names))
        if command and names:
            yield f"{command.format(python=shlex.quote(python))} {' '.join(map(shlex.quote, names))}"
        if others:
            yield f"# by hand, as {manager}: {' '.join(others)}"
