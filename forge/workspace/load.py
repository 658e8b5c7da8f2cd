"""Loads a workspace: discovers packages, resolves dependencies, orders and selects."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

from forge.base import ament_index
from forge.base.distributions import distribution_in, has_service_events
from forge.base.env_vars import home
from forge.base.errors import Location, Problem, WorkspaceError, raise_if_any
from forge.base.frozen import frozen
from forge.base.graph import ordered_names
from forge.base.standard_interfaces import distribution_hint, is_embedded
from forge.environment.prefixes import find_underlays, provider, system_prefixes
from forge.workspace.discovery import discover, discover_embedded
from forge.workspace.filters import apply_filters
from forge.workspace.overrides import read_overrides
from forge.workspace.resolve import (
    ALL_KINDS,
    GENERATORS,
    DependencyResolution,
    break_test_cycles,
    resolve_dependencies,
)
from forge.workspace.selection import duplicate_node, ignored, select
from forge.workspace.versions import unmet_versions

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

    from forge.workspace.model import Package, Selection, Workspace
    from forge.workspace.selection import Query, SearchPaths


@frozen
class LoadedWorkspace:
    """A workspace with its packages in topological order and the selection among them.

    `packages`, `needs` and `ordered` have a node for each package: its name, except for duplicates in
    listings (see forge.workspace.selection).
    """

    workspace: Workspace
    resolution: DependencyResolution
    selection: Selection
    packages: Mapping[str, Package]
    needs: Mapping[str, frozenset[str]]
    ordered: tuple[str, ...]
    warnings: tuple[Problem, ...] = ()
    """In a listing also for unreadable manifests."""


def load_workspace(
    root: Path,
    query: Query,
    variables: Mapping[str, str],
    *,
    embedded: bool = False,
    install: Path | None = None,
) -> LoadedWorkspace:
    """Return the workspace described by the query, with warnings for the caller to print.

    `embedded` adds forge's embedded packages; `install` is the workspace's install folder, which is not used
    as an underlay. Commands without it list packages, including several with the same name and with invalid
    manifests. Raises WorkspaceError for a cycle and, except in a listing, for selected packages with the same
    name; SelectionError for names that cannot be selected.
    """
    found = find_packages(root, query.search, variables)
    workspace = _without(found, ignored(query, found.packages))
    whole = resolve_workspace(workspace, variables, install or root / "install", embedded=embedded)
    resolution, cycle_warnings = break_test_cycles(whole)
    listing = install is None
    duplicates = workspace.duplicates if listing else ()
    packages = {
        **resolution.packages,
        **{duplicate_node(other.name, other.path): other for other in duplicates},
    }
    needs = _needs(resolution, duplicates)
    limits, unsure = apply_filters(query.filters, root, workspace.packages, resolution.needs)
    ordered = ordered_names(needs)
    selection, notes = select(query, ordered, needs, limits, found.packages)
    clashes = [(other.name, _clash(workspace.packages[other.name], other)) for other in workspace.duplicates]
    if not listing:
        raise_if_any((clash for name, clash in clashes if name in selection.names), WorkspaceError)
    warnings = (*workspace.notes, *cycle_warnings, *unmet_versions(workspace.packages), *unsure, *notes)
    faults = (*workspace.problems, *(clash for _, clash in clashes)) if listing else ()
    return LoadedWorkspace(workspace, resolution, selection, packages, needs, ordered, (*faults, *warnings))


def find_packages(root: Path, search: SearchPaths, variables: Mapping[str, str]) -> Workspace:
    """Return all packages below the search paths; raises WorkspaceError for invalid package options."""
    overrides = read_overrides(root, search.metas, home(variables) if search.user_metas else None)
    found = discover(root, search.base_paths, variables, paths=search.paths, overrides=overrides)
    return found if found.packages else replace(found, notes=(*found.notes, *_missing_folders(root, search)))


def _missing_folders(root: Path, search: SearchPaths) -> Iterator[Problem]:
    for base in search.base_paths:
        if "*" not in base and not (root / base).exists():
            yield Problem(f"--base-paths: '{base}' does not exist")


def _without(workspace: Workspace, names: frozenset[str]) -> Workspace:
    """Return the workspace without packages of these names."""
    if not names:
        return workspace
    packages = {name: package for name, package in workspace.packages.items() if name not in names}
    duplicates = tuple(other for other in workspace.duplicates if other.name not in names)
    return replace(workspace, packages=packages, duplicates=duplicates)


def resolve_workspace(
    workspace: Workspace, variables: Mapping[str, str], install: Path, *, embedded: bool
) -> DependencyResolution:
    """Return where the packages' dependencies come from; without `embedded`, only those in the workspace."""
    if not embedded:
        return resolve_dependencies(workspace.packages, {}, lambda _: None)
    underlays = find_underlays(variables, install)
    # If this workspace is sourced, its own results are on PATH.
    system = tuple(path for path in system_prefixes(variables) if not path.is_relative_to(install))
    rosdistro = distribution_in(variables)
    find = cache(lambda name: provider(name, underlays, system))
    resolution = resolve_dependencies(
        workspace.packages,
        discover_embedded(rosdistro),
        find,
        is_embedded=lambda name: (prefix := find(name)) is not None and is_embedded(prefix / "share" / name),
        events=has_service_events(rosdistro),
    )
    hints: dict[str, str] = {}
    if GENERATORS not in resolution.withheld:
        missing = {name for names in resolution.missing.values() for name in names}
        hints = {name: hint for name in missing if (hint := distribution_hint(name, rosdistro))}
    return replace(
        resolution,
        elsewhere=hints,
        known=lambda: (*resolution.known(), *ament_index.resources("packages", underlays.prefixes)),
    )


def _needs(resolution: DependencyResolution, duplicates: Iterable[Package]) -> Mapping[str, frozenset[str]]:
    """Return the graph including duplicates of a name: dependents of the name depend on all of them."""
    others: dict[str, set[str]] = {}
    for other in duplicates:
        others.setdefault(other.name, set()).add(duplicate_node(other.name, other.path))
    if not others:
        return resolution.needs
    needs = dict(resolution.needs)
    for other in duplicates:
        wanted = frozenset(other.manifest.names(ALL_KINDS)) - {other.name}
        needs[duplicate_node(other.name, other.path)] = wanted & resolution.packages.keys()
    return {node: below.union(*(others.get(name, ()) for name in below)) for node, below in needs.items()}


def _clash(first: Package, second: Package) -> Problem:
    return Problem(
        f"two packages are named '{first.name}': '{first.path}' and '{second.path}'",
        Location(second.manifest.path),
        f"rename one, or ignore one by creating an empty file '{second.path}/COLCON_IGNORE'",
    )
