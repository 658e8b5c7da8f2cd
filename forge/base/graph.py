"""Topological order, closures and cycles of a graph: a mapping from names to their dependencies."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Set
from contextlib import suppress
from graphlib import CycleError, TopologicalSorter
from itertools import compress
from typing import Any

from forge.base.errors import Problem, WorkspaceError

_BITS = bytes.maketrans(b"01", b"\0\1")


def ordered_names(needs: Mapping[str, frozenset[str]]) -> tuple[str, ...]:
    """Return the topological order; raises WorkspaceError with the shortest cycle."""
    ordered = order(needs)
    if ordered is None:
        cycle = find_cycle(needs) or ()
        hint = "remove one of these dependencies from its package.xml"
        raise WorkspaceError(Problem(f"dependency cycle: {' -> '.join(cycle)}", hint=hint))
    return ordered


def order(needs: Mapping[str, frozenset[str]]) -> tuple[str, ...] | None:
    """Return all names, each after its dependencies, or None if there is a cycle.

    As in colcon, names without open dependencies form a layer, sorted by name; the next layer follows.
    Dependencies that are not keys of the graph are ignored.
    """
    sorter = TopologicalSorter({name: below & needs.keys() for name, below in needs.items()})
    with suppress(CycleError):
        sorter.prepare()
        ordered: list[str] = []
        while layer := sorted(sorter.get_ready()):
            ordered += layer
            sorter.done(*layer)
        return tuple(ordered)
    return None


def reverse(needs: Mapping[str, frozenset[str]]) -> dict[str, frozenset[str]]:
    dependents: dict[str, set[str]] = {name: set() for name in needs}
    for name, dependencies in needs.items():
        for need in dependencies:
            if need in dependents:
                dependents[need].add(name)
    return {name: frozenset(names) for name, names in dependents.items()}


def closure(needs: Mapping[str, frozenset[str]], names: Iterable[str]) -> frozenset[str]:
    """Return the names and their recursive dependencies in the graph."""
    reachable: set[str] = set()
    waiting = [name for name in names if name in needs]
    while waiting:
        name = waiting.pop()
        if name not in reachable:
            reachable.add(name)
            waiting.extend(need for need in needs[name] if need in needs)
    return frozenset(reachable)


class RecursiveDependencies(Set[str]):
    """The recursive dependencies of a name, in topological order: bits of an integer.

    As Python sets, the dependencies of a chain of thousands of packages would take millions of entries.
    """

    __slots__ = ("bits", "place")

    def __init__(self, place: Mapping[str, int], bits: int) -> None:
        self.place = place
        self.bits = bits

    def __iter__(self) -> Iterator[str]:
        return compress(self.place, f"{self.bits:b}"[::-1].encode().translate(_BITS))

    def __len__(self) -> int:
        return self.bits.bit_count()

    def __contains__(self, name: object) -> bool:
        place = self.place.get(name) if isinstance(name, str) else None
        return place is not None and bool(self.bits >> place & 1)

    @classmethod
    def _from_iterable(cls, names: Iterable[Any]) -> frozenset[Any]:
        return frozenset(names)


def closures(needs: Mapping[str, Iterable[str]], ordered: Iterable[str]) -> dict[str, RecursiveDependencies]:
    """Return the recursive dependencies of each name of a topological order, without the name itself."""
    place = {name: number for number, name in enumerate(ordered)}
    dependencies: dict[str, RecursiveDependencies] = {}
    for name in place:
        bits = 0
        for need in needs[name]:
            if need in place:
                bits |= dependencies[need].bits | 1 << place[need]
        dependencies[name] = RecursiveDependencies(place, bits)
    return dependencies


def reduced(needs: Mapping[str, Iterable[str]], ordered: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Return the transitive reduction for the names of a topological order."""
    below = closures(needs, ordered)
    reduction: dict[str, tuple[str, ...]] = {}
    for name, recursive in below.items():
        implied, direct = 0, []
        for need in sorted(set(needs[name]) & recursive, key=recursive.place.__getitem__, reverse=True):
            if not implied >> recursive.place[need] & 1:
                direct.append(need)
                implied |= below[need].bits
        reduction[name] = tuple(reversed(direct))
    return reduction


def weak_edges_on_cycles(
    needs: Mapping[str, frozenset[str]], weak: Mapping[str, frozenset[str]]
) -> dict[str, frozenset[str]]:
    """Return the weak dependencies that lie on a cycle, by the dependent's name."""
    suspects = _unorderable(needs)
    inner = {name: needs[name] & suspects for name in suspects}
    weak_edges = {
        name: frozenset(need for need in inner[name] & weak[name] if name in closure(inner, [need]))
        for name in suspects
    }
    return {name: edges for name, edges in weak_edges.items() if edges}


def find_cycle(needs: Mapping[str, frozenset[str]]) -> tuple[str, ...] | None:
    """Return a shortest cycle as a -> b -> ... -> a (first and last are equal), or None."""
    import networkx as nx

    graph = nx.DiGraph((name, need) for name in sorted(needs) for need in sorted(needs[name]))
    best: tuple[str, ...] = ()
    for start in sorted(_unorderable(needs)):
        lengths = nx.single_source_shortest_path_length(graph, start, len(best) - 2 if best else None)
        end = next((name for name in lengths if graph.has_edge(name, start)), None)
        if end is not None and (not best or lengths[end] < len(best) - 2):
            best = (*nx.shortest_path(graph, start, end), start)
    return best or None


def _unorderable(needs: Mapping[str, frozenset[str]]) -> frozenset[str]:
    """Return the names on cycles or between them, by repeatedly removing sources and sinks."""
    remaining = set(needs)
    for graph in (needs, reverse(needs)):
        changed = True
        while changed:
            free = {name for name in remaining if not graph[name] & remaining}
            remaining -= free
            changed = bool(free)
    return frozenset(remaining)
