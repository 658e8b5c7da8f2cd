"""Looks up keys with rosdep itself, if it is installed beside forge (`pip install 'ros-forge[rosdep]'`)."""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING

from forge.base.errors import HostError, Problem
from forge.plugins.system_deps.rosdep import Resolved, usual_manager

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from forge.plugins.system_deps.rosdep import Database
    from forge.plugins.system_deps.system import System


def is_installed() -> bool:
    """Tell whether rosdep can be imported."""
    return find_spec("rosdep2") is not None


def cached_databases(system: System, rosdistro: str) -> list[Database]:
    """Return what the last `rosdep update` stored for a system and a ROS distribution, as rosdep reads it.

    Raises HostError if rosdep cannot read it.
    """
    from rosdep2.sources_list import DataSourceMatcher, SourcesListLoader

    tags = [tag for tag in (rosdistro, system.name, system.version) if tag]
    try:
        loader = SourcesListLoader.create_default(matcher=DataSourceMatcher(tags))
    except Exception as error:
        message = f"rosdep cannot read its data: {error}"
        raise HostError(Problem(message, hint="run 'rosdep update'")) from error
    return [source.rosdep_data for source in loader.sources]


def resolver(databases: Sequence[Database], system: System) -> Callable[[str], Resolved | None]:
    """Return a function from a key to its packages, None if there are none, with the rules of rosdep."""
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
            # What has to be compiled is not downloaded to find out more about it.
            names = () if manager == "source" else context.get_installer(manager).resolve(rule)
        except (InvalidData, KeyError, ResolutionError):  # KeyError: a system that rosdep does not know
            return None
        return Resolved(usual_manager(manager), tuple(str(name) for name in names if name))

    return resolve
