"""The console output of a build."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from forge.base.text import duration
from forge.build.events import (
    Aborted,
    Event,
    Finished,
    Output,
    Started,
    StepStarted,
)
from forge.build.tasks import BuildPlan, Step, StepKind, Task
from forge.output.console import ConsoleReporter
from forge.output.handlers import HANDLERS
from tests.packages import package

STEP = Step(StepKind.BUILD, ("cmake", "--build", "/ws/build/my pkg"), Path("/ws/build/my pkg"))


def report_on(
    *names: str, handlers: dict[str, bool] = HANDLERS, logs: Path | None = None, fresh: tuple[str, ...] = ()
) -> ConsoleReporter:
    """Return a reporter of tasks without steps; the package e is embedded."""
    table = {n: replace(package(n), embedded=n == "e") for n in (*names, *fresh)}
    tasks = {n: Task(n, table[n], Path(), Path("/ws/build") / n, (), (), "") for n in names}
    return ConsoleReporter(BuildPlan(tasks, fresh), table, handlers, logs)


def shown(
    capfd: pytest.CaptureFixture[str], report: ConsoleReporter, *events: Event, seconds: float = 1.0
) -> tuple[str, str]:
    """Return what the events and the summary print on stdout and stderr."""
    for event in events:
        report.show(event)
    report.summarise(seconds)
    out, err = capfd.readouterr()
    return out, err


def test_a_successful_build_prints_the_same_lines_as_colcon(capfd: pytest.CaptureFixture[str]) -> None:
    report = report_on("a", "e")
    out, err = shown(
        capfd,
        report,
        Started("e"),
        Finished("e", 0, 0.126),
        Started("a"),
        StepStarted("a", STEP),
        Output("a", b"chatter\n", stderr=False),
        Finished("a", 0, 12.34),
        seconds=65,
    )
    assert out == (
        "Starting >>> e (embedded)\nFinished <<< e (embedded) [0.13s]\n"
        "Starting >>> a\nFinished <<< a [12.3s]\n"
        "\nSummary: 1 package finished [1min 5s]\n  1 embedded package finished\n"
    )
    assert err == ""
    assert report.exit_code == 0


def test_up_to_date_embedded_packages_are_only_counted(
    capfd: pytest.CaptureFixture[str],
) -> None:
    report = report_on("a", "e")
    report.collapsed = frozenset({"e"})
    out, err = shown(capfd, report, Started("e"), Finished("e", 0, 0.1), Started("a"), Finished("a", 0, 0.1))
    assert "e (embedded)" not in out
    assert out.endswith("\nSummary: 1 package finished [1.00s]\n  1 embedded package finished\n")
    out, err = shown(capfd, report, Started("e"), Finished("e", 1, 0.1))
    assert err.startswith("Failed   <<< e (embedded) [0.10s")


def test_colours_do_not_change_the_text(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    events = (
        *(Started("a"), Finished("a", 0, 1.0), Started("b"), Aborted("b", 1.0), Started("e")),
        *(Output("e", b"x\n", stderr=True), Finished("e", 1, 0.5, STEP)),
    )
    plain = shown(capfd, report_on("a", "b", "e"), *events)
    monkeypatch.setenv("FORCE_COLOR", "1")
    out, err = shown(capfd, report_on("a", "b", "e"), *events)
    for words in (
        "\x1b[1;32mFinished\x1b[0m <<< \x1b[1ma\x1b[0m [1.00s]",
        "\x1b[1;33mAborted \x1b[0m <<< \x1b[1mb\x1b[0m",
        "\x1b[1;31mSummary:\x1b[0m 1 package finished",
        "1 package \x1b[1;31mfailed\x1b[0m: \x1b[1me\x1b[0m",
    ):
        assert words in out
    assert "\x1b[1;31mFailed  \x1b[0m <<< \x1b[1me\x1b[0m \x1b[2m(embedded)\x1b[0m [0.50s" in err
    assert tuple(re.sub(r"\x1b\[[\d;]*m", "", text) for text in (out, err)) == plain
    monkeypatch.setenv("NO_COLOR", "1")
    assert shown(capfd, report_on("a", "b", "e"), *events) == plain


def test_output_can_be_direct_or_cohesive(capfd: pytest.CaptureFixture[str]) -> None:
    line = Output("a", b"\xff line\n", stderr=False)
    quiet = {**HANDLERS, "console_start_end": False, "summary": False}
    direct = report_on("a", handlers={**quiet, "console_direct": True})
    for event in (Started("a"), line, Finished("a", 0, 0.1)):
        direct.show(event)
    cohesive = report_on("a", handlers={**quiet, "console_cohesion": True})
    out, _ = shown(capfd, cohesive, Started("a"), line, Finished("a", 0, 0.1))
    assert out == "\ufffd line\n--- output: a\n\ufffd line\n---\n"


def test_long_output_is_shortened_in_the_middle(capfd: pytest.CaptureFixture[str]) -> None:
    report = report_on("a", handlers={**HANDLERS, "console_cohesion": True})
    for number in range(100_000):
        report.show(Output("a", f"{number:100}\n".encode(), stderr=False))
    out, _ = shown(capfd, report, Finished("a", 0, 0.1))
    lines = out.splitlines()
    assert f"{0:100}" in lines
    assert f"{99999:100}" in lines
    assert "[... output truncated; the log has the full output ...]" in lines
    assert len(lines) < 50_000


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0, "0.00s"),
        (9.994, "9.99s"),
        (9.996, "10.0s"),
        (59.94, "59.9s"),
        (59.96, "1min 0s"),
        (3723, "1h 2min 3s"),
    ],
)
def test_durations_are_formatted_like_colcon(seconds: float, text: str) -> None:
    assert duration(seconds) == text
