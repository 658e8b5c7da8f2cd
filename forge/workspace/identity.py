"""Identification of a folder as a package: by its files and the build types of plugins.

Build types implement forge.build.build_types.BuildType. Entry points of other distributions are
searched only for types in colcon.pkg, *.meta files and forge.toml that forge does not know.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from forge.base.errors import Location, Problem, WorkspaceError
from forge.base.extensions import BUILD_TYPES, OWN, absent, call, find
from forge.base.files import read_file, read_text
from forge.base.frozen import frozen
from forge.workspace.model import Package


@frozen
class Identity:
    """The result for a folder; with `problems`, `name` is the package's name, '' if it is unreadable."""

    package: Package | None = None
    descend: bool = False
    problems: tuple[Problem, ...] = ()
    notes: tuple[Problem, ...] = ()
    name: str = ""


NOT_A_PACKAGE = Identity(descend=True)
IGNORED = Identity()


@dataclass(slots=True)
class Folder:
    """A folder under examination: its display path, absolute path, entries, and type and name if known."""

    display_path: Path
    absolute: Path
    entries: Collection[str]
    type: str | None = None
    name: str | None = None

    def has(self, *names: str) -> bool:
        """Return whether all these names exist."""
        return all(name in self.entries and (self.absolute / name).is_file() for name in names)

    def content(self, name: str) -> bytes:
        return read_file(self.absolute / name)

    def text(self, name: str) -> str:
        """Return a file's text; invalid UTF-8 is replaced."""
        return read_text(self.absolute / name)

    def may_be(self, type_: str) -> bool:
        """Return whether the user has not assigned another type."""
        return self.type is None or self.type == type_


def plugin(name: str) -> Any:
    """Return the build type of a plugin, None if there is none; raises ForgeError if it cannot be loaded."""
    if absent(BUILD_TYPES, name, "build type"):
        return None
    return find(BUILD_TYPES, name, "build type", ("identify", "options", "recipe", "tests"))


def identify_with(name: str, folder: Folder) -> Identity | None:
    """Return the package that the build type `name` finds in a folder, None if there is none."""
    module = plugin(name)
    if module is None:
        return None
    if name in OWN[BUILD_TYPES]:
        identity: Identity | None = module.identify(folder)
        return identity
    identity = call(f"the build type '{name}'", module.identify, folder)
    if not isinstance(identity, Identity | None):
        message = f"the build type '{name}' returned {type(identity).__name__} instead of an Identity"
        raise WorkspaceError(Problem(message, Location(folder.display_path)))
    return identity
