"""Loads a workspace: discovers packages, resolves dependencies, orders and selects."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from forge.base import ament_index
from forge.base.distributions import distribution_hint, distribution_in, has_service_events, is_embedded
from forge.base.env_vars import home
from forge.base.errors import Location, Problem, WorkspaceError, raise_if_any
from forge.base.extensions import OPTIONS, own_plugin
from forge.base.frozen import frozen
from forge.base.graph import closure, ordered_names
from forge.base.layout import IGNORE_MARK
from forge.base.names import project_name
from forge.base.text import listed
from forge.environment.prefixes import find_underlays, provider, system_prefixes
from forge.workspace import resolve
from forge.workspace.discovery import discover, discover_embedded, projects
from forge.workspace.model import Manifest, Package, Selection, Workspace
from forge.workspace.overrides import read_overrides
from forge.workspace.selection import Query, SearchPaths, apply_filters, duplicate_node, ignored, select

Node = TypeVar("Node")
_NAMING = (
    *("select", "skip", "up_to", "above", "above_and_dependencies", "above_depth"),
    *("select_by_dep", "skip_by_dep", "skip_up_to", "start", "end", "ignore"),
)
"""The fields of a query that contain names of packages."""


@frozen
class LoadedWorkspace:
    """Packages, dependencies and selection; listings have a node for each duplicate (see `selection`)."""

    workspace: Workspace
    resolution: resolve.DependencyResolution
    selection: Selection
    warnings: tuple[Problem, ...] = ()
    """In a listing, this includes unreadable manifests."""

    @property
    def packages(self) -> Mapping[str, Package]:
        return self.resolution.packages


def load_workspace(
    root: Path,
    query: Query,
    variables: Mapping[str, str],
    *,
    embedded: bool = False,
    install: Path | None = None,
    tested: Callable[[Package], bool | None] = lambda _: None,
) -> LoadedWorkspace:
    """Return the workspace described by the query, with warnings for the caller to print.

    `embedded` adds forge's embedded packages; `install` is the workspace's install folder, which is not used
    as an underlay. Commands without it list packages, including several with the same name and with invalid
    manifests. `tested(package)` returns whether test dependencies of the package count, None if the query
    decides. Raises WorkspaceError for a cycle and, except in a listing, for selected packages with the same
    name; SelectionError for names that cannot be selected.
    """
    discovered = find_packages(root, query.search, variables)
    every = discovered.packages.keys() | {broken.name for broken in discovered.broken}
    query = _with_literal_names(query, discovered, every)
    hidden = ignored(query, every)
    workspace = replace(
        discovered,
        packages=_drop(discovered.packages, hidden),
        duplicates=tuple(other for other in discovered.duplicates if other.name not in hidden),
        broken=tuple(other for other in discovered.broken if other.name not in hidden),
    )
    # Placeholders represent broken packages, so that options and dependencies can name them.
    broken = {
        each.name: Package(each.path, Manifest(each.name, "", "", "", (), each.path), ros=False)
        for each in workspace.broken
        if each.name not in workspace.packages
    }
    with_cycles = resolve_workspace(
        replace(workspace, packages={**workspace.packages, **broken}),
        variables,
        install or root / "install",
        embedded=embedded,
        untested=frozenset(
            name
            for name, each in workspace.packages.items()
            if tested(each) is False or (query.no_test_dependencies and tested(each) is None)
        ),
    )
    resolution, cycle_warnings = resolve.break_test_cycles(replace(with_cycles, ignored=hidden))
    listing = install is None
    limits, unsure = apply_filters(query, root, {**workspace.packages, **broken}, resolution.needs)
    if listing and workspace.duplicates:
        resolution = _with_duplicates(resolution, workspace.duplicates, tested=not query.no_test_dependencies)
    ordered = ordered_names(resolution.needs)

    def hint_for(name: str) -> str | None:
        if name == os.curdir:
            return "'.' is the package around the current folder, which is in none"
        ignoring = own_plugin(OPTIONS, "ignored-packages")
        return ignoring.hint_for(name, root, query.search.base_paths, variables) if ignoring else None

    selection, notes = select(query, ordered, resolution.needs, limits, every, hint_for)
    if not listing:
        raise_if_any(clashes(workspace, selection.names), WorkspaceError)
    unmet = resolve.unmet_versions(workspace.packages)
    warnings = (*workspace.notes, *cycle_warnings, *unmet, *unsure, *notes)
    if listing:
        names = {other.name for other in workspace.duplicates}
        warnings = (*workspace.problems, *clashes(workspace, names), *warnings)
    loaded = LoadedWorkspace(workspace, resolution, selection, warnings)
    return _without_broken(loaded, frozenset(broken), listing=listing) if workspace.broken else loaded


def _with_literal_names(query: Query, workspace: Workspace, every: Collection[str]) -> Query:
    """Return the query with Python projects spelled as in the workspace (PEP 503), and '.' by its name."""
    plain = projects(package for package in workspace.packages.values() if not package.ros)
    here = Path(query.origin)
    names = {package.path: package.name for package in workspace.all_packages}
    names |= {package.path: package.name for package in workspace.broken}
    around = next((names[folder] for folder in (here, *here.parents) if folder in names), os.curdir)

    def literal(name: str) -> str:
        if name == os.curdir:
            return around
        same = () if name in every else plain.get(project_name(name), ())
        return same[0].name if len(same) == 1 else name

    def literals(value: Any) -> Any:
        if isinstance(value, str):
            return literal(value)
        return tuple(map(literals, value)) if isinstance(value, tuple) else value

    return replace(query, **{name: literals(getattr(query, name)) for name in _NAMING})


def _without_broken(loaded: LoadedWorkspace, names: frozenset[str], *, listing: bool) -> LoadedWorkspace:
    """Return the workspace without placeholders; broken packages that nothing needs become warnings."""
    selection, resolution = loaded.selection, loaded.resolution
    reached = closure(resolution.needs, selection.names) | frozenset(selection.names)
    needed, others = [], []
    for each in loaded.workspace.broken:
        if each.name in reached:
            *first, last = each.problems
            ignore = f"'--packages-ignore {each.name}', or an empty file '{each.path / IGNORE_MARK}'"
            hint = f"{last.hint + '; ' if last.hint else ''}to leave the package out: {ignore}"
            needed.append(replace(each, problems=(*first, replace(last, hint=hint))))
        elif not listing:
            message = f"skipping '{each.name}': {each.problems[0].message}"
            others.append(replace(each.problems[0], message=message))
    return replace(
        loaded,
        workspace=replace(loaded.workspace, broken=tuple(needed)),
        resolution=replace(
            resolution,
            packages=_drop(resolution.packages, names),
            needs={name: needs - names for name, needs in _drop(resolution.needs, names).items()},
        ),
        selection=Selection(
            tuple(node for node in selection.names if node not in names), _drop(selection.left_out, names)
        ),
        warnings=(*others, *loaded.warnings),
    )


def _drop(nodes: Mapping[str, Node], names: Collection[str]) -> dict[str, Node]:
    return {name: value for name, value in nodes.items() if name not in names}


def find_packages(root: Path, search: SearchPaths, variables: Mapping[str, str]) -> Workspace:
    """Return all packages below the search paths; raises WorkspaceError for invalid package options."""
    overrides = read_overrides(root, search.metas, None if search.ignore_user_meta else home(variables))
    workspace = discover(root, search.base_paths, variables, paths=search.paths, overrides=overrides)
    if workspace.packages:
        return workspace
    missing = (base for base in search.base_paths if "*" not in base and not (root / base).exists())
    notes = (Problem(f"--base-paths: '{base}' does not exist") for base in missing)
    return replace(workspace, notes=(*workspace.notes, *notes))


def resolve_workspace(
    workspace: Workspace,
    variables: Mapping[str, str],
    install: Path,
    *,
    embedded: bool,
    untested: frozenset[str] = frozenset(),
) -> resolve.DependencyResolution:
    """Return the sources of dependencies, embedded ones only if wanted, without tests of `untested`."""
    if not embedded:
        return resolve.resolve_dependencies(workspace.packages, {}, lambda _: None, untested=untested)
    underlays = find_underlays(variables, install)
    # If this workspace is sourced, its own prefixes are on PATH.
    system = tuple(path for path in system_prefixes(variables) if not path.is_relative_to(install))
    rosdistro = distribution_in(variables)
    find = cache(lambda name: provider(name, underlays, system))
    resolution = resolve.resolve_dependencies(
        workspace.packages,
        discover_embedded(rosdistro),
        find,
        is_embedded=lambda name: (prefix := find(name)) is not None and is_embedded(prefix / "share" / name),
        events=has_service_events(rosdistro),
        untested=untested,
    )
    own = resolve.GENERATORS not in resolution.withheld
    missing = {name for names in resolution.missing.values() for name in names} if own else ()
    return replace(
        resolution,
        elsewhere={name: hint for name in missing if (hint := distribution_hint(name, rosdistro))},
        known=lambda: (*resolution.known(), *ament_index.resources("packages", underlays.prefixes)),
    )


def _with_duplicates(
    resolution: resolve.DependencyResolution, duplicates: Iterable[Package], *, tested: bool
) -> resolve.DependencyResolution:
    """Return the resolution with a node for each duplicate; dependents of a name depend on all of them."""
    packages, needs = dict(resolution.packages), dict(resolution.needs)
    others: dict[str, set[str]] = {}
    for other in duplicates:
        node = duplicate_node(other.name, other.path)
        others.setdefault(other.name, set()).add(node)
        left_out = {other.name} if tested else {other.name, *other.only_tested_with}
        wanted = frozenset(other.manifest.names(resolve.ALL_KINDS)) - left_out
        packages[node], needs[node] = other, wanted & resolution.packages.keys()
    needs = {node: below.union(*(others.get(name, ()) for name in below)) for node, below in needs.items()}
    return replace(resolution, packages=packages, needs=needs)


def clashes(workspace: Workspace, names: Collection[str]) -> Iterator[Problem]:
    """Yield a problem for each folder that contains packages of `names` which also exist elsewhere."""
    paths: dict[str, list[Path]] = {}
    for other in workspace.duplicates:
        if other.name in names:
            paths.setdefault(other.name, [workspace.packages[other.name].path]).append(other.path)
    # The path outside 'src', or the deeper one, is probably the copy.
    originals = {
        name: min(candidates, key=lambda path: (path.parts[:1] != ("src",), len(path.parts), path))
        for name, candidates in paths.items()
    }
    copies = [(name, path) for name in paths for path in paths[name] if path != originals[name]]
    groups: dict[tuple[Path, Path], list[tuple[str, Path]]] = {}
    for name, path in copies:
        # Copies of folders with the same contents form one group.
        first, second = originals[name], path
        while first.parts and second.parts and first.name == second.name:
            first, second = first.parent, second.parent
        groups.setdefault((first, second), []).append((name, path))
    tops = {top for pair in groups for top in pair}
    if len(tops) > 1 and all(top != Path() and (workspace.root / top / "src").is_dir() for top in tops):
        quoted = listed(sorted(paths), 5)
        message = f"this folder contains {len(tops)} workspaces with packages of the same names: {quoted}"
        yield Problem(message, hint=f"change to one of them: cd {min(tops)}")
        return
    others = {path for _, path in copies}
    manifests = {package.path: package.manifest.path for package in workspace.all_packages}
    for (top, copy), members in groups.items():
        name, path = members[0]
        only_copies = all(path in others for path in manifests if path.is_relative_to(copy))
        near = f"'{copy if only_copies and copy != Path() else path}/{IGNORE_MARK}'"
        worktree = (workspace.root / copy / ".git").is_file()
        why = f"'{copy}' is another checkout of a repository: " if worktree else ""
        hint = f"{why}rename one, or ignore one by creating an empty file {near}"
        if len(members) == 1:
            message = f"two packages are named '{name}': '{originals[name]}' and '{path}'"
            yield Problem(message, Location(manifests[path]), hint)
        else:
            quoted = listed([name for name, _ in members], 5)
            message = f"{len(members)} packages are in '{top}' and again in '{copy}': {quoted}"
            yield Problem(message, Location(copy), hint)
