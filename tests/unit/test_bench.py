"""The bench: every scenario runs, the same workspace for the same seed, and runs that take turns."""

from __future__ import annotations

import json
import os
import sys
import time
from typing import TYPE_CHECKING

import pytest

from tests.bench.__main__ import main
from tests.bench.figures import from_json
from tests.bench.profiles import main as look
from tests.bench.scenarios import SCENARIOS
from tests.bench.target_table import TARGETS
from tests.bench.targets import ByHand, verdicts
from tests.bench.timing import Variant, compare
from tests.bench.trees import watched
from tests.bench.workspaces import (
    SHAPES,
    write_ament_workspace,
    write_interface_workspace,
    write_python_workspace,
    write_workspace,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tests.bench.figures import Results
    from tests.conftest import Forge

WRITERS = (write_workspace, write_ament_workspace, write_python_workspace, write_interface_workspace)
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


def test_a_peer_that_is_missing_is_told(bench: Callable[..., Results], tmp_path: Path) -> None:
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


def texts(root: Path) -> dict[str, str]:
    """Return every file below a folder by its relative path."""
    return {str(p.relative_to(root)): p.read_text(encoding="utf-8") for p in root.rglob("*") if p.is_file()}


def test_a_seed_gives_one_workspace(tmp_path: Path) -> None:
    first, same, other = (
        texts(write_workspace(tmp_path / str(number), 12, files=1, seed=seed))
        for number, seed in enumerate((1, 1, 2))
    )
    assert first == same != other


@pytest.mark.parametrize("write", WRITERS, ids=lambda write: write.__name__)
def test_a_generated_workspace_has_the_asked_number_of_packages(
    forge: Forge, tmp_path: Path, write: Callable[[Path, int], Path]
) -> None:
    root = write(tmp_path / "ws", 25)
    assert len(forge("list", "--names-only", cwd=root).out.split()) == 25


@pytest.mark.parametrize(("shape", "longest"), [("wide", 2), ("deep", 12)])
def test_shapes_are_as_deep_as_they_say(forge: Forge, tmp_path: Path, shape: str, longest: int) -> None:
    assert shape in SHAPES
    root = write_workspace(tmp_path, 12, files=1, shape=shape)
    depths: dict[str, int] = {}
    for line in forge("list", "--topological-order", "--names-only", cwd=root).out.split():
        needs = forge("info", line, cwd=root).out.partition("build:")[2].partition("\n")[0].split()
        depths[line] = 1 + max((depths[need] for need in needs if need in depths), default=0)
    assert max(depths.values()) == longest


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


def test_a_tree_that_has_gone_holds_nothing() -> None:
    with watched(2**22 + 1) as peak:
        time.sleep(0.01)
    assert peak.megabytes is None


@pytest.mark.needs("cmake", "ninja", "g++")
def test_profiles_are_added_to_results(bench: Callable[..., Results], tmp_path: Path) -> None:
    bench("--only", "start-up")
    assert look(["--quick", "--output", str(tmp_path / "results.json")]) == 0
    found = from_json(json.loads((tmp_path / "results.json").read_text(encoding="utf-8")))
    assert len(found.profiles) == 4
    assert all(profile["rows"] for profile in found.profiles.values())
    assert list(found.scenarios) == ["start-up"]
