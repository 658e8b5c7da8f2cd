"""What the bench makes of figures: medians, ratios, growth, verdicts, charts and the page."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from typing import TYPE_CHECKING

import pytest

from tests.bench import charts, overview
from tests.bench.figures import Case, Result, Results, Series, Spread, as_json, from_json, spread
from tests.bench.growth import growths
from tests.bench.page import DOCS, FIGURES, IMAGES, PAGE, files, main, read, shown
from tests.bench.scenarios import SCENARIOS
from tests.bench.target_table import TARGETS
from tests.bench.targets import ByHand, Target, verdicts

if TYPE_CHECKING:
    from pathlib import Path

FORGE = Series((100.0, 200.0, 400.0), (90.0, 80.0, 70.0), 12.5)
COLCON = Series((1000.0, 1600.0, 2000.0))
CASE = Case("plain CMake", {"forge": FORGE, "colcon": COLCON}, 100)


def results(*cases: Case, scenario: str = "no-op", quick: bool = False) -> Results:
    """Return results of one scenario."""
    result = Result(cases, "2026-11-22 05:00 UTC", 12.0, 0.1, quick, ("ament",))
    return Results({"processors": "2"}, {"colcon": "1"}, "python -m tests.bench", {scenario: result})


def test_ratios_are_of_pairs_and_not_of_medians() -> None:
    assert CASE.ratios("colcon") == Spread(8.0, 6.5, 9.0)
    assert COLCON.median / FORGE.median == 8.0
    uneven = Case("x", {"forge": Series((1.0, 2.0, 9.0)), "colcon": Series((9.0, 2.0, 1.0))})
    assert uneven.ratios("colcon").middle == 1.0


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ((3.0,), Spread(3, 3, 3)),
        ((1.0, 3.0), Spread(2, 1.5, 2.5)),
        ((4.0, 1.0, 2.0, 3.0, 5.0), Spread(3, 2, 4)),
    ],
)
def test_a_spread_is_the_median_between_quartiles(values: tuple[float, ...], expected: Spread) -> None:
    assert spread(values) == expected


def test_results_survive_their_file() -> None:
    found = results(CASE)
    assert from_json(json.loads(json.dumps(as_json(found)))) == found


@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
def test_the_exponent_of_a_power_is_found(power: float) -> None:
    cases = [Case("x", {"forge": Series((3 * size**power,))}, size) for size in (1000, 10, 100)]
    (growth,) = growths(cases)
    assert growth.exponent == pytest.approx(power)
    assert growth.last_exponent == pytest.approx(power)


def test_two_sizes_are_no_growth() -> None:
    assert list(growths([CASE, Case("plain CMake", {"forge": FORGE}, 10)])) == []


@pytest.mark.parametrize(("limit", "met"), [(200, True), (199, False)])
def test_a_verdict_compares_what_is_shown(limit: float, met: bool) -> None:
    words = "nothing changed in 100 packages of 20 files"
    target = next(target for target in TARGETS if target.words == words)
    other = Target(4, words, "<=", limit, "ms", target.value)
    (verdict,) = verdicts([other], results(CASE))
    assert (verdict.measured, verdict.met) == ("200 ms", met)


def test_what_was_not_measured_is_neither_met_nor_missed() -> None:
    asked = [target for target in TARGETS if not isinstance(target.value, ByHand)]
    assert {verdict.met for verdict in verdicts(asked, Results({}, {}, "", {}))} == {None}


def test_targets_name_scenarios_that_there_are() -> None:
    assert {target.value.scenario for target in TARGETS if not isinstance(target.value, ByHand)} <= set(
        SCENARIOS
    )


def test_the_page_shows_medians_ratios_work_and_memory() -> None:
    text = files(results(CASE))[PAGE]
    assert "| plain CMake, 100 packages | forge | 200 ms (150 ms to 300 ms) |  | 80.0 ms | 12 MB |" in text
    assert "|  | colcon | 1.60 s (1.30 s to 1.80 s) | 8.0 (6.5 to 9.0) |  |  |" in text
    assert "Not installed, and therefore not measured: ament." in text
    assert all(f"## {scenario.title}" in text for scenario in SCENARIOS.values())


def test_a_quick_sitting_says_so() -> None:
    assert "its figures mean nothing" in files(results(CASE, quick=True))[PAGE]


def test_charts_are_pictures_that_say_what_they_show() -> None:
    sized = [Case("plain CMake", {**CASE.series}, size) for size in (1, 10, 100)]
    found = files(results(*sized))
    names = {path for path in found if path.endswith(".svg")}
    assert names == {f"{IMAGES}/no-op.svg", f"{IMAGES}/growth.svg"}
    for name in names:
        picture = ET.fromstring(found[name])
        assert picture.find("{http://www.w3.org/2000/svg}title") is not None
        assert "prefers-color-scheme: dark" in found[name]


def test_the_page_opens_with_what_users_do_and_ends_with_the_targets() -> None:
    """Three charts and a table, made from the same figures as the rest; see tests/bench/overview.py."""
    text = files(read(DOCS / FIGURES))[PAGE]
    opening, _, rest = text.partition("## How it is measured")
    assert opening.count("\n![") == len(overview.CHARTS) == 3
    rows = sum(len(tasks) for _, tasks in overview.CHARTS.values())
    assert opening.count("\n| ") > rows
    assert rest.rindex("\n## ") == rest.index("\n## Targets\n")


def test_a_task_that_was_not_measured_is_left_out() -> None:
    found = files(results(Case("ament_cmake, embedded", {"forge": FORGE, "colcon": COLCON}, 100)))
    assert (
        "| Building 100 packages: nothing changed | 200 ms | 1.60 s (colcon) | 8.0 | [no-op](#no-op) |"
        in (found[PAGE])
    )
    assert "one line changed" not in found[PAGE]
    assert f"{IMAGES}/overview-builds.svg" in found
    assert f"{IMAGES}/overview-interfaces.svg" not in found


def test_all_bars_of_a_chart_have_one_scale() -> None:
    chart = charts.times(
        "x", [("a", [("forge", 5, "5 s"), ("colcon", 10, "10 s")]), ("b", [("forge", 1, "")])]
    )
    assert chart
    forge, colcon, alone = chart.bars
    assert forge.width * 2 == colcon.width == alone.width * 10
    assert [bar.task for bar in chart.bars] == ["a", "", "b"]
    assert [bar.kind for bar in chart.bars] == ["forge", "other", "forge"]


def test_bars_begin_at_the_time_of_forge() -> None:
    cases = [Case("a", {"forge": Series((10.0,)), "slow": Series((100.0,)), "quick": Series((1.0,))})]
    chart = charts.bars("x", cases)
    assert chart
    slow, quick = chart.bars
    assert slow.x == chart.one == pytest.approx(quick.x + quick.width, abs=0.2)
    assert slow.width == pytest.approx(quick.width, abs=0.2)
    assert (slow.number, quick.number) == ("10.0", "0.10")


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.5, "ms", "0.50 ms"),
        (1234, "ms", "1.23 s"),
        (45.67, "us", "45.7 µs"),
        (2500, "ns", "2.50 µs"),
        (93, "%", "93.0 %"),
    ],
)
def test_values_have_three_digits(value: float, unit: str, text: str) -> None:
    assert shown(value, unit) == text


def test_the_page_is_what_the_figures_say(tmp_path: Path) -> None:
    """After a new measurement, run `python -m tests.bench.page`."""
    for path, text in files(read(DOCS / FIGURES)).items():
        assert (DOCS / path).read_text(encoding="utf-8") == text, path
    (tmp_path / IMAGES).mkdir(parents=True)
    (tmp_path / IMAGES / "gone.svg").touch()
    assert main(["--docs", str(tmp_path)]) == 0
    assert (tmp_path / PAGE).is_file()
    assert not (tmp_path / IMAGES / "gone.svg").exists()
