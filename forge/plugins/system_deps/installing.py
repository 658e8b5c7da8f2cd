"""The commands that install system packages."""

from __future__ import annotations

import shlex
import subprocess
from typing import TYPE_CHECKING

from forge.base.errors import HostError, Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from forge.plugins.system_deps.dependencies import DependencyStatus

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

_WITHOUT_QUESTIONS = {"apt": ("-y",), "dnf": ("-y",), "zypper": ("-y",), "pacman": ("--noconfirm",)}
_UPDATES = {"apt": "sudo apt-get update", "pacman": "sudo pacman -Sy", "apk": "sudo apk update"}
"""Commands without which a new machine or container finds no packages."""


def install_commands(
    needs: Iterable[DependencyStatus],
    have: frozenset[tuple[str, str]],
    python: str,
    *,
    elevate: bool,
    ask: bool,
) -> tuple[dict[str, tuple[str, ...]], dict[str, list[str]]]:
    """Return, by package manager, the install command, and the names that have to be installed by hand.

    `have` contains (package manager, name) of installed packages; `elevate` adds sudo, `ask=False` prevents
    questions.
    """
    commands: dict[str, tuple[str, ...]] = {}
    manual: dict[str, list[str]] = {}
    missing = {(need.manager, name) for need in needs for name in need.names if need.manager} - have
    for manager, name in sorted(missing):
        # A name that looks like an option would be taken as one.
        if manager not in _COMMANDS or name.startswith("-"):
            manual.setdefault(manager, []).append(name)
            continue
        if manager not in commands:
            argv = [word.format(python=python) for word in _COMMANDS[manager] if elevate or word != _SUDO]
            commands[manager] = (*argv, *(() if ask else _WITHOUT_QUESTIONS.get(manager, ())))
        commands[manager] += (name,)
    return commands, manual


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
