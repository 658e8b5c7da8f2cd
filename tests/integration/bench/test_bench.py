"""Every benchmark scenario runs: `make quick-bench`."""

import json
import os
from pathlib import Path

import pytest

from tests.bench.__main__ import main
from tests.bench.figures import from_json
from tests.bench.profiles import main as add_profiles
from tests.bench.scenarios import SCENARIOS
from tests.bench.target_table import TARGETS
from tests.bench.targets import ByHand, verdicts

ALL = os.environ.get("FORGE_TEST_BENCH") == "1"
NAMES = tuple(SCENARIOS) if ALL else ("start-up", "list", "completion", "sourcing")
"""All of them build and compile for minutes."""


@pytest.mark.needs("bash", "cmake", "ninja", "g++", "make", "colcon")
def test_each_scenario_runs_and_measures_the_values_of_its_targets(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "environ", os.environ.copy())
    output = tmp_path / "results.json"
    selected = [word for name in NAMES for word in ("--only", name)]
    assert main(["--quick", "--output", str(output), *selected]) == 0
    assert not ALL or add_profiles(["--quick", "--output", str(output)]) == 0
    results = from_json(json.loads(output.read_text(encoding="utf-8")))
    assert list(results.scenarios) == [name for name in SCENARIOS if name in NAMES]
    for name, result in results.scenarios.items():
        assert result.cases or result.missing, name
        assert all(case.series["forge"].median > 0 for case in result.cases), name
    complete = {name for name, result in results.scenarios.items() if not result.missing}
    required = [
        target
        for target in TARGETS
        if not isinstance(target.value, ByHand) and target.value.scenario in complete
        if "growth" not in target.words  # the workspaces of --quick are too small to show any
    ]
    assert [verdict.target.words for verdict in verdicts(required, results) if verdict.met is None] == []
    assert all(profile["rows"] for profile in results.profiles.values())
