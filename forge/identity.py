"""Nouns of discovery: a folder that is looked at, and what it turned out to be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from forge.files import read_file, read_text
from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Collection
    from pathlib import Path

    from forge.errors import Problem
    from forge.model import Package


@frozen
class Identity:
    """What a folder is: perhaps a package; if not, whether to look below; and what to tell the user."""

    package: Package | None = None
    descend: bool = False
    problems: tuple[Problem, ...] = ()
    notes: tuple[Problem, ...] = ()


NOTHING = Identity(descend=True)
HIDDEN = Identity()


@dataclass(slots=True)
class Folder:
    """A folder that is looked at: as spelled, where it is, what is in it, and what is known so far."""

    path: Path
    place: Path
    entries: Collection[str]
    type: str | None = None
    name: str | None = None

    def has(self, *names: str) -> bool:
        """Tell if files of all these names are there."""
        return all(name in self.entries and (self.place / name).is_file() for name in names)

    def content(self, name: str) -> bytes:
        """Return a file's bytes."""
        return read_file(self.place / name)

    def text(self, name: str) -> str:
        """Return a file's text; bytes that are no UTF-8 are replaced."""
        return read_text(self.place / name)

    def may_be(self, type_: str) -> bool:
        """Tell if nobody has said that it is something else."""
        return self.type is None or self.type == type_
