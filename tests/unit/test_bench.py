"""The bench: the same workspace for the same seed, and runs that take turns."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import pytest

from tests.bench import builds, configures, sourcing
from tests.bench.scenarios import SCENARIOS, Peers
from tests.bench.sourcing import source
from tests.bench.timing import Timing, Variant, compare
from tests.bench.workspaces import write_ament_workspace, write_workspace

if TYPE_CHECKING:
    from pathlib import Path

    from tests.conftest import Forge


def texts(root: Path) -> dict[str, str]:
    """Return every file below a folder by its relative path."""
    return {str(p.relative_to(root)): p.read_text(encoding="utf-8") for p in root.rglob("*") if p.is_file()}


def test_a_seed_gives_one_workspace(tmp_path: Path) -> None:
    first, same, other = (
        texts(write_workspace(tmp_path / str(number), 12, files=1, seed=seed))
        for number, seed in enumerate((1, 1, 2))
    )
    assert first == same != other


def test_a_generated_workspace_has_the_asked_number_of_packages(forge: Forge, tmp_path: Path) -> None:
    root = write_workspace(tmp_path / "ws", 25, files=2)
    assert len(forge("list", "--names-only", cwd=root).out.split()) == 25


def test_variants_take_turns_after_one_turn_that_does_not_count(tmp_path: Path) -> None:
    script = "import sys; open('turns', 'a').write(sys.argv[1])"
    variants = [Variant(name, (sys.executable, "-c", script, name), tmp_path) for name in "AB"]
    timings = compare(variants, runs=2)
    assert (tmp_path / "turns").read_text(encoding="utf-8") == "ABABAB"
    assert [(timing.name, len(timing.seconds)) for timing in timings] == [("A", 2), ("B", 2)]


def test_a_reader_gets_milliseconds() -> None:
    assert Timing("A", (0.003, 0.001, 0.002)).as_json() == {
        "median_ms": 2.0,
        "min_ms": 1.0,
        "runs_ms": [3.0, 1.0, 2.0],
    }


def test_every_scenario_has_a_base_to_compare_with(tmp_path: Path) -> None:
    for name, scenario in SCENARIOS.items():
        if name in {"configure", *builds.SCENARIOS, *sourcing.SCENARIOS}:
            continue  # these compare the tools or the packages with each other, or with an empty shell
        (tmp_path / name).mkdir()
        assert scenario(tmp_path / name, Peers(colcon="colcon"))[0].name.startswith("python"), name


@pytest.mark.needs("bash")
def test_shells_are_measured_alone_and_sourcing(tmp_path: Path) -> None:
    variants = source(tmp_path, Peers(), 3)
    assert [variant.name for variant in variants][:2] == ["bash alone", "bash with forge"]
    for variant in variants:
        variant.run()


def test_what_is_run_before_does_not_count(tmp_path: Path) -> None:
    script = "import os; open('turns', 'a').write(os.environ['WORD'])"
    before = (sys.executable, "-c", "import time; time.sleep(1); open('turns', 'a').write('-')")
    variant = Variant("A", (sys.executable, "-c", script), tmp_path, before, {"WORD": "x"})
    assert variant.run()[0] < 1
    assert (tmp_path / "turns").read_text(encoding="utf-8") == "-x"


def test_ament_packages_are_built_by_forge(forge: Forge, tmp_path: Path) -> None:
    root = write_ament_workspace(tmp_path, 3)
    assert len(forge("list", "--names-only", cwd=root).out.split()) == 3


@pytest.mark.needs("cmake", "ninja")
def test_configures_begin_with_nothing_but_the_compilers(tmp_path: Path) -> None:
    variants = configures.configure(tmp_path, Peers())
    assert [variant.name for variant in variants[:2]] == ["plain", "ament"]
    plain_in_cpp = variants[2]
    (plain_in_cpp.cwd / "build.ninja").unlink()
    (plain_in_cpp.cwd / "CMakeFiles" / "left_by_an_earlier_run").touch()
    plain_in_cpp.run()
    assert (plain_in_cpp.cwd / "build.ninja").is_file()
    assert not (plain_in_cpp.cwd / "CMakeFiles" / "left_by_an_earlier_run").exists()
    assert not list(plain_in_cpp.cwd.glob("CMakeFiles/*/CompilerId*")), "CMake examined the compiler again"
