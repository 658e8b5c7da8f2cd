"""The dependency graph as a drawing: from a chart to finished strings for SVG and HTML; pure."""

from __future__ import annotations

import re
from html import unescape
from math import sqrt
from typing import TYPE_CHECKING

from forge.durations import duration
from forge.frozen import frozen
from forge.pictures.charts import drawn_needs, printable
from forge.pictures.layering import lay_out
from forge.provision import INTERFACE_GROUP
from forge.selection import name_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from forge.model import Package
    from forge.pictures.charts import Chart
    from forge.pictures.layering import Spot

_KINDS = {"ament_cmake": "cmake", "cmake": "cmake", "ament_python": "python", "python": "python"}
KINDS = {"interfaces": "interfaces", "cmake": "CMake", "python": "Python", "other": "other"}
"""What kinds of packages the legend tells apart."""

_LETTER, _SMALL = 8.4, 11 / 13
"""How wide a usual letter is in the widest of the fonts that may be there; how small times are written."""
_SHARES = {**dict.fromkeys("fijlrt.-()", 0.6), **dict.fromkeys("mwMWQ%@", 1.5)}
_PADDING, _HEIGHT, _TALLEST = 12.0, 26.0, 46.0
_MARGIN, _LEGEND = 24.0, 28.0


@frozen
class Node:
    """A box: its number in the order of building, what it says, its kind, and where it is."""

    number: int
    name: str
    time: str
    kind: str
    layer: int
    x: str
    y: str
    width: str
    height: str
    text_x: str
    time_x: str
    middle: str


@frozen
class Line:
    """A line from a node to the one that needs it, by their numbers, as SVG writes paths."""

    need: int
    user: int
    path: str


@frozen
class Picture:
    """All that a template draws."""

    nodes: tuple[Node, ...]
    lines: tuple[Line, ...]
    kinds: tuple[tuple[str, str], ...]
    """Class and name of the kinds that there are."""
    width: str
    height: str
    legend: str
    """The level at which the kinds are explained, where nothing else does."""
    timed: bool


def drawn(chart: Chart, seconds: Mapping[str, float]) -> Picture:
    """Return the picture of the shown nodes; those that took long to build are tall.

    Lines that others imply are left out, and there are lines over packages that are not shown.
    """
    shown = chart.shown
    needs = drawn_needs(chart)
    times = {node: seconds[name_of(node)] for node in shown if name_of(node) in seconds}
    longest = max(times.values(), default=0.0)
    sizes = {node: _size(node, times, longest) for node in shown}
    layout = lay_out(needs, sizes)
    numbers = {node: number for number, node in enumerate(shown)}
    used = {kind_of(chart.packages[node]) for node in shown}
    return Picture(
        nodes=tuple(
            _node(chart.packages[node], number, layout.spots[node], sizes[node], times.get(node))
            for node, number in numbers.items()
        ),
        lines=tuple(
            Line(numbers[need], numbers[user], _path(points)) for (user, need), points in layout.lines.items()
        ),
        kinds=tuple((kind, word) for kind, word in KINDS.items() if kind in used),
        width=_number(layout.width + 2 * _MARGIN),
        height=_number(layout.height + 2 * _MARGIN + _LEGEND),
        legend=_number(layout.height + 2 * _MARGIN + _LEGEND / 2),
        timed=bool(times),
    )


def facts(chart: Chart, seconds: Mapping[str, float]) -> list[dict[str, object]]:
    """Return what the page tells of each node, in the order of its numbers; `lines` are what is drawn."""
    shown = chart.shown
    numbers = {node: number for number, node in enumerate(shown)}
    needs = drawn_needs(chart)
    found: list[dict[str, object]] = []
    for node in shown:
        package = chart.packages[node]
        took = seconds.get(name_of(node))
        found.append(
            {
                "name": printable(name_of(node)),
                "path": printable(package.path.as_posix()),
                "type": printable(package.type),
                "version": printable(package.manifest.version),
                "description": _said(package.manifest.description),
                "time": None if took is None else duration(took),
                "needs": sorted(numbers[need] for need in chart.needs[node] if need in numbers),
                "lines": sorted(numbers[need] for need in needs[node]),
            }
        )
    return found


def kind_of(package: Package) -> str:
    """Return the kind of a package, one of KINDS."""
    if INTERFACE_GROUP in package.manifest.groups:
        return "interfaces"
    return _KINDS.get(package.build_type, "other")


def _size(node: str, times: Mapping[str, float], longest: float) -> tuple[float, float]:
    name = _width(name_of(node))
    if node not in times or not longest:
        return name + 2 * _PADDING, _HEIGHT
    time = _SMALL * _width(duration(times[node]))
    return name + time + 3 * _PADDING, _HEIGHT + _TALLEST * sqrt(times[node] / longest)


def _said(description: str) -> str:
    """Return the text of a description, which a manifest may have with markup."""
    return printable(" ".join(unescape(re.sub(r"<[^>]*>", "", description)).split()))


def _width(text: str) -> float:
    return sum(_LETTER * _SHARES.get(letter, 1.0 if letter.isascii() else 2.0) for letter in text)


def _node(
    package: Package, number: int, spot: Spot, size: tuple[float, float], seconds: float | None
) -> Node:
    width, height = size
    x, middle = spot.x + _MARGIN, spot.y + _MARGIN
    return Node(
        number=number,
        name=printable(package.name),
        time="" if seconds is None else duration(seconds),
        kind=kind_of(package),
        layer=spot.layer,
        x=_number(x),
        y=_number(middle - height / 2),
        width=_number(width),
        height=_number(height),
        text_x=_number(x + _PADDING),
        time_x=_number(x + width - _PADDING),
        middle=_number(middle),
    )


def _path(points: Sequence[tuple[float, float]]) -> str:
    """Return a line that is level between the first point and the second, curves to the third, and so on."""
    moved = [(x + _MARGIN, y + _MARGIN) for x, y in points]
    words = [f"M{_number(moved[0][0])} {_number(moved[0][1])}"]
    for index, (x, y) in enumerate(moved[1:], 1):
        before = moved[index - 1]
        if index % 2:
            words += [f"H{_number(x)}"] if x != before[0] else []
        else:
            half = _number((before[0] + x) / 2)
            words.append(f"C{half} {_number(before[1])} {half} {_number(y)} {_number(x)} {_number(y)}")
    return "".join(words)


def _number(value: float) -> str:
    """Return a number with one decimal at most."""
    return f"{value:.1f}".removesuffix(".0")
