"""Peaks of packages, whether another one fits, and the words of compilers that were killed."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.build.events import Aborted, Finished, Started
from forge.build.model import BuildInputs, BuildRecord
from forge.execution.loop import Scheduler
from forge.execution.memory import PackageMemory, killed_program
from forge.toolchain.resources import MemoryLimit, memory
from tests.strategies import graphs
from tests.unit.execution.test_scheduler import plan_of

GIGA = 1 << 30


def memory_of(tmp_path: Path, text: str = "", **limit: float) -> PackageMemory:
    file = tmp_path / "memory.json"
    if text:
        file.write_text(text)
    return PackageMemory(file, MemoryLimit(**limit) if limit else None)  # type: ignore[arg-type]


def finished(name: str, *, from_empty: bool) -> Finished:
    return Finished(name, 0, 1.0, record=BuildRecord(BuildInputs(), from_empty=from_empty))


@pytest.mark.parametrize(
    ("output", "program"),
    [
        ("c++: fatal error: Killed signal terminated program cc1plus\ncompilation terminated.\n", "cc1plus"),
        ("collect2: fatal error: ld terminated with signal 9 [Killed]\n", "ld"),
        ("clang++: error: unable to execute command: Killed\n", "clang++"),
        ("/usr/lib/cc1plus: out of memory allocating 65536 bytes after a total of 9 bytes\n", "cc1plus"),
        ("virtual memory exhausted: Cannot allocate memory\n", "a program"),
        ("[3/4] Generating x\nKilled\n", "a program"),
        ("/bin/sh: line 1: 4711 Killed                  python3 gen.py\n", "a program"),
        ("a.cpp:3: error: 'Killed' was not declared\n", None),
        ("Killed 3 birds\n", None),
        (
            "error: could not compile `x`\n  process didn't exit successfully (signal: 9, SIGKILL: kill)\n",
            "a program",
        ),
        ("Killed 3 birds\nKilled", "a program"),
        ("", None),
    ],
)
def test_killed_programs_are_recognized(output: str, program: str | None) -> None:
    assert killed_program(output.encode()) == program


@pytest.mark.parametrize(
    "text", [b"x", b"Killed ", b"a signal 9 ", b"(signal: 9", b"\n", b"line 1: 1 Killed"]
)
def test_endless_output_is_read_in_linear_time(text: bytes) -> None:
    """Quadratic time would be minutes."""
    killed_program(text * (1 << 20))


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
    unlimited = PackageMemory(tmp_path / "memory.json", MemoryLimit())
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


@given(graphs(), st.dictionaries(st.sampled_from("abcdefgh"), st.integers(1, 10)))
def test_tasks_start_alongside_others_only_if_they_fit(
    graph: dict[str, frozenset[str]], sizes: dict[str, int]
) -> None:
    """All of them end, also those that never fit: they run alone."""
    plan = plan_of(graph)

    def fits(name: str, running: frozenset[str]) -> bool:
        return sum(sizes.get(other, 1) for other in (name, *running)) <= 8

    scheduler = Scheduler(plan, 0, fits=fits)
    done = []
    while True:
        for event in scheduler.advance():
            assert isinstance(event, Started)
        if not scheduler.running:
            break
        assert len(scheduler.running) == 1 or sum(sizes.get(name, 1) for name in scheduler.running) <= 8
        name = min(scheduler.running)
        scheduler.note(Finished(name, 0, 0.0))
        done.append(name)
    assert sorted(done) == sorted(plan.tasks)
    assert scheduler.held == ()
