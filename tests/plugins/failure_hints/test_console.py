"""The report of a failed package names its first error."""

from pathlib import Path

import pytest

from forge.build.events import Aborted, Finished, Output, Skipped, Started
from tests.unit.output.test_console import STEP, report_on, shown


def test_a_failure_names_step_error_log_and_command(capfd: pytest.CaptureFixture[str]) -> None:
    report = report_on("a", "b", "c", logs=Path("/ws/log/build_x"))
    out, err = shown(
        capfd,
        report,
        Started("a"),
        Started("b"),
        Output("a", b"[1/2] c++\n", stderr=False),
        Output("a", b"x.cpp:3:5: error: nope\n", stderr=False),
        Output("a", b"    3 | nope\n", stderr=False),
        Output("a", b"something on stderr\n", stderr=True),
        Finished("a", 1, 0.5, STEP),
        Aborted("b", 0.7),
        Skipped("c", "a"),
    )
    assert err == (
        "--- stderr: a\nsomething on stderr\n---\n"
        "Failed   <<< a [0.50s, exited with code 1]\n"
        "  first error in step 'build':\n"
        "    x.cpp:3:5: error: nope\n"
        "        3 | nope\n"
        "  log: /ws/log/build_x/a/stdout_stderr.log\n"
        "  repeat: . /ws/build/a/.forge/environment.sh && "
        "cd '/ws/build/my pkg' && cmake --build '/ws/build/my pkg'\n"
    )
    assert out.endswith(
        "Aborted  <<< b [0.70s]\n"
        "\nSummary: 0 packages finished [1.00s]\n"
        "  1 package failed: a\n  1 package aborted: b\n  1 package had stderr output: a\n"
        "  1 package not processed\n"
    )
    assert report.exit_code == 1


@pytest.mark.parametrize(("lines_after", "times"), [(0, 1), (10, 1), (40, 2)])
def test_errors_already_shown_are_not_repeated(
    capfd: pytest.CaptureFixture[str], lines_after: int, times: int
) -> None:
    """stderr is shown in full; an error far above the report is repeated."""
    text = "CMake Error at CMakeLists.txt:3 (message):\n  no luck\n\n" + "more\n" * lines_after
    report = report_on("a")
    _, err = shown(capfd, report, Output("a", text.encode(), stderr=True), Finished("a", 1, 0.5, STEP))
    assert err.startswith("--- stderr: a\nCMake Error at src/a/CMakeLists.txt:3 (message):\n  no luck\n")
    assert err.count("CMake Error at src/a/CMakeLists.txt:3") == err.count("no luck") == times
    assert err.count("  first error in step 'build': see above\n") == 2 - times


def test_invalid_interface_definitions_have_exit_code_2(capfd: pytest.CaptureFixture[str]) -> None:
    report = report_on("a")
    line = b"src/a/msg/A.msg:1:1: error: unknown type 'a/Nope'\n"
    shown(capfd, report, Output("a", line, stderr=False), Finished("a", 1, 0.1, STEP))
    assert report.exit_code == 2
