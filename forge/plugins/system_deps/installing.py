"""The commands that install system packages."""

from __future__ import annotations

import shlex
import subprocess
from typing import TYPE_CHECKING

from forge.base.errors import HostError, Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from forge.plugins.system_deps.outstanding import DependencyStatus

_SUDO = "sudo"
_COMMANDS: Mapping[str, tuple[str, ...]] = {
    "apt": (_SUDO, "apt-get", "install"),
    "dnf": (_SUDO, "dnf", "install"),
    "pip": ("{python}", "-m", "pip", "install"),
    "gem": (_SUDO, "gem", "install"),
    "npm": (_SUDO, "npm", "install", "-g"),
    "snap": (_SUDO, "snap", "install"),
    "pacman": (_SUDO, "pacman", "-S"),
    "apk": (_SUDO, "apk", "add"),
    "zypper": (_SUDO, "zypper", "install"),
    "portage": (_SUDO, "emerge"),
}
"""The install command of each package manager."""

_WITHOUT_QUESTIONS = {"apt": "-y", "dnf": "-y", "zypper": "-y", "pacman": "--noconfirm"}
_UPDATES = {"apt": "sudo apt-get update", "pacman": "sudo pacman -Sy", "apk": "sudo apk update"}
"""Commands without which a new machine or container finds no packages."""


def install_commands(
    needs: Iterable[DependencyStatus],
    have: frozenset[tuple[str, str]],
    python: str,
    *,
    elevate: bool,
    ask: bool,
) -> dict[str, tuple[str, ...]]:
    """Return the install command by package manager; `elevate` adds sudo, `ask=False` prevents questions.

    `have` contains (package manager, name) of installed packages.
    """
    commands = {}
    for manager, wanted in _wanted(needs, have).items():
        names = [name for name in wanted if _is_fit(manager, name)]
        if names:
            argv = [word.format(python=python) for word in _COMMANDS[manager] if elevate or word != _SUDO]
            if not ask and manager in _WITHOUT_QUESTIONS:
                argv.append(_WITHOUT_QUESTIONS[manager])
            commands[manager] = (*argv, *names)
    return commands


def manual_names(needs: Iterable[DependencyStatus], have: frozenset[tuple[str, str]]) -> dict[str, list[str]]:
    """Return the names by package manager for which there is no command."""
    wanted = _wanted(needs, have)
    others = {
        manager: [name for name in names if not _is_fit(manager, name)] for manager, names in wanted.items()
    }
    return {manager: names for manager, names in others.items() if names}


def run_commands(commands: Mapping[str, tuple[str, ...]]) -> None:
    """Run the commands one after the other; raises HostError for the first that fails."""
    for manager, argv in commands.items():
        try:
            code = subprocess.run(argv, check=False).returncode
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise HostError(Problem(f"cannot run '{argv[0]}': {reason}")) from None
        if code:
            update = _UPDATES.get(manager)
            hint = f"if it found no such packages, update its lists: {update}" if update else None
            raise HostError(Problem(f"'{shlex.join(argv)}' failed with exit code {code}", hint=hint))


def _wanted(needs: Iterable[DependencyStatus], have: frozenset[tuple[str, str]]) -> dict[str, list[str]]:
    """Return the sorted names by package manager that are not installed."""
    pairs = {(need.manager, name) for need in needs for name in need.names if need.manager} - have
    wanted: dict[str, list[str]] = {}
    for manager, name in sorted(pairs):
        wanted.setdefault(manager, []).append(name)
    return wanted


def _is_fit(manager: str, name: str) -> bool:
    """Tell whether a command installs the name; one that looks like an option would be taken as such."""
    return manager in _COMMANDS and not name.startswith("-")
