"""Resolves rosdep keys such as 'python3-numpy' to packages of a package manager (REP 111).

A database maps a key to operating systems, and these to rules. A rule is a list of names, or names by package
manager, or either of these by version of the system, where '*' matches all others. Of several databases the
first with a rule for the key and system wins.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from forge.base.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    Database = Mapping[str, Any]

_APT = ("apt", "pip", "gem", "npm", "source")
_DNF = ("pip", "dnf", "yum", "source")
_DEBIAN = frozenset({"debian", "ubuntu", "linuxmint", "pop", "raspbian", "zorin", "elementary"})
_RED_HAT = frozenset({"fedora", "rhel", "centos", "rocky", "almalinux", "ol", "openeuler", "amzn"})


@frozen
class System:
    """An operating system: its name and version as in rosdep's files, and its package manager."""

    name: str
    version: str
    manager: str

    @property
    def managers(self) -> tuple[str, ...]:
        """The package managers that rules may use."""
        return _APT if self.manager == "apt" else _DNF if self.manager == "dnf" else (self.manager, "pip")


@frozen
class Resolved:
    """The packages of a key; without names nothing has to be installed."""

    manager: str
    names: tuple[str, ...]


def system_of(fields: Mapping[str, str], asked: str | None = None) -> System:
    """Return the system described by /etc/os-release, or NAME:VERSION if given."""
    name, version = fields.get("ID", "linux").lower(), fields.get("VERSION_ID", "")
    kin = (name, *fields.get("ID_LIKE", "").lower().split())
    if asked:
        name, _, version = asked.lower().partition(":")
        kin = (name,)
    elif not _DEBIAN.isdisjoint(kin):
        codename = fields.get("UBUNTU_CODENAME") or fields.get("VERSION_CODENAME")
        version = codename or version
        # rosdep's files use codenames for versions of Ubuntu and Debian.
        name = name if name in {"debian", "ubuntu"} else "ubuntu" if "UBUNTU_CODENAME" in fields else "debian"
    elif not _RED_HAT.isdisjoint(kin) and name not in {"fedora", "openeuler"}:
        name, version = "rhel", version.partition(".")[0]
    manager = "apt" if not _DEBIAN.isdisjoint(kin) else "dnf" if not _RED_HAT.isdisjoint(kin) else ""
    return System(name, version, manager or {"arch": "pacman", "alpine": "apk"}.get(name, "apt"))


def merged(databases: Iterable[Database]) -> dict[str, dict[str, Any]]:
    """Return one database in which the first rule for each key and system wins."""
    found: dict[str, dict[str, Any]] = {}
    for database in databases:
        for key, rules in database.items():
            if isinstance(rules, dict):
                known = found.setdefault(str(key), {})
                for system, rule in rules.items():
                    known.setdefault(str(system), rule)
    return found


def resolve(key: str, database: Database, system: System) -> Resolved | None:
    """Return the packages of a key for a system; None if it is unknown or has no package."""
    rules = database.get(key)
    if not isinstance(rules, dict) or system.name not in rules:
        return None
    rule, manager = _by_manager(rules[system.name], system)
    if manager is None and isinstance(rule, dict):
        versions = {str(version): part for version, part in rule.items()}
        rule, manager = _by_manager(versions.get(system.version, versions.get("*")), system)
        if versions.get(system.version, "") is None:
            return None
    names = _names(rule)
    return None if names is None else Resolved(manager or system.manager, names)


def _by_manager(rule: object, system: System) -> tuple[object, str | None]:
    """Return the part of a rule for the first matching package manager, and its name; else the rule."""
    if isinstance(rule, dict):
        for manager in system.managers:
            if manager in rule:
                return rule[manager], _usual(manager)
    return rule, None


def _usual(manager: str) -> str:
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
