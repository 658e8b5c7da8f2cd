"""Finds packages without package.xml by the build types of plugins.

forge.build.build_types.BuildType is what a build type implements. Entry points of other distributions are
searched only for types in colcon.pkg, *.meta files and forge.toml that forge does not know.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from forge.base.errors import Location, Problem, WorkspaceError
from forge.base.extensions import BUILD_TYPES, OWN, absent, call, find
from forge.workspace.identity import Identity

if TYPE_CHECKING:
    from pathlib import Path

    from forge.workspace.identity import Folder

FUNCTIONS = ("identify", "options", "recipe", "tests")


def plugin(name: str) -> Any:
    """Return the build type `name` of a plugin, None if there is none.

    Raises ForgeError if it cannot be loaded.
    """
    if absent(BUILD_TYPES, name, "build type"):
        return None
    return find(BUILD_TYPES, name, "build type", FUNCTIONS)


def identify_with(name: str, folder: Folder) -> Identity | None:
    """Return the package that the build type `name` finds in a folder, None if there is none."""
    found = plugin(name)
    if found is None:
        return None
    if name in OWN[BUILD_TYPES]:
        identity: Identity | None = found.identify(folder)
        return identity
    identity = call(f"the build type '{name}'", found.identify, folder)
    if not isinstance(identity, Identity | None):
        message = f"the build type '{name}' returned {type(identity).__name__} instead of an Identity"
        raise WorkspaceError(Problem(message, Location(folder.display_path)))
    return identity


def require_plugins(names: tuple[str, ...], file: Path) -> None:
    """Raise WorkspaceError for the first build type of forge.toml that no distribution provides."""
    for name in names:
        if plugin(name) is None:
            message = f"no installed distribution provides the build type '{name}'"
            hint = f"install it beside forge, source its workspace, or remove '{name}' from 'build-types'"
            raise WorkspaceError(Problem(message, Location(file), hint))
