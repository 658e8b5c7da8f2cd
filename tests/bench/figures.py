"""What a sitting measured: series of variants that took turns, their medians and ratios, and JSON."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from statistics import median, quantiles
from typing import Any

SUBJECT = "forge"
"""The variant of each case that the others are compared with."""

_LEAST_FOR_QUARTILES = 2


@dataclass(frozen=True, slots=True)
class Spread:
    """The middle of some values, and the quartiles around it."""

    middle: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Series:
    """What one variant took in each of its turns, in the order of the turns."""

    values: tuple[float, ...]
    worked: tuple[float, ...] = ()
    """What processors worked meanwhile, the whole tree of processes together; same unit."""
    peak_mb: float | None = None
    """The most memory that the tree held at a time."""

    @property
    def median(self) -> float:
        """Return the middle of the values."""
        return median(self.values)

    @property
    def spread(self) -> Spread:
        """Return the median and the quartiles."""
        return spread(self.values)


@dataclass(frozen=True, slots=True)
class Case:
    """Variants that took turns at one thing; `size` is what growth is fitted against."""

    name: str
    series: Mapping[str, Series]
    size: int | None = None
    unit: str = "ms"
    counts: Mapping[str, float] = field(default_factory=dict)
    """What was counted, not timed."""

    def ratios(self, other: str, subject: str = SUBJECT) -> Spread:
        """Return how many times the subject's time another one took, pair by pair of turns."""
        pairs = zip(self.series[other].values, self.series[subject].values, strict=True)
        return spread([theirs / ours for theirs, ours in pairs])

    def beyond(self, other: str, subject: str = SUBJECT) -> Spread:
        """Return by how much the subject's time exceeds another's, pair by pair of turns."""
        pairs = zip(self.series[other].values, self.series[subject].values, strict=True)
        return spread([ours - theirs for theirs, ours in pairs])


@dataclass(frozen=True, slots=True)
class Result:
    """What a scenario measured, when, and with how busy a machine."""

    cases: tuple[Case, ...]
    date: str
    seconds: float
    load: float
    """The load average when it began: what others did meanwhile."""
    quick: bool = False
    missing: tuple[str, ...] = ()
    """Peers that the scenario would have measured and that were not there."""


@dataclass(frozen=True, slots=True)
class Results:
    """All that the page shows."""

    machine: Mapping[str, str]
    peers: Mapping[str, str]
    """Each peer's version, or why there is none."""
    command: str
    scenarios: Mapping[str, Result]
    profiles: Mapping[str, Any] = field(default_factory=dict)

    def case(self, scenario: str, name: str, size: int | None = None) -> Case | None:
        """Return a case, or None if it was not measured; a quick sitting's one size stands for all."""
        result = self.scenarios.get(scenario)
        if result is None:
            return None
        for case in result.cases:
            if case.name == name and (result.quick or case.size == size):
                return case
        return None


def spread(values: Sequence[float]) -> Spread:
    """Return the median and the quartiles of values; a single one is all three."""
    if len(values) < _LEAST_FOR_QUARTILES:
        return Spread(values[0], values[0], values[0])
    low, _, high = quantiles(values, n=4, method="inclusive")
    return Spread(median(values), low, high)


def as_json(results: Results) -> dict[str, Any]:
    """Return what `from_json` reads, with medians for whoever reads the file itself."""
    document = asdict(results)
    for name, result in results.scenarios.items():
        document["scenarios"][name] |= {
            "seconds": round(result.seconds, 1),
            "load": round(result.load, 2),
            "cases": [_case_as_json(case) for case in result.cases],
        }
    return document


def _case_as_json(case: Case) -> dict[str, Any]:
    entry = {"name": case.name, "size": case.size, "unit": case.unit}
    variants = {name: _series_as_json(series) for name, series in case.series.items()}
    return {**entry, "variants": variants, **({"counts": dict(case.counts)} if case.counts else {})}


def _series_as_json(series: Series) -> dict[str, Any]:
    """Return a series with the four digits that a measurement may claim."""
    entry = {"median": series.median, "values": series.values, "worked": series.worked}
    rounded: dict[str, Any] = json.loads(
        json.dumps(entry), parse_float=lambda text: float(f"{float(text):.4g}")
    )
    if not series.worked:
        del rounded["worked"]
    return rounded if series.peak_mb is None else {**rounded, "peak_mb": round(series.peak_mb, 1)}


def from_json(document: Mapping[str, Any]) -> Results:
    """Return the results that a document holds; raises KeyError when it is none."""
    scenarios = {}
    for name, entry in document["scenarios"].items():
        cases = tuple(
            Case(
                each["name"],
                {
                    variant: Series(tuple(it["values"]), tuple(it.get("worked", ())), it.get("peak_mb"))
                    for variant, it in each["variants"].items()
                },
                each["size"],
                each["unit"],
                each.get("counts", {}),
            )
            for each in entry["cases"]
        )
        scenarios[name] = Result(**{**entry, "cases": cases, "missing": tuple(entry["missing"])})
    return Results(**{"profiles": {}, **document, "scenarios": scenarios})
