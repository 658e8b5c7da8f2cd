"""`python -m tests.bench.page`: make docs/benchmarks.md and its charts of docs/benchmarks.json."""

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import jinja2

from forge.base.files import write_if_changed
from tests.bench import charts, overview
from tests.bench.figures import SUBJECT, Case, Result, Results, Spread, from_json
from tests.bench.growth import Growth, growths
from tests.bench.overview import Task
from tests.bench.profiles import WORDS
from tests.bench.scenarios import SCENARIOS
from tests.bench.target_table import TARGETS
from tests.bench.targets import Verdict, verdicts

DOCS = Path(__file__).parents[2] / "docs"
PAGE, FIGURES, IMAGES = "benchmarks.md", "benchmarks.json", "images/bench"
_TEMPLATES = Path(__file__).parent / "templates"
_MET = {True: "yes", False: "**no**", None: "not measured"}
_NOTHING = Results({}, {}, "", {})
_SECOND = 1000


def files(results: Results) -> dict[str, str]:
    """Return the text of the page and of each chart, by its path below docs/."""
    found = dict(_charts(results))
    names: dict[str, Any] = {
        "command": results.command,
        "quick": any(result.quick for result in results.scenarios.values()),
        "machine": [*results.machine.items(), *results.peers.items()],
        "targets": [_target(verdict) for verdict in verdicts(TARGETS, results)],
        "summary": _summary(verdicts(TARGETS, results)),
        "overview_charts": [
            (title, path)
            for name, (title, _) in overview.CHARTS.items()
            if (path := f"{IMAGES}/{name}.svg") in found
        ],
        "overview": [_overview_row(*row) for row in overview.table(results)],
        "growth_chart": next((path for path in found if path.endswith("growth.svg")), None),
        "growth": [_growth(name, growth) for name, growth in _growths(results, every_variant=True)],
        "profile_words": WORDS,
        "profiles": [{"title": title, **profile} for title, profile in results.profiles.items()],
        "scenarios": [_scenario(name, results.scenarios.get(name), found) for name in SCENARIOS],
    }
    return {PAGE: _render("benchmarks.md.j2", **names), **found}


def _overview_row(title: str, task: Task, case: Case, other: str) -> dict[str, str]:
    times = case.ratios(other).middle
    return {
        "task": f"{title}: {task.words}" if title else task.words,
        "forge": shown(case.series[SUBJECT].median, case.unit),
        "other": f"{shown(case.series[other].median, case.unit)} ({other})",
        "times": charts.ratio(times),
        "scenario": task.scenario,
    }


def _charts(results: Results) -> Iterator[tuple[str, str]]:
    for name, (title, _) in overview.CHARTS.items():
        timed = [
            (
                task.words,
                [
                    (tool, case.series[tool].median, shown(case.series[tool].median, case.unit))
                    for tool in (SUBJECT, *task.others)
                    if tool in case.series
                ],
            )
            for task, case in overview.tasks(name, results)
        ]
        if drawn := charts.times(title, timed):
            yield f"{IMAGES}/{name}.svg", _render("times.svg.j2", chart=drawn)
    for name, result in results.scenarios.items():
        chart = charts.bars(f"{SCENARIOS[name].title}: time beside forge's", _largest(result.cases))
        if chart:
            yield f"{IMAGES}/{name}.svg", _render("bars.svg.j2", chart=chart)
    labelled = [
        (name if len(_MAIN[name]) == 1 else f"{name}, {growth.case.rpartition(', ')[2]}", growth)
        for name, growth in _growths(results)
        if growth.case in _MAIN.get(name, ())
    ]
    if grown := charts.lines("forge's medians by size", labelled):
        yield f"{IMAGES}/growth.svg", _render("lines.svg.j2", chart=grown)


_MAIN: Mapping[str, tuple[str, ...]] = {
    "list": ("list",),
    "completion": ("a package's name",),
    "no-op": ("plain CMake", "ament_python"),
    "one-line": ("one .cpp of a leaf",),
    "cold": ("ament_cmake", "ament_python"),
    "cache-restore": ("compiled packages",),
    "cold-ccache": ("ament_cmake, warm ccache",),
    "one-interface": ("one .msg, forge's generators",),
    "large-interfaces": ("one field",),
    "cold-interfaces": ("packages of 5 messages",),
    "generation": ("Python and C++, from nothing", "Python and C++, one file changed"),
    "sourcing": ("bash",),
}
"""What the picture of growth shows; the table has all."""


def _largest(cases: Iterable[Case]) -> list[Case]:
    """Return each case at the largest size at which it has something beside forge."""
    best: dict[str, Case] = {}
    for case in cases:
        beside = len(case.series) > 1
        if case.name not in best or beside:
            best[case.name] = case
    return list(best.values())


def _growths(results: Results, *, every_variant: bool = False) -> Iterator[tuple[str, Growth]]:
    for name, result in results.scenarios.items():
        variants = [SUBJECT]
        if every_variant:
            variants = list(dict.fromkeys(variant for case in result.cases for variant in case.series))
        for growth in growths(result.cases, variants):
            yield name, growth


def _growth(name: str, growth: Growth) -> dict[str, str]:
    return {
        "scenario": SCENARIOS[name].title,
        "case": growth.case,
        "variant": growth.variant,
        "sizes": f"{', '.join(f'{size:,}' for size, _ in growth.points)} {SCENARIOS[name].per}".strip(),
        "exponent": f"{growth.exponent:.2f}",
        "last": f"{growth.last_exponent:.2f}",
    }


def _target(verdict: Verdict) -> dict[str, object]:
    return {
        "issue": verdict.target.issue,
        "words": verdict.target.words,
        "limit": verdict.target.shown_limit,
        "measured": verdict.measured,
        "met": _MET[verdict.met],
        "where": verdict.where,
    }


def _summary(found: Sequence[Verdict]) -> str:
    met, not_met = (sum(verdict.met is answer for verdict in found) for answer in (True, False))
    return f"Met: {met}; not met: {not_met}; not measured: {len(found) - met - not_met}."


def _scenario(name: str, result: Result | None, found: Mapping[str, str]) -> dict[str, object]:
    scenario = SCENARIOS[name]
    chart = f"{IMAGES}/{name}.svg"
    when = f", {result.date}, in {result.seconds:.0f} s; load before it {result.load:.1f}" if result else ""
    return {
        "name": name,
        "title": scenario.title,
        "notes": scenario.notes,
        "chart": chart if chart in found else "",
        "rows": [row for case in result.cases for row in _rows(case, scenario.per)] if result else [],
        "missing": ", ".join(result.missing) if result else "",
        "when": when,
    }


def _rows(case: Case, per: str) -> Iterator[dict[str, str]]:
    """Yield the variants of a case, as the page shows them."""
    name = case.name
    if case.size is not None:
        name = f"{name}, {case.size:,} {per[: -1 if case.size == 1 else None]}".strip()
    counts = "; ".join(f"{word}: {count:g}" for word, count in case.counts.items())
    for number, (variant, series) in enumerate(case.series.items()):
        spread = series.spread
        each = ""
        if per == "messages" and case.size:
            each = f", {shown(spread.middle / case.size, case.unit)} each"
        compared = variant != SUBJECT and SUBJECT in case.series
        yield {
            "case": f"{name} ({counts})" if counts and number == 0 else name if number == 0 else "",
            "variant": variant,
            "median": _with_quartiles(spread, lambda value: shown(value, case.unit)) + each,
            "ratio": _with_quartiles(case.ratios(variant), charts.ratio) if compared else "",
            "worked": shown(median(series.worked), case.unit) if series.worked else "",
            "memory": f"{series.peak_mb:.0f} MB" if series.peak_mb is not None else "",
        }


def _with_quartiles(spread: Spread, show: Callable[[float], str]) -> str:
    around = "" if spread.low == spread.high else f" ({show(spread.low)} to {show(spread.high)})"
    return show(spread.middle) + around


def shown(value: float, unit: str) -> str:
    """Return a value with its unit, three digits of it."""
    if unit == "%":
        return f"{value:.1f} %"
    units = ("ns", "us", "ms", "s")
    place = units.index(unit)
    while value >= _SECOND and place < len(units) - 1:
        value, place = value / _SECOND, place + 1
    digits = 2 if value < 10 else 1 if value < 100 else 0
    return f"{value:.{digits}f} {units[place].replace('us', 'µs')}"


def _render(template: str, **names: object) -> str:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES),
        undefined=jinja2.StrictUndefined,
        autoescape=jinja2.select_autoescape(("svg.j2",)),
        keep_trailing_newline=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(names)


def read(path: Path) -> Results:
    """Return the results of a file; of none, nothing."""
    return from_json(json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else _NOTHING


def write(results: Results, docs: Path) -> None:
    """Write the page and its charts; remove charts that it has no more."""
    texts = files(results)
    for path, text in texts.items():
        write_if_changed(docs / path, text)
    for chart in (docs / IMAGES).glob("*.svg"):
        if f"{IMAGES}/{chart.name}" not in texts:
            chart.unlink()


def main(argv: Sequence[str] | None = None) -> int:
    """Write the page."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench.page", description=__doc__)
    parser.add_argument("--docs", type=Path, default=DOCS, metavar="FOLDER", help="where the page lives")
    docs = parser.parse_args(argv).docs
    write(read(docs / FIGURES), docs)
    return 0


if __name__ == "__main__":
    sys.exit(main())
