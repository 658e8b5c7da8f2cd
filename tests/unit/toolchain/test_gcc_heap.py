"""How much memory C++ compilers may use before they collect garbage."""

from __future__ import annotations

import pytest

from forge.base.layout import templates_folder
from forge.toolchain.resources import CXX_LAUNCHER, HEAP_VARIABLE, Memory, gcc_heap

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
def test_all_compilers_together_use_at_most_a_quarter_of_the_memory(
    total: int, jobs: int, mib: int | None
) -> None:
    found = gcc_heap(Memory(total, 0), jobs)
    assert found.get(HEAP_VARIABLE) == (str(mib << 10) if mib else None)
    assert (CXX_LAUNCHER in found) == (mib is not None)
    assert 2 * (mib or 0) * (1 << 20) * jobs <= total / 4


def test_without_known_memory_gcc_decides() -> None:
    assert gcc_heap(None, 2) == {}


def test_a_path_that_the_shell_would_split_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("forge.toolchain.resources.templates_folder", lambda: templates_folder() / "a folder")
    assert gcc_heap(Memory(64 * GIB, 0), 2) == {}
