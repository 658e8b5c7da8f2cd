"""Charts for the page: where each bar and each line goes, as finished numbers and strings for a template."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tests.bench.figures import SUBJECT

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from tests.bench.figures import Case, Spread
    from tests.bench.growth import Growth

WIDTH = 800
LABELS = 370
"""Where bars begin."""

NUMBERS = 62
"""What is left beside the longest bar for its number."""

ROW = 20
TOP = 26
MOST_ROWS = 48

PLOT = (64, 14, 500, 320)
"""Left, top, right and bottom of the picture of growth."""

LEGEND = 520
COLORS = 8

TIMES_TOP = 34
TIMES_LABELS = 330
TIMES_NUMBERS = 90
PANEL_GAP = 16


@dataclass(frozen=True, slots=True)
class Bar:
    """One peer in one case: a bar from forge's time to the peer's, on a scale of powers."""

    label: str
    peer: str
    y: int
    x: float
    width: float
    low: float
    high: float
    number: str
    number_x: float
    kind: str
    """'slower' than forge or 'faster'."""


@dataclass(frozen=True, slots=True)
class Tick:
    """A place on an axis, and what it says."""

    at: float
    label: str


@dataclass(frozen=True, slots=True)
class Bars:
    """A chart of ratios."""

    title: str
    width: int
    height: int
    labels: int
    """Where the names of cases and peers end."""
    one: float
    """Where forge's own time is."""
    bars: tuple[Bar, ...]
    ticks: tuple[Tick, ...]


@dataclass(frozen=True, slots=True)
class Line:
    """A variant's medians by size."""

    label: str
    path: str
    points: tuple[tuple[float, float], ...]
    label_y: float
    color: int
    dashed: bool
    """Where there are more lines than colors."""


@dataclass(frozen=True, slots=True)
class Lines:
    """A chart of growth."""

    title: str
    width: int
    height: int
    lines: tuple[Line, ...]
    xs: tuple[Tick, ...]
    ys: tuple[Tick, ...]
    plot: tuple[int, int, int, int]
    legend: int


@dataclass(frozen=True, slots=True)
class Time:
    """One tool at one task: a bar from zero. All bars of a chart have one scale."""

    task: str
    """The task, only beside its first bar."""
    tool: str
    y: int
    width: float
    number: str
    number_x: float
    kind: str
    """'forge' or 'other'."""


@dataclass(frozen=True, slots=True)
class Times:
    """A chart of times, task by task."""

    title: str
    width: int
    height: int
    labels: int
    bars: tuple[Time, ...]


def times(title: str, tasks: Sequence[tuple[str, Sequence[tuple[str, float, str]]]]) -> Times | None:
    """Return the chart of tasks, each with tools, their times and these as text; None without tasks."""
    drawn: list[Time] = []
    y = TIMES_TOP
    longest = max((value for _, tools in tasks for _, value, _ in tools), default=1.0)
    for words, tools in tasks:
        for number, (tool, value, text) in enumerate(tools):
            width = round(max((WIDTH - TIMES_NUMBERS - TIMES_LABELS) * value / longest, 1), 1)
            kind = "forge" if tool == SUBJECT else "other"
            end = round(TIMES_LABELS + width + 6, 1)
            drawn.append(Time("" if number else words, tool, y, width, text, end, kind))
            y += ROW
        y += PANEL_GAP
    return Times(title, WIDTH, y - PANEL_GAP + 4, TIMES_LABELS, tuple(drawn)) if drawn else None


def bars(title: str, cases: Iterable[Case]) -> Bars | None:
    """Return the chart of what others take beside forge; None where there is nothing beside it."""
    rows = [
        (case.name if case.size is None else f"{case.name}, {case.size:,}", other, case.ratios(other))
        for case in cases
        for other in case.series
        if SUBJECT in case.series and not other.startswith(SUBJECT)
    ][:MOST_ROWS]
    if not rows:
        return None
    low = min(1.0, *(spread.low for *_, spread in rows))
    high = max(1.0, *(spread.high for *_, spread in rows))
    scale = _Scale(low, high, LABELS, WIDTH - NUMBERS)
    drawn = tuple(_bar(index, row, rows, scale) for index, row in enumerate(rows))
    ticks = tuple(Tick(round(scale.at(power), 1), _power(power)) for power in _powers(low, high))
    return Bars(title, WIDTH, TOP + ROW * len(rows) + 8, LABELS, round(scale.at(1), 1), drawn, ticks)


@dataclass(frozen=True, slots=True)
class _Scale:
    """Places on a logarithmic axis."""

    low: float
    high: float
    left: float
    right: float

    def at(self, value: float) -> float:
        span = math.log(self.high / self.low) or 1.0
        return self.left + (self.right - self.left) * math.log(value / self.low) / span


def _bar(
    index: int, row: tuple[str, str, Spread], rows: Sequence[tuple[str, str, Spread]], scale: _Scale
) -> Bar:
    label, peer, spread = row
    one, end = scale.at(1), scale.at(spread.middle)
    first = index == 0 or rows[index - 1][0] != label
    return Bar(
        label=label if first else "",
        peer=peer,
        y=TOP + ROW * index,
        x=round(min(one, end), 1),
        width=round(max(abs(end - one), 1), 1),
        low=round(scale.at(spread.low), 1),
        high=round(scale.at(spread.high), 1),
        number=ratio(spread.middle),
        number_x=round(max(one, end, scale.at(spread.high)) + 5, 1),
        kind="slower" if spread.middle >= 1 else "faster",
    )


def ratio(value: float) -> str:
    """Return a ratio with the digits that a reader can use."""
    return f"{value:.0f}" if value >= 20 else f"{value:.1f}" if value >= 2 else f"{value:.2f}"


def lines(title: str, growths: Sequence[tuple[str, Growth]]) -> Lines | None:
    """Return the chart of medians by size, both as powers; None where nothing grows."""
    if not growths:
        return None
    points = [point for _, growth in growths for point in growth.points]
    left, top, right, bottom = PLOT
    low_x, high_x = min(x for x, _ in points), max(x for x, _ in points)
    low_y, high_y = min(y for _, y in points), max(y for _, y in points)
    across, up = _Scale(low_x, high_x, left, right), _Scale(low_y, high_y, bottom, top)
    drawn = tuple(_line(number, growths, across, up) for number in range(len(growths)))
    return Lines(
        title,
        WIDTH,
        max(bottom + 30, top + 18 * len(growths) + 10),
        drawn,
        tuple(Tick(round(across.at(x), 1), _power(x)) for x in _powers(low_x, high_x)),
        tuple(Tick(round(up.at(y), 1), _milliseconds(y)) for y in _powers(low_y, high_y)),
        PLOT,
        LEGEND,
    )


def _line(number: int, growths: Sequence[tuple[str, Growth]], across: _Scale, up: _Scale) -> Line:
    label, growth = growths[number]
    points = tuple((round(across.at(x), 1), round(up.at(y), 1)) for x, y in growth.points)
    path = "M" + " L".join(f"{x} {y}" for x, y in points)
    return Line(
        f"{label}: {growth.exponent:.2f}",
        path,
        points,
        PLOT[1] + 10 + 18 * number,
        number % COLORS,
        number >= COLORS,
    )


def _powers(low: float, high: float) -> list[float]:
    """Return the powers of ten in a range, and where there are few of them their halves and fifths, too."""
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    tens = [10.0**power for power in range(first, last + 1)]
    found = [value for value in tens if low * 0.999 <= value <= high * 1.001]
    if len(found) > 2:
        return found
    finer = (factor * ten for ten in tens for factor in (1, 2, 5))
    return [value for value in finer if low * 0.999 <= value <= high * 1.001]


def _power(value: float) -> str:
    return f"{value:,.0f}" if value >= 1 else f"{value:g}"


def _milliseconds(value: float) -> str:
    return f"{value / 1000:g} s" if value >= 1000 else f"{value:g} ms"
