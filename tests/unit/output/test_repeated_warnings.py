"""Each kind of warning is shown once; the other packages are named."""

from __future__ import annotations

import pytest

from forge.build.events import Finished, Output
from forge.output.package_warnings import RepeatedWarnings
from tests.unit.output.test_console import STEP, report_on, shown

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


def test_warnings_of_a_kind_are_recognized_by_their_text() -> None:
    """Wherever it is, however the name breaks its lines."""
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
    """A package that fails shows all that it said."""
    report = report_on("a", "b", "c", "d")
    said = [
        Output(name, OLD.format(file="CMakeLists.txt", line=number).encode(), stderr=True)
        for number, name in enumerate("abcd")
    ]
    ends = (*(Finished(name, 0, 0.1) for name in "abc"), Finished("d", 1, 0.1, STEP))
    out, err = shown(capfd, report, *said, *ends)
    assert [line for line in err.splitlines() if line.startswith("---")] == [
        *("--- stderr: a", "---", "--- stderr: d", "---")
    ]
    assert "  4 packages had stderr output: a b c d\n  2 packages repeated warnings of a: b c\n" in out
