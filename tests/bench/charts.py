"""Charts for the page: where each bar and each line goes, as finished numbers and strings for a template."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from tests.bench.figures import SUBJECT, Case
from tests.bench.growth import Growth

Chart = dict[str, Any]
"""The names that a template in templates/ uses."""

WIDTH, ROW, COLORS, MOST_ROWS = 800, 20, 8, 48
LABELS, NUMBERS, TOP = 370, 62, 26
"""In a chart of ratios: where bars begin, what is left for the longest one's number, the axis' height."""
PLOT, LEGEND = (64, 14, 500, 320), 520
"""Left, top, right and bottom of the picture of growth; where its legend begins."""
TIMES_TOP, TIMES_LABELS, TIMES_NUMBERS, PANEL_GAP = 34, 330, 90, 16


def times(title: str, tasks: Sequence[tuple[str, Sequence[tuple[str, float, str]]]]) -> Chart | None:
    """Return the chart of tasks, each with tools, their times and these as text; None without tasks."""
    drawn: list[Chart] = []
    y = TIMES_TOP
    longest = max((value for _, tools in tasks for _, value, _ in tools), default=1.0)
    for words, tools in tasks:
        for number, (tool, value, text) in enumerate(tools):
            width = round(max((WIDTH - TIMES_NUMBERS - TIMES_LABELS) * value / longest, 1), 1)
            drawn.append(
                {
                    "task": "" if number else words,
                    "tool": tool,
                    "y": y,
                    "width": width,
                    "number": text,
                    "number_x": round(TIMES_LABELS + width + 6, 1),
                    "kind": "forge" if tool == SUBJECT else "other",
                }
            )
            y += ROW
        y += PANEL_GAP
    chart = {"title": title, "width": WIDTH, "height": y - PANEL_GAP + 4, "labels": TIMES_LABELS}
    return {**chart, "bars": drawn} if drawn else None


def bars(title: str, cases: Iterable[Case]) -> Chart | None:
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
    one, before, drawn = scale.at(1), "", []
    for index, (label, peer, spread) in enumerate(rows):
        end = scale.at(spread.middle)
        drawn.append(
            {
                "label": "" if label == before else label,
                "peer": peer,
                "y": TOP + ROW * index,
                "x": round(min(one, end), 1),
                "width": round(max(abs(end - one), 1), 1),
                "low": round(scale.at(spread.low), 1),
                "high": round(scale.at(spread.high), 1),
                "number": ratio(spread.middle),
                "number_x": round(max(one, end, scale.at(spread.high)) + 5, 1),
                "kind": "slower" if spread.middle >= 1 else "faster",
            }
        )
        before = label
    return {
        "title": title,
        "width": WIDTH,
        "height": TOP + ROW * len(rows) + 8,
        "labels": LABELS,
        "one": round(one, 1),
        "bars": drawn,
        "ticks": [{"at": round(scale.at(x), 1), "label": _power(x)} for x in _powers(low, high)],
    }


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


def ratio(value: float) -> str:
    """Return a ratio with the digits that a reader can use."""
    return f"{value:.0f}" if value >= 20 else f"{value:.1f}" if value >= 2 else f"{value:.2f}"


def lines(title: str, growths: Sequence[tuple[str, Growth]]) -> Chart | None:
    """Return the chart of medians by size, both as powers; None where nothing grows."""
    if not growths:
        return None
    xs, ys = zip(*(point for _, growth in growths for point in growth.points), strict=True)
    left, top, right, bottom = PLOT
    across, up = _Scale(min(xs), max(xs), left, right), _Scale(min(ys), max(ys), bottom, top)
    drawn = []
    for number, (label, growth) in enumerate(growths):
        points = [(round(across.at(x), 1), round(up.at(y), 1)) for x, y in growth.points]
        drawn.append(
            {
                "label": f"{label}: {growth.exponent:.2f}",
                "path": "M" + " L".join(f"{x} {y}" for x, y in points),
                "points": points,
                "label_y": top + 10 + 18 * number,
                "color": number % COLORS,
                "dashed": number >= COLORS,  # more lines than colors
            }
        )
    return {
        "title": title,
        "width": WIDTH,
        "height": max(bottom + 30, top + 18 * len(growths) + 10),
        "lines": drawn,
        "xs": [{"at": round(across.at(x), 1), "label": _power(x)} for x in _powers(min(xs), max(xs))],
        "ys": [{"at": round(up.at(y), 1), "label": _milliseconds(y)} for y in _powers(min(ys), max(ys))],
        "plot": PLOT,
        "legend": LEGEND,
    }


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
