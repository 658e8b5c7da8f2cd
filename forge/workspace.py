"""The way into every command that looks at packages: discover, provide, order, select."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from forge.discovery import discover, discover_embedded
from forge.graph import ordered_names
from forge.options import query_of
from forge.prefixes import find_underlays, provider, system_prefixes
from forge.provision import Provision, provide
from forge.selection import select

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from forge.errors import Problem
    from forge.model import Package, Selection, Workspace


@dataclass(frozen=True, slots=True)
class Loaded:
    """A workspace with its order and what was selected of it, embedded packages where asked for."""

    workspace: Workspace
    provision: Provision
    selection: Selection

    @property
    def packages(self) -> Mapping[str, Package]:
        """All packages by name."""
        return self.provision.packages


def load_workspace(
    root: Path,
    options: argparse.Namespace,
    variables: Mapping[str, str],
    *,
    embedded: bool = False,
    install: Path | None = None,
) -> Loaded:
    """Return the workspace that the options describe.

    `embedded` adds the packages that forge brings along; `install` is the workspace's own install
    folder, which is no underlay of its own. Manifests that cannot be read are told on stderr.
    Raises WorkspaceError for a cycle, SelectionError for names that cannot be selected.
    """
    workspace = discover(root, options.base_paths, variables)
    provision = _provision(workspace, variables, install or root / "install", embedded=embedded)
    own = {name: needs & workspace.packages.keys() for name, needs in provision.needs.items()}
    graph = own if not embedded else provision.needs
    selection, warnings = select(query_of(options), ordered_names(graph), graph)
    warn((*(() if embedded else workspace.problems), *warnings))
    return Loaded(workspace, provision, selection)


def warn(problems: Iterable[Problem]) -> None:
    """Say on stderr what does not stop the command."""
    for problem in problems:
        print(problem.render("warning"), file=sys.stderr)  # noqa: T201  (stderr is talk)


def _provision(
    workspace: Workspace, variables: Mapping[str, str], install: Path, *, embedded: bool
) -> Provision:
    if not embedded:
        return provide(workspace.packages, {}, lambda _: None)
    underlays = find_underlays(variables, install)
    # Whoever sourced this workspace has its own earlier results on PATH.
    system = tuple(path for path in system_prefixes(variables) if not path.is_relative_to(install))
    return provide(
        workspace.packages, discover_embedded(), cache(lambda name: provider(name, underlays, system))
    )
