"""Selects packages by the options of the command line, with reasons for the others.

In listings, packages with the same name are separate nodes: the name, and for all but the first one a NUL
character and the folder. Options apply to all of them.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from forge.base.errors import Problem, SelectionError, raise_if_any
from forge.base.frozen import frozen
from forge.base.graph import closure, closures, reverse
from forge.base.names import did_you_mean
from forge.base.options import option, options_of
from forge.workspace.model import Selection

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    Graph = Mapping[str, frozenset[str]]

FilterResult = tuple[str, frozenset[str]]
"""The reason why other packages are left out, and the names that are kept."""


def _flag(flag: str, help: str, **more: Any) -> Any:
    return option(help, flag=flag, default=False, **more)


# A space shields names that start with a dash.
_NAME: Mapping[str, Any] = {"parse": str.lstrip, "metavar": "PKG"}


def _names(flag: str, help: str, *, default: tuple[str, ...] | None = (), **more: Any) -> Any:
    return option(help, flag=flag, default=default, nargs="*", **_NAME, **more)


def _pattern(text: str) -> str:
    """Return a regular expression; raises ValueError if it is invalid."""
    try:
        re.compile(text)
    except re.error as error:
        raise ValueError(f"'{text}' is not a valid regular expression: {error}") from None
    return text


def _patterns(flag: str, help: str, *, default: tuple[str, ...] | None = (), **more: Any) -> Any:
    return option(help, flag=flag, default=default, nargs="*", parse=_pattern, metavar="REGEX", **more)


def _depth(words: Sequence[str]) -> tuple[int, tuple[str, ...]]:
    """Return the values of --packages-above-depth: a depth and names; raises SelectionError."""
    if not words:
        return 0, ()
    first, *names = words
    if not first.isdecimal():
        message = f"--packages-above-depth expects a number first, not '{first}'"
        raise SelectionError(Problem(message, hint="for example '--packages-above-depth 1 my_package'"))
    return int(first), tuple(names)


@frozen
class SearchPaths:
    """Paths for package discovery, relative to the root, and metadata files."""

    GROUP = "package discovery"

    base_paths: tuple[str, ...] = option(
        "search these folders recursively for packages (default: .)", default=(".",), metavar="PATH"
    )
    paths: tuple[str, ...] = option(
        "use these package folders without searching below them; wildcards such as 'src/*' are allowed",
        default=(),
        metavar="PATH",
    )
    metas: tuple[str, ...] = option(
        "files or folders with options for single packages (default: colcon.meta)",
        default=("colcon.meta",),
        metavar="PATH",
    )
    ignore_user_meta: bool = option("ignore metadata files in ~/.colcon/metadata", default=False)


@frozen
class Query:
    """The package options of a command line; None and () for options that were not given."""

    GROUP = "package selection"
    search: SearchPaths = options_of(SearchPaths)
    ignore: tuple[str, ...] = _names(
        "--packages-ignore", "ignore these packages, as if they did not exist", group=SearchPaths.GROUP
    )
    ignore_regex: tuple[str, ...] = _patterns(
        "--packages-ignore-regex",
        "ignore packages whose name matches one of these patterns",
        group=SearchPaths.GROUP,
    )
    no_test_dependencies: bool = _flag(
        "--no-test-dependencies",
        "ignore dependencies that only tests need; for build, do not build the tests that need them",
        group=SearchPaths.GROUP,
    )
    select: tuple[str, ...] | None = _names("--packages-select", "process only these packages", default=None)
    select_regex: tuple[str, ...] | None = _patterns(
        "--packages-select-regex",
        "process only packages whose name matches one of these patterns (from the beginning of the name)",
        default=None,
    )
    skip: tuple[str, ...] = _names("--packages-skip", "skip these packages")
    skip_regex: tuple[str, ...] = _patterns(
        "--packages-skip-regex", "skip packages whose name matches one of these patterns"
    )
    up_to: tuple[str, ...] = _names(
        "--packages-up-to", "process these packages and their recursive dependencies"
    )
    up_to_regex: tuple[str, ...] = _patterns(
        "--packages-up-to-regex",
        "process packages whose name matches one of these patterns, and their recursive dependencies",
    )
    above: tuple[str, ...] = _names(
        "--packages-above", "process these packages and all packages that depend on them, recursively"
    )
    above_and_dependencies: tuple[str, ...] = _names(
        "--packages-above-and-dependencies",
        "process these packages, their recursive dependents, and their dependencies",
    )
    select_by_dep: tuple[str, ...] = _names(
        "--packages-select-by-dep",
        "process only packages that depend on one of these, directly or indirectly",
    )
    skip_by_dep: tuple[str, ...] = _names(
        "--packages-skip-by-dep", "skip packages that depend on one of these, directly or indirectly"
    )
    skip_up_to: tuple[str, ...] = _names(
        "--packages-skip-up-to", "skip these packages and their recursive dependencies"
    )
    above_depth: tuple[int, tuple[str, ...]] = option(
        "process these packages and their dependents, up to N levels",
        default=(0, ()),
        flag="--packages-above-depth",
        nargs="+",
        combine=_depth,
        **{**_NAME, "metavar": ("N", "PKG")},
    )
    start: str | None = option(
        "skip packages before this one in topological order", flag="--packages-start", **_NAME
    )
    end: str | None = option(
        "skip packages after this one in topological order", flag="--packages-end", **_NAME
    )
    select_build_failed: bool = _flag(
        "--packages-select-build-failed", "process only packages whose last build failed", conflicts="results"
    )
    skip_build_finished: bool = _flag(
        "--packages-skip-build-finished", "skip packages whose last build succeeded", conflicts="results"
    )
    select_test_failures: bool = _flag(
        "--packages-select-test-failures",
        "process only packages with failures in their last test run",
        conflicts="results",
    )
    skip_test_passed: bool = _flag(
        "--packages-skip-test-passed", "skip packages whose last test run passed", conflicts="results"
    )
    select_changed: bool = _flag(
        "--packages-select-changed",
        "process only packages with files changed since --since, including untracked files",
    )
    above_changed: bool = _flag(
        "--packages-above-changed", "process changed packages and all packages that depend on them"
    )
    since: str = option(
        "git revision to compare with (default: HEAD)", default="HEAD", flag="--since", metavar="REV"
    )
    strict: bool = _flag(
        "--strict",
        "treat unknown package names as errors; for build, also files that two packages install with "
        "different contents",
    )
    build_base: str = "build"
    """The folder with the results of earlier builds and tests."""

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
