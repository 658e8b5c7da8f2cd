"""Pictures of the dependency graph as text: colcon's matrix and Graphviz' dot (workspace spec 6.4), pure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.graph import closures
from forge.model import BUILD_KINDS, RUN_KINDS, TEST_KINDS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from forge.model import Package

LEGEND = (
    "+ marks the package itself",
    "* marks a package that depends on it directly",
    ". marks a package that depends on it indirectly",
    "",
)
_COLOURS = ((BUILD_KINDS, "#0000ff"), (RUN_KINDS, "#ff0000"), (TEST_KINDS, "#d2b48c"))


def matrix(ordered: Sequence[str], needs: Mapping[str, frozenset[str]]) -> Iterator[str]:
    """Yield a row for each name: which of the columns, in the same order, depend on it."""
    below = closures(needs, ordered)
    width = max((len(name) for name in ordered), default=0) + 2
    for row in ordered:
        cells = (
            "+" if column == row else "*" if row in needs[column] else "." if row in below[column] else " "
            for column in ordered
        )
        yield f"{row:<{width}}{''.join(cells)}".rstrip()


def density(ordered: Sequence[str], needs: Mapping[str, frozenset[str]]) -> float:
    """Return the percentage of dependencies, direct or not, out of all that an order allows."""
    pairs = len(ordered) * (len(ordered) - 1)
    found = sum(len(below & frozenset(ordered)) for below in closures(needs, ordered).values())
    return 200.0 * found / pairs if pairs else 0.0


def dot(
    ordered: Sequence[str], needs: Mapping[str, frozenset[str]], packages: Mapping[str, Package]
) -> Iterator[str]:
    """Yield the lines of a digraph of the direct dependencies, coloured by their category."""
    yield "digraph graphname {"
    for name in reversed(ordered):
        yield f'  "{name}";'
    for name in reversed(ordered):
        for need in sorted(needs[name]):
            if need in needs:
                yield f'  "{name}" -> "{need}" [color="{_colours(packages[name], need)}"];'
    yield "}"


def _colours(package: Package, need: str) -> str:
    """Return a colour per category; an edge that no tag names, such as to an alias, counts as build."""
    found = [colour for kinds, colour in _COLOURS if need in package.manifest.names(kinds)]
    return ":".join(found or [_COLOURS[0][1]])
