"""Renders a dependency graph into strings for SVG and HTML templates."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from html import unescape
from itertools import pairwise
from math import sqrt
from typing import Any

from forge.base.text import duration
from forge.plugins.charts.graph_formats import PackageGraph, longest_chain, printable
from forge.plugins.charts.layering import lay_out
from forge.workspace.model import Package
from forge.workspace.resolve import INTERFACE_GROUP
from forge.workspace.selection import name_of

_KINDS = {"ament_cmake": "cmake", "cmake": "cmake", "ament_python": "python", "python": "python"}
KINDS = {"interfaces": "interfaces", "cmake": "CMake", "python": "Python", "other": "other"}
"""Kinds of packages distinguished in the legend."""

_LETTER, _SMALL = 8.4, 11 / 13
"""Width of an average letter in the widest likely font; relative size of times."""
_SHARES = {**dict.fromkeys("fijlrt.-()", 0.6), **dict.fromkeys("mwMWQ%@", 1.5)}
_PADDING, _HEIGHT, _TALLEST = 12.0, 26.0, 46.0
_MARGIN, _LEGEND = 24.0, 28.0


def drawn(
    chart: PackageGraph, graph: Mapping[str, Sequence[str]], seconds: Mapping[str, float]
) -> dict[str, Any]:
    """Return the values of the template for a chart's drawn graph; heights show build times.

    `number` is the index of a box in build order; a line leads from a dependency to its dependent.
    """
    shown = chart.shown
    times = {node: seconds[name_of(node)] for node in shown if name_of(node) in seconds}
    longest = max(times.values(), default=0.0)
    sizes = {node: _size(node, times, longest) for node in shown}
    layout = lay_out(graph, sizes)
    numbers = {node: number for number, node in enumerate(shown)}
    kinds = {node: _kind_of(chart.packages[node]) for node in shown}
    path = critical_path(graph, times)
    steps = {*pairwise(path)}
    nodes = []
    for node, number in numbers.items():
        spot, (width, height) = layout.spots[node], sizes[node]
        x, middle = spot.x + _MARGIN, spot.y + _MARGIN
        nodes.append(
            {
                "number": number,
                "name": printable(name_of(node)),
                "time": duration(times[node]) if node in times else "",
                "kind": kinds[node],
                "layer": spot.layer,
                "critical": node in path,
                "share": f"{100 * times.get(node, 0.0) / longest:.1f}%" if longest else "0%",
                "x": _number(x),
                "y": _number(middle - height / 2),
                "width": _number(width),
                "height": _number(height),
                "text_x": _number(x + _PADDING),
                "time_x": _number(x + width - _PADDING),
                "middle": _number(middle),
            }
        )
    return {
        "nodes": nodes,
        "lines": [
            {
                "need": numbers[need],
                "user": numbers[user],
                "path": _path(points),
                "critical": (need, user) in steps,
            }
            for (user, need), points in layout.lines.items()
        ],
        "kinds": [(kind, word) for kind, word in KINDS.items() if kind in kinds.values()],
        "width": _number(layout.width + 2 * _MARGIN),
        "height": _number(layout.height + 2 * _MARGIN + _LEGEND),
        # The vertical position of the legend, if the page has no other legend.
        "legend": _number(layout.height + 2 * _MARGIN + _LEGEND / 2),
        "timed": bool(times),
        "critical": duration(sum(times[node] for node in path if node in times)) if path else "",
    }


def critical_path(graph: Mapping[str, Sequence[str]], times: Mapping[str, float]) -> tuple[str, ...]:
    """Return the chain of dependent nodes that takes longest to build, () if it has only one."""
    path = longest_chain(graph, times) if times else ()
    return path if len(path) > 1 else ()


def facts(
    chart: PackageGraph, graph: Mapping[str, Sequence[str]], seconds: Mapping[str, float]
) -> list[dict[str, object]]:
    """Return the details of each node for the page, by index; `lines` are the drawn edges."""
    shown = chart.shown
    numbers = {node: number for number, node in enumerate(shown)}
    details: list[dict[str, object]] = []
    for node in shown:
        package = chart.packages[node]
        description = re.sub(r"<[^>]*>", "", package.manifest.description)
        took = seconds.get(name_of(node))
        details.append(
            {
                "name": printable(name_of(node)),
                "path": printable(package.path.as_posix()),
                "type": printable(package.type),
                "version": printable(package.manifest.version),
                "description": printable(" ".join(unescape(description).split())),
                "time": None if took is None else duration(took),
                "needs": sorted(numbers[need] for need in chart.needs[node] if need in numbers),
                "lines": sorted(numbers[need] for need in graph[node]),
            }
        )
    return details


def _kind_of(package: Package) -> str:
    if INTERFACE_GROUP in package.manifest.groups:
        return "interfaces"
    return _KINDS.get(package.build_type, "other")


def _size(node: str, times: Mapping[str, float], longest: float) -> tuple[float, float]:
    name = _width(name_of(node))
    if node not in times or not longest:
        return name + 2 * _PADDING, _HEIGHT
    time = _SMALL * _width(duration(times[node]))
    return name + time + 3 * _PADDING, _HEIGHT + _TALLEST * sqrt(times[node] / longest)


def _width(text: str) -> float:
    return sum(_LETTER * _SHARES.get(letter, 1.0 if letter.isascii() else 2.0) for letter in text)


def _path(points: Sequence[tuple[float, float]]) -> str:
    """Return an SVG path that is level between the first two points, curves to the third, and so on."""
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
    return f"{value:.1f}".removesuffix(".0")
