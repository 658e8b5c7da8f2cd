"""How time grows with size: the exponent of the power of the size that fits the medians best."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

from tests.bench.figures import SUBJECT, Case

ENOUGH = 3
"""Sizes that it takes to speak of growth."""


@dataclass(frozen=True, slots=True)
class Growth:
    """A variant's medians by size, and the exponent that fits them."""

    case: str
    variant: str
    points: tuple[tuple[int, float], ...]

    @property
    def exponent(self) -> float:
        """Return the slope of the line through the logarithms, by least squares; 1 is linear."""
        return _slope(self.points)

    @property
    def last_exponent(self) -> float:
        """Return the slope between the two largest sizes, where what starting costs matters least."""
        return _slope(self.points[-2:])


def growths(cases: Iterable[Case], variants: Sequence[str] = (SUBJECT,)) -> Iterator[Growth]:
    """Yield the growth of each variant of each case that was measured at enough sizes."""
    sized = sorted((case for case in cases if case.size), key=lambda case: (case.name, case.size))
    for name, group in groupby(sized, key=lambda case: case.name):
        members = list(group)
        for variant in variants:
            points = [
                (case.size or 0, case.series[variant].median) for case in members if variant in case.series
            ]
            if len(points) >= ENOUGH:
                yield Growth(name, variant, tuple(points))


def _slope(points: Sequence[tuple[int, float]]) -> float:
    xs, ys = ([math.log(point[axis]) for point in points] for axis in (0, 1))
    middle, height = sum(xs) / len(xs), sum(ys) / len(ys)
    over = sum((x - middle) * (y - height) for x, y in zip(xs, ys, strict=True))
    return over / sum((x - middle) ** 2 for x in xs)
