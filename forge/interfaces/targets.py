"""Load targets of other distributions: entry points of the group 'forge.interfaces.targets'.

Each refers to a module with `files(catalog) -> Iterator[File]`, as forge's own targets have:

    [project.entry-points."forge.interfaces.targets"]
    rust = "my_distribution.rust_target"
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from forge.base.errors import ForgeError, Problem
from forge.base.names import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from forge.interfaces.model import Catalog, File

GROUP = "forge.interfaces.targets"


class Target(Protocol):
    """Renders a catalog to files."""

    def files(self, catalog: Catalog) -> Iterator[File]:
        """Yield the files of a package, their paths relative to the target's folder."""


def find_target(name: str, known: Iterable[str]) -> Target:
    """Load a target of another distribution; `known` are forge's own targets, for the error message.

    Raises ForgeError if it does not exist or cannot be loaded.
    """
    from importlib.metadata import entry_points  # noqa: PLC0415  (needed only for targets of other distributions)

    found = entry_points(group=GROUP)
    if name not in found.names:
        names = sorted({*known, *found.names})
        near = did_you_mean(name, names)
        available = f"available targets: {', '.join(names)}"
        hint = f"{near} {available}" if near else available
        raise ForgeError(Problem(f"unknown target '{name}'", hint=hint))
    chosen = found[name]
    try:
        target: Target = chosen.load()
    except Exception as error:
        raise ForgeError(_unusable(name, chosen.value, f"{type(error).__name__}: {error}")) from error
    if not callable(getattr(target, "files", None)):
        raise ForgeError(_unusable(name, chosen.value, "it has no function 'files'"))
    return target


def _unusable(name: str, value: str, reason: str) -> Problem:
    hint = f"fix or remove the distribution with this entry point of the group '{GROUP}'"
    return Problem(f"the target '{name}' cannot be loaded from '{value}': {reason}", hint=hint)
