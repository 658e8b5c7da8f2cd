"""Warnings of compilers reach the user, whichever build tool relays them."""

from __future__ import annotations

import pytest

from forge.output.package_warnings import CompilerWarnings

WARNING = (
    b"In file included from a.cpp:1:\na.hpp:3:5: warning: unused variable 'x' [-Wunused]\n    3 | int x;\n"
)
OUTPUT = (
    b"[0/2] Re-running CMake...\n-- Configuring done\n",
    b"[1/4] Building CXX object a.cpp.o\n" + WARNING + b"[2/4] Generating docs\nread 3 files\n",
    b"[3/4] Linking CXX executable a\n/usr/bin/ld: warning: x.so not found\n[4/4] Building CXX object b.o\n",
)


def found(*output: bytes) -> bytes:
    warnings = CompilerWarnings()
    for lines in output:
        for line in lines.splitlines(keepends=True):
            warnings.add(line)
    warnings.end_step()
    warnings.add(b"-- Installing: a file\n")
    warnings.end_step()
    return warnings.text


def test_the_output_of_commands_with_warnings_is_kept_whole() -> None:
    assert found(*OUTPUT) == WARNING + b"/usr/bin/ld: warning: x.so not found\n"


@pytest.mark.parametrize(
    ("line", "count"),
    [
        (b"a.c:1:2: \x1b[01;35m\x1b[Kwarning: \x1b[m\x1b[Kunused", 1),
        (b"-- no warning: all is well", 0),
        (b"a.c:1:2: note: here", 0),
    ],
)
def test_coloured_warnings_are_found(line: bytes, count: int) -> None:
    assert found(b"[1/1] c\n" + line + b"\n").count(line) == count


def test_output_before_the_first_command_and_beyond_the_limit_is_left_out() -> None:
    assert found(b"a.c:1:2: warning: old\n") == b""
    many = found(b"".join(b"[%d/999] c\na.c:%d: warning: %s\n" % (n, n, b"x" * 9999) for n in range(200)))
    assert len(many) < 1_100_000
