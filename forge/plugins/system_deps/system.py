"""The operating system with its name in rosdep, its installed packages, and its install commands."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path

from forge.base.errors import HostError, Problem, reason_of
from forge.base.files import text_or_nothing
from forge.base.frozen import frozen
from forge.plugins.system_deps.lookup import DependencyStatus
from forge.toolchain.python_modules import DEBIAN, RED_HAT, families

DPKG_STATUS = Path("/var/lib/dpkg/status")

_OTHER_FAMILIES = ("alpine", "arch", "gentoo", "opensuse")
"""Names in rosdep's files that also cover derived systems."""

_PARAGRAPH = re.compile(r"^(Package|Status|Provides): (.*)$", re.MULTILINE)
_PIP = r"""import importlib.metadata as m, re, sys
have = {re.sub("[-_.]+", "-", d.metadata["Name"] or "").lower() for d in m.distributions()}
plain = lambda name: re.sub("[-_.]+", "-", re.split("[<>=!~ ]", name)[0]).lower()
print(*(name for name in sys.argv[1:] if plain(name) in have), sep="\n")
"""


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
"""Commands that update the package lists, which a new machine or container lacks."""


@frozen
class System:
    """An operating system: its name and version as in rosdep's files.

    `manager` is the package manager that ROS distributions publish packages for, empty if there is none.
    """

    name: str
    version: str
    manager: str


def system_of(fields: Mapping[str, str], override: str | None = None) -> System:
    """Return the system described by /etc/os-release, or NAME:VERSION if given."""
    name, version = fields.get("ID", "linux").lower(), fields.get("VERSION_ID", "")
    ids = families(fields)
    if override:
        name, _, version = override.lower().partition(":")
        ids = (name,)
    elif not DEBIAN.isdisjoint(ids):
        codename = fields.get("UBUNTU_CODENAME") or fields.get("VERSION_CODENAME")
        version = codename or version
        # rosdep's files use codenames for versions of Ubuntu and Debian.
        name = name if name in {"debian", "ubuntu"} else "ubuntu" if "UBUNTU_CODENAME" in fields else "debian"
    elif not RED_HAT.isdisjoint(ids) and name not in {"fedora", "openeuler"}:
        name, version = "rhel", version.partition(".")[0]
    else:
        name = next((family for family in _OTHER_FAMILIES if family in ids), name)
    manager = "apt" if not DEBIAN.isdisjoint(ids) else "dnf" if not RED_HAT.isdisjoint(ids) else ""
    return System(name, version, manager)


def installed_names(manager: str, names: Collection[str], python: str) -> frozenset[str]:
    """Return the names that are installed according to a package manager; empty if it is unknown."""
    if manager == "apt":
        return frozenset(names) & _in_dpkg(DPKG_STATUS)
    if manager in {"dnf", "zypper"} and shutil.which("rpm"):
        results = {name: _run("rpm", "-q", "--whatprovides", name) for name in names}
        return frozenset(name for name, result in results.items() if result.returncode == 0)
    if manager == "pip":
        return frozenset(_run(python, "-c", _PIP, *names).stdout.splitlines()) & frozenset(names)
    return frozenset()


def _in_dpkg(status: Path) -> frozenset[str]:
    """Return the packages installed with dpkg, and what they provide."""
    packages: set[str] = set()
    for paragraph in text_or_nothing(status).split("\n\n"):
        fields = dict(_PARAGRAPH.findall(paragraph))
        if fields.get("Status", "").endswith(" installed"):
            provided = (word.split()[0] for word in fields.get("Provides", "").split(",") if word.strip())
            packages.update((fields["Package"], *provided))
    return frozenset(packages)


def _run(*argv: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(argv, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)


def install_commands(
    needs: Iterable[DependencyStatus],
    installed: frozenset[tuple[str, str]],
    python: str,
    *,
    elevate: bool,
    ask: bool,
) -> tuple[dict[str, tuple[str, ...]], dict[str, list[str]]]:
    """Return, by package manager, the install command, and the names that have to be installed by hand.

    `installed` contains (package manager, name) of installed packages; `elevate` adds sudo, `ask=False`
    prevents questions.
    """
    commands: dict[str, tuple[str, ...]] = {}
    manual: dict[str, list[str]] = {}
    missing = {(need.manager, name) for need in needs for name in need.names if need.manager} - installed
    for manager, name in sorted(missing):
        # A name that looks like an option would be parsed as one.
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
            raise HostError(Problem(f"cannot run '{argv[0]}': {reason_of(error)}")) from None
        if code:
            update = _UPDATES.get(manager)
            hint = f"if it found no such packages, update its lists: {update}" if update else None
            raise HostError(Problem(f"'{shlex.join(argv)}' failed with exit code {code}", hint=hint))
