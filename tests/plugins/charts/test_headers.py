"""Times of headers: commands for clang, its traces, and what they add up to."""

import json
import os
from pathlib import Path

import pytest

from forge.plugins.charts.headers import Header, find_clang, for_clang, measure_headers, summarize


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("/usr/bin/c++ -DX -o a.o -c a.cpp", "/x/clang++ -DX a.cpp"),
        ("ccache g++-12 -MD -MT a.o -MF a.d -I y -o a.o -c a.cpp", "/x/clang++ -I y a.cpp"),
        ("sh launch.sh /usr/bin/aarch64-linux-gnu-gcc-12 -c a.c -o a.o && cmake -E touch x", "/x/clang a.c"),
    ],
)
def test_build_commands_are_passed_to_clang_without_launchers_and_outputs(words: str, expected: str) -> None:
    assert [*for_clang(words.split(), "/x/clang++")] == expected.split()


def test_commands_without_a_known_compiler_are_left_out() -> None:
    with pytest.raises(LookupError):
        [*for_clang(["nvcc", "-c", "a.cu"], "clang++")]


def test_a_header_counts_once_per_file_and_nested_templates_are_not_counted_twice() -> None:
    source = [
        {"name": "Source", "ts": 0, "dur": 3_000_000, "args": {"detail": "/x/../inc/a.hpp"}},
        {"name": "Source", "ts": 1_000_000, "dur": 1_000_000, "args": {"detail": "/inc/b.hpp"}},
        {"name": "Source", "ts": 2_000_000, "dur": 500_000, "args": {"detail": "/inc/b.hpp"}},
        {"name": "InstantiateClass", "ts": 4_000_000, "dur": 2_000_000},
        {"name": "InstantiateFunction", "ts": 5_000_000, "dur": 2_000_000},
        {"name": "Total Source", "ts": 0, "dur": 3_000_000},
        {"name": "Total Frontend", "ts": 0, "dur": 8_000_000},
    ]
    found = summarize("clang++", [source, source[:1]], 1)
    assert found.headers == (Header("/inc/a.hpp", 6.0, 2), Header("/inc/b.hpp", 1.5, 1))
    assert (found.files, found.failed) == (2, 1)
    assert (found.total, found.in_headers, found.in_templates) == (8.0, 3.0, 3.0)


@pytest.mark.needs("clang++")
def test_clang_measures_files_that_another_compiler_has_compiled(tmp_path: Path) -> None:
    (tmp_path / "own.hpp").write_text("#include <string>\nstd::string f();\n")
    (tmp_path / "a.cpp").write_text('#include "own.hpp"\nstd::string f() { return {}; }\n')
    (tmp_path / "b.cpp").write_text("no C++\n")
    entries = [
        {
            "directory": str(tmp_path),
            "file": f"{name}.cpp",
            "command": f"/usr/bin/c++ -o {name}.o -c {name}.cpp",
        }
        for name in ("a", "b")
    ]
    (tmp_path / "compile_commands.json").write_text(json.dumps(entries))
    clang = find_clang(os.environ)
    assert clang
    before = sorted(tmp_path.iterdir())
    outputs = [(tmp_path, str(tmp_path / name)) for name in ("a.o", "b.o", "unknown.o")]
    found = measure_headers(outputs, clang, os.environ, 2)
    assert (found.files, found.failed) == (1, 2)
    assert {"own.hpp", "string"} <= {header.path.rpartition("/")[2] for header in found.headers}
    assert sorted(tmp_path.iterdir()) == before
