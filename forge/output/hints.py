"""Hints about failed packages: plugins derive them from the output of the failed step.

They are entry points of the group 'forge.hints', which docs/how-to/plugins.md describes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from forge.base.extensions import HINTS, first_answer
from forge.workspace.model import Package


@dataclass(frozen=True)  # not @frozen, because plugins may add fields
class Failure:
    """A failed package, its output without colors, and its surroundings.

    `packages` are those of the workspace by name. `python` is the workspace's interpreter. `prefix_of`
    returns the prefix of an installed package, `whereabouts` a remedy for a package that is in no prefix, if
    one is known. `flags` are the options of the command.
    """

    package: Package
    packages: Mapping[str, Package]
    output: str = ""
    python: str = "python3"
    prefix_of: Callable[[str], Path | None] = lambda _: None
    whereabouts: Callable[[str], str | None] = lambda _: None
    flags: frozenset[str] = frozenset()


class HintExtension(Protocol):
    """The module of a plugin that knows causes of failures."""

    def hint(self, failure: Failure) -> str:
        """Return a remedy, '' if the cause is unknown; a wrong hint is worse than none."""


def hint_of(failure: Failure) -> str:
    """Return the first hint of a plugin, '' if there is none; forge's own plugins are asked first."""
    return first_answer(HINTS, "source of hints", "hint", failure)
