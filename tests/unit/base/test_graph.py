"""Order, closure and cycle."""

from itertools import pairwise

import networkx as nx
from hypothesis import given
from hypothesis import strategies as st

from forge.base.graph import closure, closures, contracted, find_cycle, order, reduced, reverse
from tests.strategies import graphs


@given(graphs())
def test_everything_comes_after_what_it_needs(graph: dict[str, frozenset[str]]) -> None:
    ordered = order(graph)
    assert ordered is not None
    assert sorted(ordered) == sorted(graph)
    position = {name: index for index, name in enumerate(ordered)}
    assert all(position[need] < position[name] for name, needs in graph.items() for need in needs)


def test_layers_are_sorted_by_name_one_after_the_other() -> None:
    graph = {"z": frozenset[str](), "a": frozenset({"z"}), "b": frozenset[str](), "c": frozenset({"unknown"})}
    assert order(graph) == ("b", "c", "z", "a")


@given(graphs(acyclic=False))
def test_there_is_no_order_exactly_when_there_is_a_cycle(graph: dict[str, frozenset[str]]) -> None:
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
        assert found[name] == nx.descendants(picture, name)
        assert tuple(found.below(name)) == tuple(each for each in found if each in found[name])
        assert len(found.below(name)) == len(found[name])
        assert closure(graph, [name]) == found[name] | {name}


@given(graphs(), st.data())
def test_a_graph_of_some_names_connects_them_as_the_whole_one_does(
    graph: dict[str, frozenset[str]], data: st.DataObject
) -> None:
    some = data.draw(st.sets(st.sampled_from(sorted(graph)))) if graph else set[str]()
    found = contracted(graph, some)
    assert found.keys() == some
    for name in some:
        assert closure(found, [name]) == closure(graph, [name]) & some


def test_names_in_between_are_passed_but_not_those_of_the_graph() -> None:
    graph = {"a": frozenset[str](), "b": frozenset({"a"}), "c": frozenset({"b"}), "d": frozenset({"c"})}
    assert contracted(graph, {"a", "c", "d"}) == {"a": frozenset(), "c": {"a"}, "d": {"c"}}


@given(graphs(acyclic=False))
def test_reversing_twice_is_the_graph(graph: dict[str, frozenset[str]]) -> None:
    assert reverse(reverse(graph)) == graph


@given(graphs())
def test_what_other_needs_imply_is_left_out_as_networkx_does(graph: dict[str, frozenset[str]]) -> None:
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
