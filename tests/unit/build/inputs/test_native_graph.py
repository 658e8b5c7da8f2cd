"""The graph of the native build tool, read from texts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from forge.build.inputs.native_graph import cmake_edge

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize("more", ["", "/b/cmake_install.cmake "], ids=["CMake 4.3", "CMake 4.4"])
def test_the_edge_that_reruns_cmake_is_found_with_all_its_outputs(tmp_path: Path, more: str) -> None:
    rules = (
        "build all: phony build.ninja: RERUN_CMAKE\n"
        f"build build.ninja {more}: RERUN_CMAKE | /s/CMakeLists.txt $\n  CMakeCache.txt\n  pool = console\n"
        "build /s/CMakeLists.txt: phony\n"
    )
    (tmp_path / "build.ninja").write_text(rules, encoding="utf-8")
    edge = cmake_edge(tmp_path)
    assert edge.inputs == ("/s/CMakeLists.txt", f"{tmp_path}/CMakeCache.txt")
    assert edge.outputs == (f"{tmp_path}/build.ninja", *more.split())


def test_without_that_edge_nothing_is_said(tmp_path: Path) -> None:
    assert cmake_edge(tmp_path).inputs == ()
