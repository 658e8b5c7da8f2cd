"""Peaks of packages, and whether another one fits."""

import json
from pathlib import Path

import pytest

from forge.build.events import Aborted, Finished
from forge.build.model import BuildInputs, BuildRecord
from forge.plugins.package_memory.measuring import MeasuredMemory
from forge.toolchain.resources import MemoryLimit, memory

GIGA = 1 << 30


def memory_of(tmp_path: Path, text: str = "", **limit: float) -> MeasuredMemory:
    """Return the memory with these stored peaks."""
    file = tmp_path / "memory.json"
    if text:
        file.write_text(text)
    return MeasuredMemory(file, MemoryLimit(**limit) if limit else None)  # type: ignore[arg-type]


def finished(name: str, *, from_empty: bool) -> Finished:
    return Finished(name, 0, 1.0, record=BuildRecord(BuildInputs(), from_empty=from_empty))


def test_a_package_fits_if_memory_remains_for_its_peak_and_the_growth_of_others(tmp_path: Path) -> None:
    machine = memory()
    assert machine is not None
    used = machine.total - machine.available
    peaks = json.dumps({"peaks": {"big": 64 * GIGA, "small": GIGA}})
    limited = memory_of(tmp_path, peaks, size=used + 66 * GIGA)
    assert limited.fits("big", {"unknown"})
    assert limited.fits("unknown", {"big"})
    assert limited.fits("small", {"big"})
    tight = memory_of(tmp_path, size=used + 33 * GIGA)
    assert not tight.fits("big", {"unknown"})
    assert tight.fits("small", {"unknown"})
    # A package that has just started will still grow.
    assert not tight.fits("small", {"big"})
    unlimited = MeasuredMemory(tmp_path / "memory.json", MemoryLimit())
    assert unlimited.fits("big", {"big"})


def test_a_clean_build_replaces_the_peak_and_others_raise_it(tmp_path: Path) -> None:
    learned = memory_of(tmp_path)
    steps: list[tuple[int, Finished | Aborted, int]] = [
        (5, finished("a", from_empty=True), 5),
        (3, finished("a", from_empty=False), 5),
        (9, Finished("a", 1, 1.0), 9),
        (0, finished("a", from_empty=True), 9),  # restored from the cache
        (7, finished("a", from_empty=True), 7),
        (8, Aborted("a", 1.0), 8),
    ]
    for seen, event, peak in steps:
        learned._highest = {"a": seen} if seen else {}
        learned.note(event)
        assert learned.peaks["a"] == peak


@pytest.mark.parametrize("text", ["", "[]", "{", '{"peaks": 3}', '{"peaks": {"a": "x"}}', "[" * 9999])
def test_unreadable_peaks_count_as_unknown(text: str, tmp_path: Path) -> None:
    assert memory_of(tmp_path, text).peaks == {}
