"""Load targets of other distributions: entry points of the group 'forge.interfaces.targets'.

Each refers to a module with `files(catalog) -> Iterator[File]`, as forge's own targets have:

    [project.entry-points."forge.interfaces.targets"]
    rust = "my_distribution.rust_target"
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from forge.base.errors import ForgeError, Problem
from forge.base.extensions import OWN, TARGETS, entry_points, find
from forge.base.names import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from forge.interfaces.model import Catalog, File


class Target(Protocol):
    """Renders a catalog to files."""

    def files(self, catalog: Catalog) -> Iterator[File]:
        """Yield the files of a package, their paths relative to the target's folder."""


def find_target(name: str, known: Iterable[str]) -> Target:
    """Load a target of a plugin; `known` are those of the core, for the error message.

    Raises ForgeError if it does not exist or cannot be loaded.
    """
    target: Target | None = find(TARGETS, name, "target", ("files",))
    if target is None:
        names = sorted({*known, *OWN[TARGETS], *entry_points(TARGETS)})
        near = did_you_mean(name, names)
        available = f"available targets: {', '.join(names)}"
        hint = f"{near} {available}" if near else available
        raise ForgeError(Problem(f"unknown target '{name}'", hint=hint))
    return target
