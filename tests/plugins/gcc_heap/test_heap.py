"""The heap of GCC depends on the memory and the number of jobs."""

from pathlib import Path

import pytest

from forge.plugins.gcc_heap.heap import CXX_LAUNCHER, HEAP_VARIABLE, heap_variables
from forge.toolchain.resources import Memory

GIB = 1 << 30


@pytest.mark.parametrize(
    ("total", "jobs", "mib"),
    [
        (64 * GIB, 2, 512),
        (32 * GIB, 16, 256),
        (16 * GIB, 8, 256),
        (16 * GIB, 16, None),
        (4 * GIB, 4, None),
        (4 * GIB, 2, 256),
    ],
)
def test_compilers_together_use_at_most_a_quarter_of_the_memory(
    total: int, jobs: int, mib: int | None
) -> None:
    found = heap_variables(Memory(total, 0), jobs)
    assert found.get(HEAP_VARIABLE) == (str(mib << 10) if mib else None)
    assert (CXX_LAUNCHER in found) == (mib is not None)
    assert 2 * (mib or 0) * (1 << 20) * jobs <= total / 4


def test_gcc_chooses_its_limit_if_memory_is_unknown() -> None:
    assert heap_variables(None, 2) == {}


def test_paths_that_the_shell_would_split_are_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("forge.plugins.gcc_heap.heap.SCRIPT", Path("/a folder/compile_cxx.sh"))
    assert heap_variables(Memory(64 * GIB, 0), 2) == {}
