"""The way into every command that looks at packages: discover, provide, order, select."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

from forge import package_options
from forge.constraints import unmet_versions
from forge.discovery import discover, discover_embedded
from forge.errors import Place, Problem, WorkspaceError, raise_if_any, said_once
from forge.frozen import frozen
from forge.graph import ordered_names
from forge.limits import limits_of
from forge.overrides import read_overrides
from forge.prefixes import find_underlays, provider, system_prefixes
from forge.provision import ALL_KINDS, Provision, provide, without_test_circles
from forge.selection import ignored, select, twin
from forge.settings import home

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from forge.model import Package, Selection, Workspace


@frozen
class Loaded:
    """A workspace with its order and what was selected of it, embedded packages where asked for.

    `packages`, `needs` and `ordered` have a node for each package: its name, but for further packages
    of a name (see forge.selection), which only listings have.
    """

    workspace: Workspace
    provision: Provision
    selection: Selection
    packages: Mapping[str, Package]
    needs: Mapping[str, frozenset[str]]
    ordered: tuple[str, ...]
    doubts: tuple[Problem, ...] = ()
    """What deserves a warning, and in a listing also manifests that cannot be read."""


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
    folder, which is no underlay of its own: a command that has none lists packages, several of one name
    included. Manifests that cannot be read are then told on stderr. Raises WorkspaceError for a cycle and,
    but in a listing, for two selected packages of one name; SelectionError for names that cannot be selected.
    """
    loaded = look_at_workspace(root, options, variables, embedded=embedded, install=install)
    warn(loaded.doubts)
    return loaded


def look_at_workspace(
    root: Path,
    options: argparse.Namespace,
    variables: Mapping[str, str],
    *,
    embedded: bool = False,
    install: Path | None = None,
) -> Loaded:
    """Return the same as load_workspace, and say nothing."""
    query = package_options.query_of(options)
    found = packages_there(root, options, variables)
    workspace = _without(found, ignored(query, found.packages))
    whole = _provision(workspace, variables, install or root / "install", embedded=embedded)
    provision, circles = without_test_circles(whole)
    listing = install is None
    twins = workspace.twins if listing else ()
    packages = {**provision.packages, **{twin(other.name, other.path): other for other in twins}}
    needs = _needs(provision, twins)
    limits = limits_of(options, root, workspace.packages, provision.needs)
    ordered = ordered_names(needs)
    selection, warnings = select(query, ordered, needs, limits, found.packages)
    clashes = [(other.name, _clash(workspace.packages[other.name], other)) for other in workspace.twins]
    if not listing:
        raise_if_any((clash for name, clash in clashes if name in selection.names), WorkspaceError)
    doubts = (*workspace.notes, *circles, *unmet_versions(workspace.packages))
    told = (*workspace.problems, *(clash for _, clash in clashes)) if listing else ()
    return Loaded(workspace, provision, selection, packages, needs, ordered, (*told, *doubts, *warnings))


_told: set[str] = set()
_known: set[str] = set()
"""Warnings of this turn and of the one before it; a command that is no watch has one turn."""


def warn(problems: Iterable[Problem]) -> None:
    """Say on stderr what does not stop the command; those in a row that share a hint give it once."""
    texts = {problem.render("warning"): problem for problem in problems}
    for problem in said_once(problem for text, problem in texts.items() if text not in _known):
        print(problem.render("warning"), file=sys.stderr)  # noqa: T201  (stderr is talk)
    _told.update(texts)


def begin_turn() -> None:
    """Say no warning again from now on that the last turn would have said, too."""
    _known.clear()
    _known.update(_told)
    _told.clear()


def packages_there(root: Path, options: argparse.Namespace, variables: Mapping[str, str]) -> Workspace:
    """Return all packages where the options look for them; raises WorkspaceError for settings of theirs."""
    overrides = read_overrides(root, options.metas, None if options.ignore_user_meta else home(variables))
    return discover(
        root,
        package_options.base_paths_of(options),
        variables,
        paths=package_options.paths_of(options),
        overrides=overrides,
    )


def _without(workspace: Workspace, names: frozenset[str]) -> Workspace:
    """Return the workspace as if packages of these names were not there."""
    if not names:
        return workspace
    packages = {name: package for name, package in workspace.packages.items() if name not in names}
    twins = tuple(other for other in workspace.twins if other.name not in names)
    return replace(workspace, packages=packages, twins=twins)


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


def _needs(provision: Provision, twins: Iterable[Package]) -> Mapping[str, frozenset[str]]:
    """Return the graph with further packages of a name in it: who needs the name needs them all."""
    others: dict[str, set[str]] = {}
    for other in twins:
        others.setdefault(other.name, set()).add(twin(other.name, other.path))
    if not others:
        return provision.needs
    needs = dict(provision.needs)
    for other in twins:
        wanted = frozenset(other.manifest.names(ALL_KINDS)) - {other.name}
        needs[twin(other.name, other.path)] = wanted & provision.packages.keys()
    return {node: below.union(*(others.get(name, ()) for name in below)) for node, below in needs.items()}


def _clash(first: Package, second: Package) -> Problem:
    return Problem(
        f"two packages are called '{first.name}': '{first.path}' and '{second.path}'",
        Place(second.manifest.path),
        f"rename one, or put an empty file COLCON_IGNORE into its folder, as '{second.path}/COLCON_IGNORE'",
    )
