"""Selects packages by the options of the command line, with reasons for the others.

In listings, packages with the same name are separate nodes: the name, and for all but the first one a NUL
character and the folder. Options apply to all of them.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge.base.errors import Problem, SelectionError, raise_if_any
from forge.base.frozen import frozen
from forge.base.graph import closure, closures, reverse
from forge.base.names import did_you_mean
from forge.workspace.model import Selection

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    Graph = Mapping[str, frozenset[str]]

FilterResult = tuple[str, frozenset[str]]
"""The reason why other packages are left out, and the names that are kept."""


@frozen
class SearchPaths:
    """Paths for package discovery, relative to the root, and metadata files."""

    base_paths: tuple[str, ...] = (".",)
    """Folders to search recursively."""
    paths: tuple[str, ...] = ()
    """Package folders or wildcards."""
    metas: tuple[str, ...] = ()
    user_metas: bool = True


@frozen
class PackageFilters:
    """The selection options that depend on earlier results below `build_base`, or on git."""

    build_base: str = "build"
    select_build_failed: bool = False
    skip_build_finished: bool = False
    select_test_failures: bool = False
    skip_test_passed: bool = False
    select_changed: bool = False
    above_changed: bool = False
    since: str = "HEAD"


@frozen
class Query:
    """The package options of a command line; None and () for options that were not given."""

    select: tuple[str, ...] | None = None
    skip: tuple[str, ...] = ()
    select_regex: tuple[str, ...] | None = None
    skip_regex: tuple[str, ...] = ()
    up_to: tuple[str, ...] = ()
    up_to_regex: tuple[str, ...] = ()
    above: tuple[str, ...] = ()
    above_and_dependencies: tuple[str, ...] = ()
    above_depth: tuple[int, tuple[str, ...]] = (0, ())
    select_by_dep: tuple[str, ...] = ()
    skip_by_dep: tuple[str, ...] = ()
    skip_up_to: tuple[str, ...] = ()
    start: str | None = None
    end: str | None = None
    ignore: tuple[str, ...] = ()
    ignore_regex: tuple[str, ...] = ()
    strict: bool = False
    no_test_dependencies: bool = False
    search: SearchPaths = SearchPaths()
    filters: PackageFilters = PackageFilters()

    @property
    def named(self) -> frozenset[str]:
        """Return the names of packages to select, without those of regular expressions."""
        ends = (name for name in (self.start, self.end) if name)
        lists = (*(self.select or ()), *self.up_to, *self.above, *self.above_and_dependencies, *ends)
        return frozenset((*lists, *self.above_depth[1]))


def name_of(node: str) -> str:
    """Return the package name of a node."""
    return node.partition("\0")[0]


def duplicate_node(name: str, folder: object) -> str:
    """Return the node of a further package with the same name."""
    return f"{name}\0{folder}"


def select(
    query: Query,
    ordered: Sequence[str],
    needs: Graph,
    limits: Iterable[FilterResult] = (),
    known: Collection[str] | None = None,
) -> tuple[Selection, tuple[Problem, ...]]:
    """Return the nodes that `query` and `limits` keep, in topological order, and warnings.

    As in colcon, each option only deselects packages. Unknown names are warnings for --packages-select, -skip
    and -ignore, unless the query is strict; for options that cannot work without them, such as
    --packages-up-to, SelectionError is raised. `known` contains all names in the workspace, including ignored
    ones.
    """
    names = frozenset(map(name_of, ordered)) if known is None else frozenset(known)
    doubts = tuple(_doubts(query, names))
    raise_if_any((*_faults(query, names), *(doubts if query.strict else ())), SelectionError)
    left_out: dict[str, str] = {}
    by_name = ((reason, frozenset(_nodes(kept, ordered))) for reason, kept in limits)
    for reason, kept in (*_filters(query, ordered, needs), *by_name):
        for node in ordered:
            if node not in kept:
                left_out.setdefault(node, reason)
    return Selection(tuple(node for node in ordered if node not in left_out), left_out), doubts


def ignored(query: Query, names: Iterable[str]) -> frozenset[str]:
    """Return the names that --packages-ignore and --packages-ignore-regex match."""
    return frozenset(name for name in names if _named(name, query.ignore, query.ignore_regex))


def _filters(query: Query, ordered: Sequence[str], needs: Graph) -> Iterator[FilterResult]:
    if query.skip or query.skip_regex:
        gone = {node for node in ordered if _named(node, query.skip, query.skip_regex)}
        yield "named by --packages-skip", frozenset(ordered) - gone
    if query.select is not None or query.select_regex is not None:
        by_name, patterns = query.select or (), query.select_regex or ()
        chosen = frozenset(node for node in ordered if _named(node, by_name, patterns))
        yield "not named by --packages-select", chosen
    nodes = frozenset(ordered)
    if query.up_to:
        yield "not a dependency of --packages-up-to", closure(needs, _nodes(query.up_to, ordered))
    if query.up_to_regex:
        wanted = [node for node in ordered if _fits(name_of(node), query.up_to_regex)]
        yield "not a dependency of --packages-up-to-regex", closure(needs, wanted)
    if query.above:
        yield "does not depend on --packages-above", closure(reverse(needs), _nodes(query.above, ordered))
    if query.above_and_dependencies:
        above = closure(reverse(needs), _nodes(query.above_and_dependencies, ordered))
        yield (
            "neither a dependent of --packages-above-and-dependencies nor a dependency of one",
            closure(needs, above),
        )
    if query.above_depth[1]:
        depth, names = query.above_depth
        kept = _near(reverse(needs), _nodes(names, ordered), depth)
        yield "not within --packages-above-depth", kept
    below = closures(needs, ordered) if query.select_by_dep or query.skip_by_dep else {}
    if query.select_by_dep:
        by = frozenset(_nodes(query.select_by_dep, ordered))
        yield "does not depend on --packages-select-by-dep", frozenset(n for n in nodes if below[n] & by)
    if query.skip_by_dep:
        by = frozenset(_nodes(query.skip_by_dep, ordered))
        yield "depends on --packages-skip-by-dep", frozenset(n for n in nodes if not below[n] & by)
    if query.skip_up_to:
        skipped = closure(needs, _nodes(query.skip_up_to, ordered))
        yield "dependency of --packages-skip-up-to", nodes - skipped
    if query.start or query.end:
        positions = {
            name: [i for i, node in enumerate(ordered) if name_of(node) == name]
            for name in (query.start, query.end)
            if name
        }
        first = min(positions.get(query.start or "", ()), default=0)
        last = max(positions.get(query.end or "", ()), default=len(ordered) - 1)
        if last < first:
            message = f"--packages-end '{query.end}' comes before --packages-start '{query.start}'"
            raise SelectionError(Problem(message, hint="'forge list -t' prints the order"))
        yield "outside of --packages-start and --packages-end", frozenset(ordered[first : last + 1])


def _named(node: str, names: Collection[str], patterns: Iterable[str]) -> bool:
    return name_of(node) in names or _fits(name_of(node), patterns)


def _nodes(names: Collection[str], ordered: Sequence[str]) -> list[str]:
    return [node for node in ordered if name_of(node) in names]


def _near(dependents: Graph, nodes: Iterable[str], depth: int) -> frozenset[str]:
    found = layer = frozenset(nodes)
    for _ in range(depth):
        layer = frozenset[str]().union(*(dependents[node] for node in layer)) - found
        if not layer:
            break
        found |= layer
    return found


def _fits(name: str, patterns: Iterable[str]) -> bool:
    return any(re.match(pattern, name) for pattern in patterns)


def _faults(query: Query, known: frozenset[str]) -> Iterator[Problem]:
    """Yield unknown names of options that require them."""
    yield from _unknown("--packages-up-to", query.up_to, known)
    yield from _unfitting("--packages-up-to-regex", query.up_to_regex, known)
    yield from _unknown("--packages-above", query.above, known)
    yield from _unknown("--packages-above-and-dependencies", query.above_and_dependencies, known)
    yield from _unknown("--packages-above-depth", query.above_depth[1], known)
    yield from _unknown("--packages-start", filter(None, (query.start,)), known)
    yield from _unknown("--packages-end", filter(None, (query.end,)), known)


def _doubts(query: Query, known: frozenset[str]) -> Iterator[Problem]:
    """Yield unknown names of options that can ignore them."""
    yield from _unknown("--packages-select", query.select or (), known)
    yield from _unknown("--packages-skip", query.skip, known)
    yield from _unfitting("--packages-select-regex", query.select_regex or (), known)
    yield from _unfitting("--packages-skip-regex", query.skip_regex, known)
    yield from _unknown("--packages-ignore", query.ignore, known)
    yield from _unfitting("--packages-ignore-regex", query.ignore_regex, known)
    if query.strict:
        yield from _unknown("--packages-select-by-dep", query.select_by_dep, known)
        yield from _unknown("--packages-skip-by-dep", query.skip_by_dep, known)
        yield from _unknown("--packages-skip-up-to", query.skip_up_to, known)


def _unknown(option: str, names: Iterable[str], known: frozenset[str]) -> Iterator[Problem]:
    for name in names:
        if name not in known:
            message = f"{option}: no package named '{name}' in the workspace"
            yield Problem(message, hint=did_you_mean(name, known))


def _unfitting(option: str, patterns: Iterable[str], known: frozenset[str]) -> Iterator[Problem]:
    for pattern in patterns:
        if not any(re.match(pattern, name) for name in known):
            hint = f"patterns match from the beginning of a name; to match anywhere use '.*{pattern}'"
            yield Problem(f"{option} '{pattern}' matches no package", hint=hint)
