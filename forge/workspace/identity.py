"""Result types of package identification."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from forge.base.files import read_file, read_text
from forge.base.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Collection
    from pathlib import Path

    from forge.base.errors import Problem
    from forge.workspace.model import Package


@frozen
class Identity:
    """The result for a folder: a package or not, whether to search below, and warnings.

    If it has `problems`, `name` is the package's name, '' if it is unreadable.
    """

    package: Package | None = None
    descend: bool = False
    problems: tuple[Problem, ...] = ()
    notes: tuple[Problem, ...] = ()
    name: str = ""


NOT_A_PACKAGE = Identity(descend=True)
IGNORED = Identity()


@dataclass(slots=True)
class Folder:
    """A folder under examination: how to show it, its absolute path, entries, and type and name if known."""

    display_path: Path
    absolute: Path
    entries: Collection[str]
    type: str | None = None
    name: str | None = None

    def has(self, *names: str) -> bool:
        """Tell whether all these names exist."""
        return all(name in self.entries and (self.absolute / name).is_file() for name in names)

    def content(self, name: str) -> bytes:
        return read_file(self.absolute / name)

    def text(self, name: str) -> str:
        """Return a file's text; invalid UTF-8 is replaced."""
        return read_text(self.absolute / name)

    def may_be(self, type_: str) -> bool:
        """Tell whether the user has not assigned another type."""
        return self.type is None or self.type == type_
