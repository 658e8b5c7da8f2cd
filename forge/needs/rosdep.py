"""What keys such as 'python3-numpy' are called by a system's package manager, in rosdep's words; pure.

A database maps a key to operating systems, these to rules. A rule is names; or names by package manager;
or either of these by version of the system, where '*' means all others (REP 111). Of several databases
the first that knows a key for a system wins.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    Database = Mapping[str, Any]

_APT = ("apt", "pip", "gem", "npm", "source")
_DNF = ("pip", "dnf", "yum", "source")
_DEBIAN = frozenset({"debian", "ubuntu", "linuxmint", "pop", "raspbian", "zorin", "elementary"})
_RED_HAT = frozenset({"fedora", "rhel", "centos", "rocky", "almalinux", "ol", "openeuler", "amzn"})


@frozen
class System:
    """An operating system: its name and version as rosdep's files have them, and its package manager."""

    name: str
    version: str
    manager: str

    @property
    def managers(self) -> tuple[str, ...]:
        """The package managers that a rule for it may name."""
        return _APT if self.manager == "apt" else _DNF if self.manager == "dnf" else (self.manager, "pip")


@frozen
class Resolved:
    """What a key means: the names that one package manager takes; none where nothing need be installed."""

    manager: str
    names: tuple[str, ...]


def system_of(said: Mapping[str, str], asked: str | None = None) -> System:
    """Return the system that the fields of /etc/os-release describe, or NAME:VERSION as asked."""
    name, version = said.get("ID", "linux").lower(), said.get("VERSION_ID", "")
    kin = (name, *said.get("ID_LIKE", "").lower().split())
    if asked:
        name, _, version = asked.lower().partition(":")
        kin = (name,)
    elif not _DEBIAN.isdisjoint(kin):
        codename = said.get("UBUNTU_CODENAME") or said.get("VERSION_CODENAME")
        version = codename or version
        # Who builds on Ubuntu says so by its codename, and rosdep's files know only that.
        name = name if name in {"debian", "ubuntu"} else "ubuntu" if "UBUNTU_CODENAME" in said else "debian"
    elif not _RED_HAT.isdisjoint(kin) and name not in {"fedora", "openeuler"}:
        name, version = "rhel", version.partition(".")[0]
    manager = "apt" if not _DEBIAN.isdisjoint(kin) else "dnf" if not _RED_HAT.isdisjoint(kin) else ""
    return System(name, version, manager or {"arch": "pacman", "alpine": "apk"}.get(name, "apt"))


def merged(databases: Iterable[Database]) -> dict[str, dict[str, Any]]:
    """Return one database in which, for each key and system, the first that says something counts."""
    found: dict[str, dict[str, Any]] = {}
    for database in databases:
        for key, rules in database.items():
            if isinstance(rules, dict):
                known = found.setdefault(str(key), {})
                for system, rule in rules.items():
                    known.setdefault(str(system), rule)
    return found


def resolve(key: str, database: Database, system: System) -> Resolved | None:
    """Return what a key means for a system; None where nobody says, or where it says there is nothing."""
    rules = database.get(key)
    if not isinstance(rules, dict) or system.name not in rules:
        return None
    rule, manager = _by_manager(rules[system.name], system)
    if manager is None and isinstance(rule, dict):
        versions = {str(version): said for version, said in rule.items()}
        rule, manager = _by_manager(versions.get(system.version, versions.get("*")), system)
        if versions.get(system.version, "") is None:
            return None
    names = _names(rule)
    return None if names is None else Resolved(manager or system.manager, names)


def _by_manager(rule: object, system: System) -> tuple[object, str | None]:
    """Return the part of a rule for the first package manager that it names, and that one; else the rule."""
    if isinstance(rule, dict):
        for manager in system.managers:
            if manager in rule:
                return rule[manager], _usual(manager)
    return rule, None


def _usual(manager: str) -> str:
    return "dnf" if manager == "yum" else manager


def _names(rule: object) -> tuple[str, ...] | None:
    match rule:
        case {"packages": said}:
            return _names(said)
        case dict():
            return ()
        case str():
            return tuple(rule.split())
        case list():
            return tuple(map(str, rule))
        case _:
            return None
