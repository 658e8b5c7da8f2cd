"""The simulated team: the documentation shows what the program prints. It runs for seconds."""

from __future__ import annotations

from pathlib import Path

from tests.bench.fleet import Fleet
from tests.bench.fleet_page import page

PAGE = Path(__file__).parents[3] / "docs" / "explanation" / "scale.md"


def test_the_page_on_scale_has_the_tables_of_the_simulation() -> None:
    assert page(Fleet()) in PAGE.read_text(encoding="utf-8")
