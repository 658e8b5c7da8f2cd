"""Computes a layered layout of a dependency graph with few crossings and short edges.

Sugiyama's method: assign layers by longest path, add dummy vertices where edges pass layers, order the
vertices in each layer to reduce crossings, assign coordinates. Edges from the same node share their dummy
vertices, so that a package with fifty dependents has a single edge across the picture. The result is
deterministic.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise

from forge.base.frozen import frozen

Vertex = tuple[str, int]
"""A node by its name and its layer, or its dummy vertex in a layer farther right."""
Columns = Sequence[Sequence[Vertex]]
Ties = Mapping[Vertex, Sequence[Vertex]]

_SWEEPS = 16
_POSITION_PASSES = 10
_GAP = 9.0
"""Vertical distance between nodes."""
_STAND_IN = 3.0
_STRAIGHT = 4.0
"""Weight of a dummy vertex relative to a node when aligning with neighbours."""
_COLUMN_GAP, _WIDEST_GAP, _GAP_PER_LINE = 48.0, 150.0, 1.5
_ROW = 1000.0
"""Minimum width of a row of nodes without edges."""


@frozen
class Spot:
    """The left edge and the vertical center of a node, and its layer."""

    x: float
    y: float
    layer: int


@frozen
class GraphLayout:
    """Positions of nodes, points of edges from a node to its dependencies, and the total size.

    An edge is level from its first point to its second, curves to the third, and so on.
    """

    spots: Mapping[str, Spot]
    lines: Mapping[tuple[str, str], tuple[tuple[float, float], ...]]
    width: float
    height: float


@frozen
class _Graph:
    """The layer of each node, the columns of nodes and dummy vertices, and their neighbours."""

    layer: Mapping[str, int]
    columns: Columns
    left: Ties
    right: Ties

    def is_node(self, vertex: Vertex) -> bool:
        return self.layer[vertex[0]] == vertex[1]


def lay_out(needs: Mapping[str, Sequence[str]], sizes: Mapping[str, tuple[float, float]]) -> GraphLayout:
    """Lay out dependencies in topological order; `sizes` contains widths and heights.

    Nodes without edges are placed in rows below the others.
    """
    needed = {need for dependencies in needs.values() for need in dependencies}
    isolated = [name for name in needs if not needs[name] and name not in needed]
    connected = {name: needs[name] for name in needs if needs[name] or name in needed}
    graph = _layered(connected)
    columns = _with_few_crossings(graph)
    return _beneath(_drawn(columns, _levels(columns, graph, sizes), graph, connected, sizes), isolated, sizes)


def _layered(needs: Mapping[str, Sequence[str]]) -> _Graph:
    layer: dict[str, int] = {}
    last: dict[str, int] = {}
    for name, dependencies in needs.items():
        layer[name] = last[name] = 1 + max((layer[need] for need in dependencies), default=-1)
        last.update({need: max(last[need], layer[name] - 1) for need in dependencies})
    columns: list[list[Vertex]] = [[] for _ in range(1 + max(layer.values(), default=-1))]
    left: dict[Vertex, list[Vertex]] = {}
    for name, first in layer.items():
        left[name, first] = [(need, first - 1) for need in needs[name]]
        left.update({(name, later): [(name, later - 1)] for later in range(first + 1, last[name] + 1)})
        for at in range(first, last[name] + 1):
            columns[at].append((name, at))
    right: dict[Vertex, list[Vertex]] = {vertex: [] for vertex in left}
    for vertex, before in left.items():
        for other in before:
            right[other].append(vertex)
    return _Graph(layer, columns, left, right)


def _with_few_crossings(graph: _Graph) -> Columns:
    """Return the columns in an order with few crossings: the best result of several sweeps."""
    columns = [list(column) for column in graph.columns]
    best, fewest = [list(column) for column in columns], _crossings(columns, graph.right)
    for sweep in range(_SWEEPS):
        forward = sweep % 2 == 0
        ties = graph.left if forward else graph.right
        places: dict[Vertex, float] = {}
        for column in columns if forward else reversed(columns):
            own = _relative(column)
            column.sort(
                key={
                    vertex: _mean([places[other] for other in ties[vertex]], own[vertex]) for vertex in column
                }.__getitem__
            )
            places.update(_relative(column))
        crossings = _crossings(columns, graph.right)
        if crossings < fewest:
            best, fewest = [list(column) for column in columns], crossings
    return best


def _relative(column: Sequence[Vertex]) -> dict[Vertex, float]:
    return {vertex: (index + 0.5) / len(column) for index, vertex in enumerate(column)}


def _crossings(columns: Columns, right: Ties) -> int:
    """Count the crossings between adjacent columns."""
    count = 0
    for column, following in pairwise(columns):
        place = {vertex: index for index, vertex in enumerate(following)}
        above: list[int] = []
        for vertex in column:
            ends = [place[other] for other in right[vertex]]
            count += sum(len(above) - bisect_right(above, end) for end in ends)
            for end in ends:
                insort(above, end)
    return count


def _levels(columns: Columns, graph: _Graph, sizes: Mapping[str, tuple[float, float]]) -> dict[Vertex, float]:
    """Return the vertical position of each vertex, close to its neighbours."""
    heights = {vertex: sizes[vertex[0]][1] if graph.is_node(vertex) else _STAND_IN for vertex in graph.left}
    weights = {vertex: 1.0 if graph.is_node(vertex) else _STRAIGHT for vertex in graph.left}
    levels: dict[Vertex, float] = {}
    for column in columns:
        column_height = sum(heights[vertex] + _GAP for vertex in column)
        _assign_positions(column, [-column_height / 2.0] * len(column), heights, weights, levels)
    for iteration in range(_POSITION_PASSES):
        forward = iteration % 2 == 0
        last = iteration >= _POSITION_PASSES - 2
        for column in columns if forward else reversed(columns):
            preferred_levels = []
            for vertex in column:
                ties = [*graph.left[vertex], *graph.right[vertex]] if last else ()
                side = ties or (graph.left if forward else graph.right)[vertex]
                preferred_levels.append(_mean([levels[other] for other in side], levels[vertex]))
            _assign_positions(column, preferred_levels, heights, weights, levels)
    return levels


def _assign_positions(
    column: Sequence[Vertex],
    preferred_levels: Sequence[float],
    heights: Mapping[Vertex, float],
    weights: Mapping[Vertex, float],
    levels: dict[Vertex, float],
) -> None:
    """Assign positions in a column that minimize the squared distance to the preferred ones without overlaps.

    Relative to a column without gaps, positions must not decrease: neighbours that would share their mean
    (isotonic regression).
    """
    offsets, below = [], 0.0
    for vertex in column:
        offsets.append(below + heights[vertex] / 2.0)
        below += heights[vertex] + _GAP
    blocks: list[tuple[float, float, int]] = []
    for vertex, preferred, offset in zip(column, preferred_levels, offsets, strict=True):
        mean, weight, count = preferred - offset, weights[vertex], 1
        while blocks and blocks[-1][0] >= mean:
            before, heavy, many = blocks.pop()
            mean = (mean * weight + before * heavy) / (weight + heavy)
            weight, count = weight + heavy, count + many
        blocks.append((mean, weight, count))
    means = (mean for mean, _, count in blocks for _ in range(count))
    for vertex, mean, offset in zip(column, means, offsets, strict=True):
        levels[vertex] = mean + offset


def _drawn(
    columns: Columns,
    levels: Mapping[Vertex, float],
    graph: _Graph,
    needs: Mapping[str, Sequence[str]],
    sizes: Mapping[str, tuple[float, float]],
) -> GraphLayout:
    edges = list(_edges(columns, graph, sizes))
    top = min((level - _half(vertex, graph, sizes) for vertex, level in levels.items()), default=0.0)
    bottom = max((level + _half(vertex, graph, sizes) for vertex, level in levels.items()), default=0.0)
    spots = {name: Spot(edges[at][0], levels[name, at] - top, at) for name, at in graph.layer.items()}

    def points(name: str, need: str) -> Iterator[tuple[float, float]]:
        start, end = spots[need], spots[name]
        yield start.x + sizes[need][0], start.y
        yield edges[start.layer][1], start.y
        for layer in range(start.layer + 1, end.layer):
            level = levels[need, layer] - top
            yield from ((edge, level) for edge in edges[layer])
        yield end.x, end.y

    lines = {(name, need): tuple(points(name, need)) for name in needs for need in needs[name]}
    return GraphLayout(spots, lines, edges[-1][1] if edges else 0.0, bottom - top)


def _half(vertex: Vertex, graph: _Graph, sizes: Mapping[str, tuple[float, float]]) -> float:
    return (sizes[vertex[0]][1] if graph.is_node(vertex) else _STAND_IN) / 2.0


def _edges(
    columns: Columns, graph: _Graph, sizes: Mapping[str, tuple[float, float]]
) -> Iterator[tuple[float, float]]:
    """Yield the left and right edge of each column; gaps widen with the number of edges."""
    left = 0.0
    for column in columns:
        right = left + max(sizes[vertex[0]][0] for vertex in column if graph.is_node(vertex))
        yield left, right
        lines = sum(len(graph.right[vertex]) for vertex in column)
        left = right + min(_WIDEST_GAP, _COLUMN_GAP + _GAP_PER_LINE * lines)


def _beneath(
    layout: GraphLayout, names: Iterable[str], sizes: Mapping[str, tuple[float, float]]
) -> GraphLayout:
    """Return the layout with further nodes in rows below."""
    spots = dict(layout.spots)
    widest = max(layout.width, _ROW)
    x, width, top, bottom = 0.0, layout.width, layout.height + (3 * _GAP if spots else 0.0), layout.height
    for name in names:
        wide, high = sizes[name]
        if x and x + wide > widest:
            x, top = 0.0, bottom + _GAP
        spots[name] = Spot(x, top + high / 2.0, 0)
        width, bottom = max(width, x + wide), max(bottom, top + high)
        x += wide + _GAP
    return GraphLayout(spots, layout.lines, width, bottom)


def _mean(values: Sequence[float], default: float) -> float:
    return sum(values) / len(values) if values else default
