"""The bench: every scenario runs, and commands take turns."""

from __future__ import annotations

import json
import os
import sys
from typing import TYPE_CHECKING

import pytest

from tests.bench.__main__ import main
from tests.bench.figures import from_json
from tests.bench.profiles import main as look
from tests.bench.scenarios import SCENARIOS
from tests.bench.target_table import TARGETS
from tests.bench.targets import ByHand, verdicts
from tests.bench.timing import Variant, compare

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tests.bench.figures import Results
QUICK = ("start-up", "list", "completion", "construction", "sourcing", "configure")
NAMES = tuple(SCENARIOS) if os.environ.get("FORGE_TEST_BENCH") == "1" else QUICK
"""All of them build and compile for minutes: make quick-bench."""


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Results]:
    """Run the bench in this process, quickly, and return what it wrote."""

    def run(*argv: str) -> Results:
        monkeypatch.setattr(os, "environ", os.environ.copy())
        output = tmp_path / "results.json"
        assert main(["--quick", "--output", str(output), *argv]) == 0
        return from_json(json.loads(output.read_text(encoding="utf-8")))

    return run


@pytest.mark.needs("bash", "cmake", "ninja", "g++", "make", "colcon")
def test_scenarios_run_and_measure_what_targets_ask_for(bench: Callable[..., Results]) -> None:
    """Sizes apart, which are tiny here: so growth has no answer."""
    results = bench(*(word for name in NAMES for word in ("--only", name)))
    assert list(results.scenarios) == [name for name in SCENARIOS if name in NAMES]
    for name, result in results.scenarios.items():
        assert result.cases or result.missing, name
        assert all(case.series["forge"].median > 0 for case in result.cases), name
    complete = {name for name, result in results.scenarios.items() if not result.missing}
    wanted = [
        target
        for target in TARGETS
        if not isinstance(target.value, ByHand) and target.value.scenario in complete
        if "growth" not in target.words
    ]
    assert wanted
    assert [verdict.target.words for verdict in verdicts(wanted, results) if verdict.met is None] == []


def test_a_missing_peer_is_reported(bench: Callable[..., Results], tmp_path: Path) -> None:
    nowhere = ("--peers", str(tmp_path / "none"), "--debian", str(tmp_path / "none"))
    results = bench("--only", "start-up", *nowhere)
    assert results.scenarios["start-up"].missing == ("colcon-common-extensions",)
    assert list(results.scenarios["start-up"].cases[0].series) == ["forge", "a bare Python"]
    assert results.peers["colcon-common-extensions"] == "missing: make peers"
    assert results.peers["rosidl"].startswith("missing: make debian-peers")


def test_scenarios_that_are_not_measured_again_stay(bench: Callable[..., Results]) -> None:
    first = bench("--only", "start-up").scenarios["start-up"]
    both = bench("--only", "configure").scenarios
    assert list(both) == ["start-up", "configure"]
    assert both["start-up"] == first


def test_variants_take_turns_after_one_turn_that_does_not_count(tmp_path: Path) -> None:
    script = "import sys; open('turns', 'a').write(sys.argv[1])"
    variants = [Variant(name, (sys.executable, "-c", script, name), tmp_path) for name in "AB"]
    series = compare(variants, runs=2)
    assert (tmp_path / "turns").read_text(encoding="utf-8") == "ABABAB"
    assert {name: len(each.values) for name, each in series.items()} == {"A": 2, "B": 2}


def test_a_single_turn_counts(tmp_path: Path) -> None:
    script = "open('turns', 'a').write('x')"
    series = compare([Variant("A", (sys.executable, "-c", script), tmp_path)], runs=1)
    assert (tmp_path / "turns").read_text(encoding="utf-8") == "x"
    assert len(series["A"].values) == 1


def test_what_is_run_before_does_not_count(tmp_path: Path) -> None:
    script = "import os; open('turns', 'a').write(os.environ['WORD'])"
    before = (sys.executable, "-c", "import time; time.sleep(1); open('turns', 'a').write('-')")
    variant = Variant("A", (sys.executable, "-c", script), tmp_path, before, {"WORD": "x"})
    assert variant.run().seconds < 1
    assert (tmp_path / "turns").read_text(encoding="utf-8") == "-x"


def test_work_and_memory_are_those_of_the_whole_tree(tmp_path: Path) -> None:
    """Two programs at a time, started by a third, each hold thirty megabytes and work a while."""
    hold = "import time; kept = bytearray(30_000_000); sum(range(6_000_000)); time.sleep(0.5)"
    script = (
        f"import subprocess, sys; a = [subprocess.Popen([sys.executable, '-c', {hold!r}]) for _ in 'ab']\n"
    )
    taken = Variant("A", (sys.executable, "-c", script + "[x.wait() for x in a]"), tmp_path).run(look=True)
    assert taken.peak_mb is not None
    assert 60 < taken.peak_mb < 120
    assert taken.worked > 0.1


@pytest.mark.needs("cmake", "ninja", "g++")
def test_profiles_are_added_to_results(bench: Callable[..., Results], tmp_path: Path) -> None:
    bench("--only", "start-up")
    assert look(["--quick", "--output", str(tmp_path / "results.json")]) == 0
    found = from_json(json.loads((tmp_path / "results.json").read_text(encoding="utf-8")))
    assert len(found.profiles) == 4
    assert all(profile["rows"] for profile in found.profiles.values())
    assert list(found.scenarios) == ["start-up"]
