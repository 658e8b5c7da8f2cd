"""What a sitting measured: series of variants that took turns, their medians and ratios, and JSON."""

from __future__ import annotations

from dataclasses import dataclass, field
from statistics import median, quantiles
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

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
    """Return what `from_json` reads, and medians for whoever reads the file itself."""
    scenarios = {name: _result_as_json(result) for name, result in results.scenarios.items()}
    return {
        "command": results.command,
        "machine": dict(results.machine),
        "peers": dict(results.peers),
        "scenarios": scenarios,
        "profiles": dict(results.profiles),
    }


def from_json(document: Mapping[str, Any]) -> Results:
    """Return the results that a document holds; raises KeyError when it is none."""
    scenarios = {name: _result_from_json(entry) for name, entry in document["scenarios"].items()}
    return Results(
        machine=document["machine"],
        peers=document["peers"],
        command=document["command"],
        scenarios=scenarios,
        profiles=document.get("profiles", {}),
    )


def _result_as_json(result: Result) -> dict[str, Any]:
    cases = []
    for case in result.cases:
        variants = {name: _series_as_json(series) for name, series in case.series.items()}
        entry = {"name": case.name, "size": case.size, "unit": case.unit, "variants": variants}
        cases.append({**entry, "counts": dict(case.counts)} if case.counts else entry)
    return {
        "date": result.date,
        "seconds": round(result.seconds, 1),
        "load": round(result.load, 2),
        "quick": result.quick,
        "missing": list(result.missing),
        "cases": cases,
    }


def _series_as_json(series: Series) -> dict[str, Any]:
    entry: dict[str, Any] = {"median": _rounded(series.median), "values": list(map(_rounded, series.values))}
    if series.worked:
        entry["worked"] = list(map(_rounded, series.worked))
    if series.peak_mb is not None:
        entry["peak_mb"] = round(series.peak_mb, 1)
    return entry


def _rounded(value: float) -> float:
    """Return a value with the four digits that a measurement may claim."""
    return float(f"{value:.4g}")


def _result_from_json(entry: Mapping[str, Any]) -> Result:
    cases = [
        Case(
            each["name"],
            {name: _series_from_json(series) for name, series in each["variants"].items()},
            each["size"],
            each["unit"],
            each.get("counts", {}),
        )
        for each in entry["cases"]
    ]
    return Result(
        tuple(cases), entry["date"], entry["seconds"], entry["load"], entry["quick"], tuple(entry["missing"])
    )


def _series_from_json(entry: Mapping[str, Any]) -> Series:
    return Series(tuple(entry["values"]), tuple(entry.get("worked", ())), entry.get("peak_mb"))
