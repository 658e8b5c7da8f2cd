"""Questions to results, as data: what a target's value is, and which scenario measured it."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import geometric_mean, median
from typing import TYPE_CHECKING

from tests.bench.figures import SUBJECT
from tests.bench.growth import growths

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from tests.bench.figures import Case, Results


@dataclass(frozen=True, slots=True)
class Answer:
    """A value, and what a reader should know of it."""

    value: float
    detail: str = ""


@dataclass(frozen=True, slots=True)
class Question:
    """How a value is computed from the results; the answer is None where something was not measured."""

    scenario: str
    ask: Callable[[Results], Answer | None]


def time_of(scenario: str, case: str, size: int | None = None, variant: str = SUBJECT) -> Question:
    """Ask for a median."""

    def ask(results: Results) -> Answer | None:
        found = _case(results, scenario, case, size, variant)
        return Answer(found.series[variant].median) if found else None

    return Question(scenario, ask)


def times_of(scenario: str, case: str, other: str, size: int | None = None) -> Question:
    """Ask how many times forge's time another one takes."""

    def ask(results: Results) -> Answer | None:
        found = _case(results, scenario, case, size, other)
        return Answer(found.ratios(other).middle) if found else None

    return Question(scenario, ask)


def part_of(scenario: str, case: str, other: str, size: int | None = None) -> Question:
    """Ask which part of another one's time forge takes."""

    def ask(results: Results) -> Answer | None:
        found = _case(results, scenario, case, size, other)
        return Answer(found.ratios(SUBJECT, other).middle) if found else None

    return Question(scenario, ask)


def beyond(scenario: str, case: str, other: str, size: int | None = None) -> Question:
    """Ask by how much forge's time exceeds another one's."""

    def ask(results: Results) -> Answer | None:
        found = _case(results, scenario, case, size, other)
        return Answer(found.beyond(other).middle) if found else None

    return Question(scenario, ask)


def times_beyond(scenario: str, case: str, other: str, floor: str, size: int | None = None) -> Question:
    """Ask how many times forge's time another one takes, less a time that nobody can save."""

    def ask(results: Results) -> Answer | None:
        found = _case(results, scenario, case, size, other)
        if found is None or floor not in found.series:
            return None
        columns = (found.series[name].values for name in (other, SUBJECT, floor))
        return Answer(median((a - c) / (b - c) for a, b, c in zip(*columns, strict=True)))

    return Question(scenario, ask)


def times_without(scenario: str, case: str, other: str, start: str, size: int | None = None) -> Question:
    """Ask how many times another one's time forge takes, less what a start takes."""

    def ask(results: Results) -> Answer | None:
        found = _case(results, scenario, case, size, other)
        if found is None or start not in found.series:
            return None
        columns = (found.series[name].values for name in (SUBJECT, other, start))
        return Answer(median((a - c) / b for a, b, c in zip(*columns, strict=True)))

    return Question(scenario, ask)


def mean_times(scenario: str, beginning: str, other: str) -> Question:
    """Ask for the geometric mean of the ratios of all cases whose names begin so."""

    def ask(results: Results) -> Answer | None:
        ratios = [case.ratios(other).middle for case in _cases(results, scenario, other, beginning)]
        return Answer(geometric_mean(ratios), f"mean of {len(ratios)}") if ratios else None

    return Question(scenario, ask)


def least_times(
    scenario: str, other: str, beginning: str = "", among: Iterable[str] = (), but: Iterable[str] = ()
) -> Question:
    """Ask for the smallest ratio of all cases that begin so, of those `among` or of all `but` some."""
    ends, without = tuple(among), tuple(but)

    def ask(results: Results) -> Answer | None:
        ratios = {
            case.name: case.ratios(other).middle
            for case in _cases(results, scenario, other, beginning)
            if (not ends or case.name.endswith(ends)) and not (without and case.name.endswith(without))
        }
        least = min(ratios, key=ratios.__getitem__, default=None)
        return Answer(ratios[least], least) if least else None

    return Question(scenario, ask)


def most_beyond(scenario: str, other: str, size: int | None = None) -> Question:
    """Ask for the largest excess of forge's time over another one's among all cases of a size."""

    def ask(results: Results) -> Answer | None:
        cases = {case.name for case in _cases(results, scenario, other)}
        measured = {name: _case(results, scenario, name, size, other) for name in cases}
        found = {name: case for name, case in measured.items() if case}
        most = max(found, key=lambda name: found[name].beyond(other).middle, default=None)
        return Answer(found[most].beyond(other).middle, most) if most else None

    return Question(scenario, ask)


def counted(scenario: str, case: str, word: str, size: int | None = None) -> Question:
    """Ask for a count."""

    def ask(results: Results) -> Answer | None:
        found = results.case(scenario, case, size)
        return Answer(found.counts[word]) if found and word in found.counts else None

    return Question(scenario, ask)


def exponent(scenario: str, case: str, least: int = 0) -> Question:
    """Ask for the exponent of growth over all sizes from the least on."""

    def ask(results: Results) -> Answer | None:
        cases = [found for found in _cases(results, scenario, SUBJECT) if (found.size or 0) >= least]
        found = next((each for each in growths(cases) if each.case == case), None)
        return Answer(found.exponent) if found else None

    return Question(scenario, ask)


def _case(results: Results, scenario: str, case: str, size: int | None, variant: str) -> Case | None:
    found = results.case(scenario, case, size)
    return found if found and variant in found.series else None


def _cases(results: Results, scenario: str, variant: str, beginning: str = "") -> Iterator[Case]:
    result = results.scenarios.get(scenario)
    for case in result.cases if result else ():
        if case.name.startswith(beginning) and variant in case.series:
            yield case
