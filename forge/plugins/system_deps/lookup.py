"""The dependencies of a workspace and their system packages: those of rosdep, or of a ROS distribution."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forge.base.errors import HostError, Location, Problem, WorkspaceError, reason_of
from forge.base.formats import read_yaml
from forge.base.frozen import frozen
from forge.base.names import did_you_mean
from forge.base.own_environment import extra_command
from forge.workspace.model import DependencyKind
from forge.workspace.resolve import is_ros_name, resembles_ros_name

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from forge.plugins.system_deps.system import System
    from forge.workspace.model import Package

    Database = Mapping[str, Any]

_SURE = 0.7
_DISTRIBUTIONS = (
    *("ardent", "bouncy", "crystal", "dashing", "eloquent", "foxy", "galactic", "humble", "iron", "jazzy"),
    *("kilted", "rolling"),
)
"""The distributions of ROS 2 (REP 2000); later ones are unknown here."""


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

    `provider` is the prefix or workspace that provides it, if any. Otherwise, the package manager `manager`
    provides it as `names`; without a manager, the dependency is unknown. `ros` is True if the name is that of
    a ROS package.
    """

    key: str
    users: tuple[str, ...]
    provider: str | None = None
    manager: str | None = None
    names: tuple[str, ...] = ()
    ros: bool = False


@frozen
class PackageNames:
    """A lookup of the packages of a key, and the available data about the system and the ROS distribution."""

    resolve: Callable[[str], Resolved | None]
    has_data: bool
    covers_system: bool
    lists_ros_packages: bool


def has_rosdep() -> bool:
    """Return whether rosdep, the extra 'rosdep', is installed beside forge."""
    return find_spec("rosdep2") is not None


def mistyped_distribution(name: str) -> Iterator[Problem]:
    """Yield a warning if a name is not a ROS 2 distribution but resembles one."""
    hint = None if name in _DISTRIBUTIONS else did_you_mean(name, _DISTRIBUTIONS, _SURE)
    if hint:
        yield Problem(f"unknown ROS distribution '{name}'", hint=hint)


def find_package_names(files: Sequence[str], system: System, rosdistro: str) -> PackageNames:
    """Return the lookup in the given files, then in the data of the last `rosdep update`.

    Without data of the ROS distribution, names that resemble ROS packages are converted as by rosdep:
    'ros-humble-nav2-msgs'. Raises HostError if files are given and rosdep is not installed, WorkspaceError
    for unreadable files.
    """
    if files and not has_rosdep():
        raise HostError(Problem("'--rosdep-file' needs rosdep", hint=f"run: {extra_command('rosdep')}"))
    databases = [_read(Path(file).expanduser()) for file in files]
    if has_rosdep():
        databases += _cached_databases(system, rosdistro)
    look_up = resolver(databases, system) if databases else lambda _: None
    every = [rules for database in databases for rules in database.values() if isinstance(rules, dict)]
    listed = any("_is_ros" in rules for rules in every)

    def find(key: str) -> Resolved | None:
        resolved = look_up(key)
        if resolved or listed or not rosdistro or not system.manager:
            return resolved
        name = f"ros-{rosdistro}-{key.replace('_', '-')}"
        return Resolved(system.manager, (name,)) if resembles_ros_name(key) else None

    return PackageNames(find, bool(databases), any(system.name in rules for rules in every), listed)


def resolver(databases: Sequence[Database], system: System) -> Callable[[str], Resolved | None]:
    """Return a function from a key to its packages, None if there are none, with the rules of rosdep.

    The first database with a rule for the key and the system wins.
    """
    from rosdep2 import create_default_installer_context
    from rosdep2.core import InvalidData
    from rosdep2.lookup import ResolutionError, RosdepDefinition

    context = create_default_installer_context()
    context.set_os_override(system.name, system.version)

    def resolve(key: str) -> Resolved | None:
        rules = [rules for database in databases if isinstance(rules := database.get(key), dict)]
        if not rules:
            return None
        definition = RosdepDefinition(key, dict(rules[0]))
        for more in rules[1:]:
            definition.reverse_merge(more)
        try:
            managers = context.get_os_installer_keys(system.name)
            default = context.get_default_os_installer_key(system.name)
            manager, rule = definition.get_rule_for_platform(system.name, system.version, managers, default)
            # Packages that must be compiled are not downloaded just to inspect them.
            names = () if manager == "source" else context.get_installer(manager).resolve(rule)
            package_names = tuple(str(name) for name in names if name)
        # KeyError: a system that rosdep does not know. TypeError: malformed rules.
        except (InvalidData, KeyError, ResolutionError, TypeError):
            return None
        return Resolved("dnf" if manager == "yum" else manager, package_names)

    return resolve


def _cached_databases(system: System, rosdistro: str) -> list[Database]:
    """Return the data of the last `rosdep update` for a system and a ROS distribution."""
    from rosdep2.sources_list import DataSourceMatcher, SourcesListLoader

    tags = [tag for tag in (rosdistro, system.name, system.version) if tag]
    try:
        loader = SourcesListLoader.create_default(matcher=DataSourceMatcher(tags))
    except Exception as error:
        message = f"rosdep cannot read its data: {error}"
        raise HostError(Problem(message, hint="run 'rosdep update'")) from error
    return [source.rosdep_data for source in loader.sources]


def _read(path: Path) -> Database:
    try:
        return read_yaml(path.read_bytes(), path)
    except OSError as error:
        message = f"cannot read the rosdep file: {reason_of(error)}"
        raise WorkspaceError(Problem(message, Location(path))) from None


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
    statuses = []
    for key in sorted(users):
        of_key, provided = tuple(sorted(users[key])), provider(key)
        resolved = None if provided else resolve(key)
        if resolved:
            statuses.append(DependencyStatus(key, of_key, None, resolved.manager, resolved.names))
        else:
            statuses.append(DependencyStatus(key, of_key, provided, ros=not provided and is_ros_name(key)))
    return tuple(statuses)


def is_installed(need: DependencyStatus, installed: frozenset[tuple[str, str]]) -> bool:
    """Return whether all packages of a dependency are in `installed`: (package manager, name)."""
    return need.manager is not None and all((need.manager, name) in installed for name in need.names)
