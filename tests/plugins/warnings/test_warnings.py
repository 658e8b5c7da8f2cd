"""Warnings of compilers reach the user, and each kind of warning is shown once."""

import pytest

from forge.build.events import Finished, Output, StepFinished, StepStarted
from forge.plugins.warnings.warnings import CompilerWarnings, RepeatedWarnings
from tests.unit.output.test_console import STEP, report_on, shown

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


def test_output_of_commands_with_warnings_is_kept_completely() -> None:
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


def test_output_before_the_first_command_and_beyond_the_limit_is_omitted() -> None:
    assert found(b"a.c:1:2: warning: old\n") == b""
    many = found(b"".join(b"[%d/999] c\na.c:%d: warning: %s\n" % (n, n, b"x" * 9999) for n in range(200)))
    assert len(many) < 1_100_000


OLD = """CMake Deprecation Warning at {file}:{line} (cmake_minimum_required):
  Compatibility with CMake < 3.10 will be removed from a future version of
  CMake.

  Update the VERSION argument <min> value.
Call Stack (most recent call first):
  {file}:9 (include)


"""
NAMED = """CMake Warning (dev) at CMakeLists.txt:{line} (message):
  The target {name}_node is old, and the package {name}
  is, too.
This warning is for project developers.  Use -Wno-dev to suppress it.

"""


def test_warnings_are_classified_by_their_text() -> None:
    """Regardless of its location, and of line breaks that depend on the package's name."""
    kinds = RepeatedWarnings()
    first = "note\n" + OLD.format(file="CMakeLists.txt", line=1) + NAMED.format(name="my_pkg", line=3)
    assert kinds.take("my_pkg", first.encode()) == first.encode()
    own = NAMED.format(name="two", line=4)
    second = OLD.format(file="cmake/all of it.cmake", line=7) + own + "other\n"
    assert kinds.take("two", second.encode()).decode() == own + "other\n", "it names another target"
    moved = own.replace("package two\n  is,", "package\n  three is,")
    assert kinds.take("three", moved.encode()) == b""
    assert kinds.take("a", OLD.format(file="CMakeLists.txt", line=2).encode()) == b"", "a name that is a word"
    assert kinds.take("z", b"note\n") == b"", "other tools repeat themselves, too"
    assert kinds.packages == {"my_pkg": ("a", "two", "z"), "two": ("three",)}


def test_the_summary_names_the_packages(capfd: pytest.CaptureFixture[str]) -> None:
    """The output of a package that fails is shown in full."""
    report = report_on("a", "b", "c", "d")
    outputs = [
        Output(name, OLD.format(file="CMakeLists.txt", line=number).encode(), stderr=True)
        for number, name in enumerate("abcd")
    ]
    ends = (*(Finished(name, 0, 0.1) for name in "abc"), Finished("d", 1, 0.1, STEP))
    out, err = shown(capfd, report, *outputs, *ends)
    assert [line for line in err.splitlines() if line.startswith("---")] == [
        *("--- stderr: a", "---", "--- stderr: d", "---")
    ]
    assert "  4 packages had stderr output: a b c d\n  2 packages repeated warnings of a: b c\n" in out


def test_compiler_warnings_are_shown_as_with_make(capfd: pytest.CaptureFixture[str]) -> None:
    """Ninja prints to stdout what compilers print to stderr."""
    text = "x.cpp:3:5: warning: unused\n    3 | int x;\n"
    events = (
        StepStarted("a", STEP),
        Output("a", f"[1/2] c++\n{text}[2/2] ld\n".encode(), stderr=False),
        StepFinished("a", STEP, 0),
        Output("a", b"-- Installing: a\n", stderr=False),
    )
    out, err = shown(capfd, report_on("a"), *events, Finished("a", 0, 0.1))
    assert err == f"--- stderr: a\n{text}---\n"
    assert out.endswith("  1 package had stderr output: a\n")
    assert "unused" not in shown(capfd, report_on("a"), *events, Finished("a", 1, 0.1, STEP))[1]
