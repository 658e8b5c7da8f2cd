"""Layered drawings: packages right of their dependencies, no overlaps, few crossings."""

import random
from collections.abc import Mapping, Sequence
from itertools import combinations, pairwise

from hypothesis import given
from hypothesis import strategies as st

from forge.base.graph import order, reduced
from forge.plugins.charts.drawing import critical_path
from forge.plugins.charts.layering import GraphLayout, lay_out
from tests.strategies import graphs


def laid_out(graph: Mapping[str, frozenset[str]]) -> tuple[GraphLayout, dict[str, tuple[float, float]]]:
    """Return a layout of boxes of different sizes, and these."""
    ordered = order(graph)
    assert ordered is not None
    sizes = {name: (40.0 + 7 * len(name), 20.0 + 5 * (index % 4)) for index, name in enumerate(ordered)}
    return lay_out(reduced(graph, ordered), sizes), sizes


@given(graphs())
def test_packages_are_drawn_to_the_right_of_their_dependencies(graph: dict[str, frozenset[str]]) -> None:
    layout, sizes = laid_out(graph)
    assert layout.spots.keys() == graph.keys()
    for name, needs in graph.items():
        for need in needs:
            assert layout.spots[need].x + sizes[need][0] < layout.spots[name].x
            assert layout.spots[need].layer < layout.spots[name].layer


@given(graphs())
def test_boxes_do_not_overlap_or_leave_the_picture(graph: dict[str, frozenset[str]]) -> None:
    layout, sizes = laid_out(graph)
    boxes = {
        name: (spot.x, spot.y - sizes[name][1] / 2, spot.x + sizes[name][0], spot.y + sizes[name][1] / 2)
        for name, spot in layout.spots.items()
    }
    for left, top, right, bottom in boxes.values():
        assert -1e-6 <= left < right <= layout.width + 1e-6
        assert -1e-6 <= top < bottom <= layout.height + 1e-6
    for first, second in combinations(boxes.values(), 2):
        apart = first[2] < second[0] or second[2] < first[0]
        assert apart or first[3] < second[1] + 1e-6 or second[3] < first[1] + 1e-6


@given(graphs())
def test_edges_go_from_left_to_right(graph: dict[str, frozenset[str]]) -> None:
    layout, sizes = laid_out(graph)
    for (name, need), points in layout.lines.items():
        assert points[0] == (layout.spots[need].x + sizes[need][0], layout.spots[need].y)
        assert points[-1] == (layout.spots[name].x, layout.spots[name].y)
        assert all(before[0] <= after[0] for before, after in pairwise(points))
        level = list(zip(points[::2], points[1::2], strict=False))
        assert all(before[1] == after[1] for before, after in level)


def crossings(layout: GraphLayout) -> int:
    """Count the lines between the same two layers that cross."""
    layers = {name: spot.layer for name, spot in layout.spots.items()}
    ends = [
        (layers[need], layout.spots[need].y, layout.spots[name].y)
        for name, need in layout.lines
        if layers[name] == layers[need] + 1
    ]
    return sum(a[0] == b[0] and (a[1] - b[1]) * (a[2] - b[2]) < 0 for a, b in combinations(ends, 2))


def test_avoidable_edge_crossings_are_removed() -> None:
    # Two combs, their teeth named so that names alone would mix them up.
    teeth: Sequence[str] = [f"{letter}{comb}" for letter in "abcdef" for comb in (1, 2)]
    graph = {"r1": frozenset[str](), "r2": frozenset[str]()}
    graph |= {tooth: frozenset({f"r{tooth[1]}"}) for tooth in teeth}
    graph |= {f"{tooth}_tip": frozenset({tooth}) for tooth in reversed(teeth)}
    layout, _ = laid_out(graph)
    assert crossings(layout) == 0


def test_a_chain_is_drawn_as_a_straight_line() -> None:
    layout, _ = laid_out({"a": frozenset(), "b": frozenset({"a"}), "c": frozenset({"b"})})
    assert len({round(spot.y, 6) for spot in layout.spots.values()}) == 1


def test_unconnected_packages_are_drawn_in_rows_below_the_others() -> None:
    graph = {
        "a": frozenset[str](),
        "b": frozenset({"a"}),
        **{f"lone{i:03}": frozenset[str]() for i in range(40)},
    }
    layout, sizes = laid_out(graph)
    lowest = max(layout.spots[name].y + sizes[name][1] / 2 for name in "ab")
    lone = [spot for name, spot in layout.spots.items() if name.startswith("lone")]
    assert all(spot.y > lowest for spot in lone)
    assert 1 < len({spot.y for spot in lone}) < 20


def test_an_empty_graph_is_drawn_as_an_empty_picture() -> None:
    layout, _ = laid_out({})
    assert (layout.spots, layout.lines, layout.width, layout.height) == ({}, {}, 0.0, 0.0)


def test_layouts_of_large_workspaces_have_no_overlaps_and_are_reproducible() -> None:
    chance = random.Random(7)
    graph: dict[str, frozenset[str]] = {}
    for number in range(400):
        known = list(graph)
        graph[f"p{number}"] = frozenset(chance.sample(known, min(len(known), chance.randrange(4))))
    layout, sizes = laid_out(graph)
    columns: dict[float, list[str]] = {}
    for name, spot in layout.spots.items():
        columns.setdefault(spot.x, []).append(name)
    for names in columns.values():
        for above, below in pairwise(sorted(names, key=lambda name: layout.spots[name].y)):
            gap = layout.spots[below].y - layout.spots[above].y
            assert gap >= (sizes[above][1] + sizes[below][1]) / 2
    again, _ = laid_out({name: frozenset(sorted(needs)) for name, needs in graph.items()})
    assert again == layout


@given(graphs(), st.dictionaries(st.sampled_from("abcdefgh"), st.integers(1, 9)))
def test_the_critical_path_is_the_chain_of_edges_with_the_longest_duration(
    graph: dict[str, frozenset[str]], seconds: dict[str, int]
) -> None:
    ordered = order(graph)
    assert ordered is not None
    lines = reduced(graph, ordered)

    def longest(name: str) -> float:
        return seconds.get(name, 0) + max(map(longest, lines[name]), default=0)

    path = critical_path(lines, seconds)
    assert all(before in lines[after] for before, after in pairwise(path))
    assert len(path) != 1
    if path:
        assert sum(seconds.get(name, 0) for name in path) == max(map(longest, lines))
    assert critical_path(lines, {}) == ()
