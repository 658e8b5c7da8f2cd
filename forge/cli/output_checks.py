"""Checks before anything is written that forge may write to the output folders of a command."""

from __future__ import annotations

import os
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from forge.base.env_vars import expand_home
from forge.base.errors import ForgeError, WorkspaceError, raise_if_any
from forge.build import folder_marks
from forge.build.journal import open_journal
from forge.workspace.load import find_packages

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from forge.base.errors import Problem
    from forge.base.layout import Layout
    from forge.workspace.load import LoadedWorkspace
    from forge.workspace.model import Workspace
    from forge.workspace.selection import SearchPaths


def output_problems(
    loaded: LoadedWorkspace,
    layout: Layout,
    names: Iterable[str],
    others: Mapping[str, str | Path | None] = MappingProxyType({}),
    *,
    prefixes: bool = True,
) -> Iterator[Problem]:
    """Yield a problem for each output folder that is or contains something that forge did not create.

    `names` are the packages with folders below the bases, unless `prefixes` is False also in the install
    folder; `others` are further output folders by option.
    """
    workspace = loaded.workspace
    sources = _sources(workspace.root, workspace)
    others = {**others, "FORGE_CACHE_DIR": os.environ.get("FORGE_CACHE_DIR")}
    folders = {option: expand_home(str(value)) for option, value in others.items() if value}
    bases = folder_marks.bases_of(layout) | {
        option: workspace.root / path for option, path in folders.items()
    }
    yield from folder_marks.base_problems(bases, sources, thorough=not workspace.packages)
    yield from folder_marks.occupied_bases(layout)
    yield from folder_marks.nesting_problems(layout, workspace.packages)
    records = cache(lambda: open_journal(layout.build).records)
    yield from folder_marks.folder_problems(names, layout, sources, records, prefixes=prefixes)


def check_bases(root: Path, search: SearchPaths, bases: Mapping[str, Path]) -> None:
    """Raise WorkspaceError for bases, by option, that are, contain or lie in sources."""
    sources = folder_marks.SourceFolders(root, (), Path.home())
    with suppress(ForgeError):  # reported where packages are selected
        sources = _sources(root, find_packages(root, search, os.environ))
    raise_if_any(folder_marks.base_problems(bases, sources), WorkspaceError)


def _sources(root: Path, workspace: Workspace) -> folder_marks.SourceFolders:
    packages = (*workspace.packages.values(), *workspace.duplicates)
    return folder_marks.SourceFolders(root, (root / package.path for package in packages), Path.home())
