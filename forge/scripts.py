"""Install trees as shell text: local_setup, setup and package scripts for sh, bash and zsh, pure.

The scripts are static. What the packages' dsv files say is settled when they are written, so that
sourcing a workspace starts no program and costs about as much as reading one file.
"""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from typing import TYPE_CHECKING

from forge.environment import Script
from forge.templating import render

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from forge.environment import Edit, Installed

SHELLS = ("sh", "bash", "zsh")

_SPECIAL = re.compile(r'[\\"$`]')


@dataclass(frozen=True, slots=True)
class _Statement:
    """One paragraph of a script; `template` says how it reads, all else are finished words."""

    template: str
    words: dict[str, object]


def local_setup(shell: str, root: Path, packages: Sequence[Installed]) -> str:
    """Return the script that adds the packages of one install tree, lowest first.

    The paths in it are relative to the script's own place; only plain sh, which cannot know it,
    falls back to `root`.
    """
    edits = [(package, edit) for package in packages for edit in package.edits]
    statements = [_statement(shell, group) for group in _groups(edits)]
    return render(
        "scripts/local_setup.j2",
        shell=shell,
        locate=f"scripts/locate.{shell}.j2",
        baked=shlex.quote(str(root)),
        isolated=any(package.folder for package in packages),
        names=[package.name for package in packages],
        appending=any(isinstance(edit, Edit) and edit.operation == "append" for _, edit in edits),
        sourcing=any(isinstance(edit, Script) for _, edit in edits),
        statements=statements,
    )


def setup(shell: str, root: Path, underlays: Sequence[Path]) -> str:
    """Return the script that sources the underlays, lowest first, and then its own local_setup."""
    return render(
        "scripts/setup.j2",
        shell=shell,
        locate=f"scripts/locate.{shell}.j2",
        baked=shlex.quote(str(root)),
        underlays=[shlex.quote(str(underlay)) for underlay in underlays],
    )


def package_setup(shell: str, name: str, prefix: Path, edits: Iterable[Edit | Script]) -> str:
    """Return the script that adds one package alone, in front of all that is there."""


def hook(operation: str, variable: str, value: str) -> str:
    """Return the text of a dsv file with a single line."""
    return render("scripts/hook.dsv.j2", operation=operation, variable=variable, value=value)
