"""Questions to results, as data: what a target's value is, and which scenario measured it."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from statistics import geometric_mean, median

from tests.bench.figures import SUBJECT, Case, Results
from tests.bench.growth import growths


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


def _of_case(
    scenario: str, case: str, size: int | None, others: Iterable[str], compute: Callable[[Case], float]
) -> Question:
    """Ask for a value of one case, in which forge and all others have been measured."""

    def ask(results: Results) -> Answer | None:
        found = results.case(scenario, case, size)
        return Answer(compute(found)) if found and {SUBJECT, *others} <= found.series.keys() else None

    return Question(scenario, ask)


def time_of(scenario: str, case: str, size: int | None = None) -> Question:
    """Ask for a median."""
    return _of_case(scenario, case, size, (), lambda found: found.series[SUBJECT].median)


def times_of(scenario: str, case: str, other: str, size: int | None = None) -> Question:
    """Ask how many times forge's time another one takes."""
    return _of_case(scenario, case, size, (other,), lambda found: found.ratios(other).middle)


def part_of(scenario: str, case: str, other: str, size: int | None = None) -> Question:
    """Ask which part of another one's time forge takes."""
    return _of_case(scenario, case, size, (other,), lambda found: found.ratios(SUBJECT, other).middle)


def beyond(scenario: str, case: str, other: str, size: int | None = None) -> Question:
    """Ask by how much forge's time exceeds another one's."""
    return _of_case(scenario, case, size, (other,), lambda found: found.beyond(other).middle)


def times_beyond(scenario: str, case: str, other: str, floor: str, size: int | None = None) -> Question:
    """Ask how many times forge's time another one takes, less a time that nobody can save."""

    def compute(found: Case) -> float:
        columns = (found.series[name].values for name in (other, SUBJECT, floor))
        return float(median((a - c) / (b - c) for a, b, c in zip(*columns, strict=True)))

    return _of_case(scenario, case, size, (other, floor), compute)


def times_without(scenario: str, case: str, other: str, start: str, size: int | None = None) -> Question:
    """Ask how many times another one's time forge takes, less what a start takes."""

    def compute(found: Case) -> float:
        columns = (found.series[name].values for name in (SUBJECT, other, start))
        return float(median((a - c) / b for a, b, c in zip(*columns, strict=True)))

    return _of_case(scenario, case, size, (other, start), compute)


def mean_times(scenario: str, beginning: str, other: str) -> Question:
    """Ask for the geometric mean of the ratios of all cases whose names begin so."""

    def ask(results: Results) -> Answer | None:
        ratios = [case.ratios(other).middle for case in _cases(results, scenario, other, beginning)]
        return Answer(geometric_mean(ratios), f"mean of {len(ratios)}") if ratios else None

    return Question(scenario, ask)


def least_times(
    scenario: str, other: str, beginning: str = "", among: tuple[str, ...] = (), but: tuple[str, ...] = ()
) -> Question:
    """Ask for the smallest ratio of all cases that begin so, of those `among` or of all `but` some."""

    def ask(results: Results) -> Answer | None:
        ratios = {
            case.name: case.ratios(other).middle
            for case in _cases(results, scenario, other, beginning)
            if (not among or case.name.endswith(among)) and not (but and case.name.endswith(but))
        }
        least = min(ratios, key=ratios.__getitem__, default=None)
        return Answer(ratios[least], least) if least else None

    return Question(scenario, ask)


def most_beyond(scenario: str, other: str, size: int | None = None) -> Question:
    """Ask for the largest excess of forge's time over another one's among all cases of a size."""

    def ask(results: Results) -> Answer | None:
        names = {case.name for case in _cases(results, scenario, other)}
        cases = filter(None, (results.case(scenario, name, size) for name in names))
        found = {case.name: case.beyond(other).middle for case in cases if other in case.series}
        most = max(found, key=found.__getitem__, default=None)
        return Answer(found[most], most) if most else None

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


def _cases(results: Results, scenario: str, variant: str, beginning: str = "") -> Iterator[Case]:
    result = results.scenarios.get(scenario)
    for case in result.cases if result else ():
        if case.name.startswith(beginning) and variant in case.series:
            yield case
