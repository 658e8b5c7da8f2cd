"""Order, closure and cycle."""

from itertools import pairwise

import networkx as nx
from hypothesis import given

from forge.base.graph import closure, closures, find_cycle, order, reduced
from tests.strategies import graphs


@given(graphs())
def test_order_respects_dependencies(graph: dict[str, frozenset[str]]) -> None:
    ordered = order(graph)
    assert ordered is not None
    assert sorted(ordered) == sorted(graph)
    position = {name: index for index, name in enumerate(ordered)}
    assert all(position[need] < position[name] for name, needs in graph.items() for need in needs)


@given(graphs(acyclic=False))
def test_order_fails_only_for_cycles(graph: dict[str, frozenset[str]]) -> None:
    cycle = find_cycle(graph)
    assert (order(graph) is None) == (cycle is not None)
    if cycle:
        assert cycle[0] == cycle[-1]
        assert all(right in graph[left] for left, right in pairwise(cycle))
        edges = [(name, need) for name, needs in graph.items() for need in needs]
        shortest = min(len(found) for found in nx.simple_cycles(nx.DiGraph(edges)))
        assert len(cycle) - 1 == shortest


@given(graphs())
def test_closures_agree_with_networkx(graph: dict[str, frozenset[str]]) -> None:
    picture: nx.DiGraph[str] = nx.DiGraph()
    picture.add_nodes_from(graph)
    picture.add_edges_from((name, need) for name, needs in graph.items() for need in needs)
    found = closures(graph, order(graph) or ())
    for name in graph:
        assert set(found[name]) == nx.descendants(picture, name)
        assert tuple(found[name]) == tuple(each for each in found if each in found[name])
        assert len(found[name]) == len(nx.descendants(picture, name))
        assert closure(graph, [name]) == found[name] | {name}


@given(graphs())
def test_transitive_reduction_agrees_with_networkx(graph: dict[str, frozenset[str]]) -> None:
    ordered = order(graph)
    assert ordered is not None
    picture: nx.DiGraph[str] = nx.DiGraph()
    picture.add_nodes_from(graph)
    picture.add_edges_from((name, need) for name, needs in graph.items() for need in needs if need in graph)
    expected = nx.transitive_reduction(picture)
    found = reduced(graph, ordered)
    assert {name: set(needs) for name, needs in found.items()} == {
        name: set(expected[name]) for name in graph
    }
    # From closures the same comes out.
    assert reduced(closures(graph, ordered), ordered) == found
