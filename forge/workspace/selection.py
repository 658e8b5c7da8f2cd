"""Selects packages by options; a listing's duplicates are nodes: name, NUL character and folder."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from forge.base.errors import Problem, SelectionError, raise_if_any
from forge.base.extensions import OPTIONS, find
from forge.base.frozen import frozen
from forge.base.graph import closure, closures, reverse
from forge.base.names import did_you_mean
from forge.base.options import flag, option, options_of
from forge.workspace.model import Package, Selection

Graph = Mapping[str, frozenset[str]]

FilterResult = tuple[str, frozenset[str]]
"""The reason for leaving out other packages, and the names that are kept."""


# A leading space protects names that start with a dash.
_NAME: Mapping[str, Any] = {"parse": str.lstrip, "metavar": "PKG"}


def _names(help: str, *, default: tuple[str, ...] | None = (), **more: Any) -> Any:
    return option(help, default=default, nargs="*", **_NAME, **more)


def _pattern(text: str) -> str:
    """Return a regular expression; raises ValueError if it is invalid."""
    try:
        re.compile(text)
    except re.error as error:
        raise ValueError(f"'{text}' is not a valid regular expression: {error}") from None
    return text


def _patterns(help: str, *, default: tuple[str, ...] | None = (), **more: Any) -> Any:
    return option(help, default=default, nargs="*", parse=_pattern, metavar="REGEX", **more)


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
    ignore_user_meta: bool = flag("ignore metadata files in ~/.colcon/metadata")


@frozen
class Query:
    """The package options of a command line; None and () for options that were not given."""

    GROUP = "package selection"
    PREFIX = "--packages-"

    search: SearchPaths = options_of(SearchPaths)
    ignore: tuple[str, ...] = _names(
        "ignore these packages, as if they did not exist", group=SearchPaths.GROUP
    )
    ignore_regex: tuple[str, ...] = _patterns(
        "ignore packages whose name matches one of these patterns", group=SearchPaths.GROUP
    )
    no_test_dependencies: bool = flag(
        "ignore dependencies that only tests need; for build, do not build the tests that need them",
        group=SearchPaths.GROUP,
        flag="--no-test-dependencies",
    )
    select: tuple[str, ...] | None = _names("process only these packages", default=None)
    select_regex: tuple[str, ...] | None = _patterns(
        "process only packages whose name matches one of these patterns (from the beginning of the name)",
        default=None,
    )
    skip: tuple[str, ...] = _names("skip these packages")
    skip_regex: tuple[str, ...] = _patterns("skip packages whose name matches one of these patterns")
    up_to: tuple[str, ...] = _names("process these packages and their recursive dependencies")
    up_to_regex: tuple[str, ...] = _patterns(
        "process packages whose name matches one of these patterns, and their recursive dependencies"
    )
    above: tuple[str, ...] = _names(
        "process these packages and all packages that depend on them, recursively"
    )
    above_and_dependencies: tuple[str, ...] = _names(
        "process these packages, their recursive dependents, and their dependencies"
    )
    select_by_dep: tuple[str, ...] = _names(
        "process only packages that depend on one of these, directly or indirectly"
    )
    skip_by_dep: tuple[str, ...] = _names("skip packages that depend on one of these, directly or indirectly")
    skip_up_to: tuple[str, ...] = _names("skip these packages and their recursive dependencies")
    above_depth: tuple[int, tuple[str, ...]] = option(
        "process these packages and their dependents, up to N levels",
        default=(0, ()),
        nargs="+",
        combine=_depth,
        **{**_NAME, "metavar": ("N", "PKG")},
    )
    start: str | None = option("skip packages before this one in topological order", **_NAME)
    end: str | None = option("skip packages after this one in topological order", **_NAME)
    select_build_failed: bool = flag("process only packages whose last build failed", conflicts="results")
    skip_build_finished: bool = flag("skip packages whose last build succeeded", conflicts="results")
    select_test_failures: bool = flag(
        "process only packages with failures in their last test run", conflicts="results"
    )
    skip_test_passed: bool = flag("skip packages whose last test run passed", conflicts="results")
    select_changed: bool = flag(
        "process only packages with files changed since --since, including untracked files"
    )
    above_changed: bool = flag("process changed packages and all packages that depend on them")
    since: str = option(
        "git revision to compare with (default: HEAD)", default="HEAD", metavar="REV", flag="--since"
    )
    strict: bool = flag(
        "treat unknown package names as errors; for build, also files that two packages install with "
        "different contents",
        flag="--strict",
    )
    select_stopped_tests: bool = False
    """Whether interrupted test runs count as failed."""
    build_base: str = "build"
    """The folder with the results of earlier builds and tests."""
    origin: str = os.curdir
    """The user's folder, relative to the root; the name '.' means the package around it."""

    @property
    def named(self) -> frozenset[str]:
        """Return the names of packages to select, without names matched by regular expressions."""
        ends = (name for name in (self.start, self.end) if name)
        lists = (*(self.select or ()), *self.up_to, *self.above, *self.above_and_dependencies, *ends)
        return frozenset((*lists, *self.above_depth[1]))


_REQUIRED = (
    *("select", "up_to", "up_to_regex", "above", "above_and_dependencies", "above_depth"),
    *("select_by_dep", "start", "end"),
)
"""Options that would select too little if one of their names is unknown."""
_IGNORABLE = ("skip", "select_regex", "skip_regex", "ignore", "ignore_regex")
_STRICT = ("skip_by_dep", "skip_up_to")
"""Options whose unknown names are reported only on demand."""
_BY_RESULTS = ("select_build_failed", "skip_build_finished", "select_test_failures", "skip_test_passed")


def name_of(node: str) -> str:
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
    hint_for: Callable[[str], str | None] = lambda _: None,
) -> tuple[Selection, tuple[Problem, ...]]:
    """Return the nodes that `query` and `limits` keep, in topological order, and warnings.

    As in colcon, each option only deselects packages. Raises SelectionError for unknown names of packages to
    select. Unknown names to skip or ignore, and patterns without a match, are warnings unless the query is
    strict. `known` contains all names in the workspace, including ignored ones; `hint_for` may return the
    reason why a package to select is missing.
    """
    names = frozenset(map(name_of, ordered)) if known is None else frozenset(known)
    doubts = tuple(_unknown(query, _IGNORABLE + (_STRICT if query.strict else ()), names))
    faults = _unknown(query, _REQUIRED, names, hint_for)
    raise_if_any((*faults, *(doubts if query.strict else ())), SelectionError)
    left_out: dict[str, str] = {}
    by_name = ((reason, _matching(ordered, remaining)) for reason, remaining in limits)
    for reason, remaining in (*_filters(query, ordered, needs), *by_name):
        for node in ordered:
            if node not in remaining:
                left_out.setdefault(node, reason)
    return Selection(tuple(node for node in ordered if node not in left_out), left_out), doubts


def ignored(query: Query, names: Iterable[str]) -> frozenset[str]:
    """Return the names that --packages-ignore and --packages-ignore-regex match."""
    return _matching(names, query.ignore, query.ignore_regex)


def _filters(query: Query, ordered: Sequence[str], needs: Graph) -> Iterator[FilterResult]:
    nodes = frozenset(ordered)
    dependents = reverse(needs)
    if query.skip or query.skip_regex:
        yield "named by --packages-skip", nodes - _matching(ordered, query.skip, query.skip_regex)
    if query.select is not None or query.select_regex is not None:
        chosen = _matching(ordered, query.select or (), query.select_regex or ())
        yield "not named by --packages-select", chosen
    if query.up_to:
        yield "not a dependency of --packages-up-to", closure(needs, _matching(ordered, query.up_to))
    if query.up_to_regex:
        wanted = _matching(ordered, (), query.up_to_regex)
        yield "not a dependency of --packages-up-to-regex", closure(needs, wanted)
    if query.above:
        yield "does not depend on --packages-above", closure(dependents, _matching(ordered, query.above))
    if query.above_and_dependencies:
        above = closure(dependents, _matching(ordered, query.above_and_dependencies))
        reason = "neither a dependent of --packages-above-and-dependencies nor a dependency of one"
        yield reason, closure(needs, above)
    if query.above_depth[1]:
        depth, names = query.above_depth
        within_depth = layer = _matching(ordered, names)
        while layer and depth:
            layer = frozenset[str]().union(*(dependents[node] for node in layer)) - within_depth
            within_depth |= layer
            depth -= 1
        yield "not within --packages-above-depth", within_depth
    if query.select_by_dep or query.skip_by_dep:
        below = closures(needs, ordered)
        if query.select_by_dep:
            by = _matching(ordered, query.select_by_dep)
            yield "does not depend on --packages-select-by-dep", frozenset(n for n in nodes if below[n] & by)
        if query.skip_by_dep:
            by = _matching(ordered, query.skip_by_dep)
            yield "depends on --packages-skip-by-dep", frozenset(n for n in nodes if not below[n] & by)
    if query.skip_up_to:
        skipped = closure(needs, _matching(ordered, query.skip_up_to))
        yield "dependency of --packages-skip-up-to", nodes - skipped
    if query.start or query.end:
        names_in_order = list(map(name_of, ordered))
        first = names_in_order.index(query.start) if query.start in names_in_order else 0
        last = len(ordered) - 1
        last -= names_in_order[::-1].index(query.end) if query.end in names_in_order else 0
        if last < first:
            message = f"--packages-end '{query.end}' comes before --packages-start '{query.start}'"
            raise SelectionError(Problem(message, hint="'forge list -t' prints the order"))
        yield "outside of --packages-start and --packages-end", frozenset(ordered[first : last + 1])


def _matching(nodes: Iterable[str], names: Collection[str], patterns: Sequence[str] = ()) -> frozenset[str]:
    """Return the nodes of packages with one of these names, or with a name that matches a pattern."""
    return frozenset(
        node
        for node in nodes
        for name in (name_of(node),)
        if name in names or any(re.match(pattern, name) for pattern in patterns)
    )


def _unknown(
    query: Query,
    fields: Iterable[str],
    known: frozenset[str],
    hint_for: Callable[[str], str | None] = lambda _: None,
) -> Iterator[Problem]:
    """Yield a problem for each name or pattern in these fields of the query that matches no package."""
    for field in fields:
        option = f"--packages-{field.replace('_', '-')}"
        value = getattr(query, field)
        if field == "above_depth":
            value = value[1]
        for text in (value,) if isinstance(value, str) else value or ():
            if not field.endswith("_regex"):
                if text not in known:
                    # 'forge test' also accepts names without an option.
                    of_option = "" if field == "select" else f"{option}: "
                    message = f"{of_option}no package named '{text}' in the workspace"
                    yield Problem(message, hint=hint_for(text) or did_you_mean(text, known))
            elif not _matching(known, (), (text,)):
                hint = f"patterns match from the beginning of a name; to match anywhere use '.*{text}'"
                yield Problem(f"{option} '{text}' matches no package", hint=hint)


def apply_filters(
    query: Query, root: Path, packages: Mapping[str, Package], needs: Graph
) -> tuple[tuple[FilterResult, ...], tuple[Problem, ...]]:
    """Return what `select` needs as limits, and warnings; raises SelectionError if git finds no changes."""
    warnings: tuple[Problem, ...] = ()
    limits: list[FilterResult] = []
    if any(getattr(query, field) for field in _BY_RESULTS):
        plugin = find(OPTIONS, "packages-select-build-failed", "option")
        limits += plugin.by_results(query, root / query.build_base, packages)
    if query.select_changed or query.above_changed:
        plugin = find(OPTIONS, "packages-select-changed", "option")
        changed, warnings = plugin.changed_packages(root, packages, query.since)
        if query.above_changed:
            changed = closure(reverse(needs), changed)
        limits.append((f"not changed since {query.since}", changed))
    return tuple(limits), warnings
