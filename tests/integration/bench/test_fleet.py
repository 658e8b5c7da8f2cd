"""The simulated team: the documentation shows what the program prints. It runs for seconds."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "explanation" / "scale.md"


def test_the_page_on_scale_has_the_tables_of_the_simulation() -> None:
    """In a process of its own: it calls nothing of forge, and is three times as fast without coverage."""
    argv = [sys.executable, "-m", "tests.bench.fleet"]
    printed = subprocess.run(argv, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True).stdout
    assert printed
    assert printed in PAGE.read_text(encoding="utf-8")
