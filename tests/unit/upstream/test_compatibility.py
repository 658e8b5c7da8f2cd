"""The table of compatibility: counts of results, the file that holds them, and the page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.upstream.__main__ import main
from tests.upstream.figures import DISTRIBUTIONS, Compatibility, Repository, Suite, as_text, read, with_counts
from tests.upstream.page import DOCS, FIGURES, PAGE, page
from tests.upstream.page import main as write_page
from tests.upstream.suites import SUITES

if TYPE_CHECKING:
    from pathlib import Path

FOUND = Compatibility(
    "abc1234",
    {"jazzy": "rosidl 4.6.5"},
    (
        Suite("rosidl_generator_py", {"humble": (17, 17), "jazzy": (15, 17)}, ("Two are for Windows.",)),
        Suite("rosidl_runtime_c", {"humble": (1, 2)}, ("Two are for Windows.", "One ends the process.")),
    ),
    (Repository("org/robot_msgs", "main", {"rolling": (1200, 1200)}, 1),),
)

JUNIT = """<testsuite name="test_it" tests="5" failures="1" errors="0" skipped="1" disabled="1">
<testcase classname="test_it" name="test_good"/>
<testcase classname="test_it" name="test_better"/>
<testcase classname="test_it" name="test_bad"><failure message="no"/></testcase>
<testcase classname="test_it" name="DISABLED_test" status="notrun"/>
<testcase classname="test_it" name="test_later"><skipped message="not today"/></testcase>
</testsuite>
"""


def workspace(folder: Path) -> Path:
    """Return a workspace with the results of two suites and of another package."""
    for package in ("rosidl_generator_py", "rosidl_runtime_c_tests", "other"):
        results = folder / "build" / package / "test_results" / package
        results.mkdir(parents=True)
        (results / "test_it.xunit.xml").write_text(JUNIT)
    return folder


def test_counts_survive_their_file(tmp_path: Path) -> None:
    file = tmp_path / "compatibility.json"
    assert read(file) == Compatibility()
    file.write_text(as_text(FOUND), encoding="utf-8")
    assert read(file) == FOUND


def test_new_counts_leave_other_distributions_and_notes() -> None:
    found = with_counts(FOUND, "humble", {"rosidl_generator_py": (16, 17), "rosidl_generator_c": (3, 3)})
    assert found.suites == (
        Suite("rosidl_generator_c", {"humble": (3, 3)}),
        Suite("rosidl_generator_py", {"humble": (16, 17), "jazzy": (15, 17)}, ("Two are for Windows.",)),
        FOUND.suites[1],
    )
    assert found.repositories == FOUND.repositories


def test_results_of_a_workspace_are_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A skipped test needs a note, as a failed one; a disabled one is not counted."""
    file = tmp_path / "compatibility.json"
    options = [
        "--workspace",
        f"jazzy={workspace(tmp_path)}",
        "--sources",
        "jazzy=rosidl 4.6.5",
        "--commit",
        "abc1234",
    ]
    assert main([*options, "--output", str(file)]) == 0
    found = read(file)
    assert found.commit == "abc1234"
    assert found.suites == (
        Suite("rosidl_generator_py", {"jazzy": (2, 4)}),
        Suite("rosidl_runtime_c", {"jazzy": (2, 4)}),
    )
    assert found.sources == {"jazzy": "rosidl 4.6.5"}
    assert capsys.readouterr().out.splitlines() == [
        "jazzy: rosidl_generator_py: test_it.test_bad",
        "jazzy: rosidl_generator_py: test_it.test_later",
        "jazzy: rosidl_runtime_c: test_it.test_bad",
        "jazzy: rosidl_runtime_c: test_it.test_later",
    ]


def test_an_unknown_distribution_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--workspace", "foxy=ws", "--commit", "abc1234", "--output", "x.json"])
    assert "'foxy=ws' is not DISTRO=VALUE with one of humble, jazzy" in capsys.readouterr().err


def test_the_page_has_a_row_for_each_and_equal_notes_once() -> None:
    text = page(FOUND)
    words = SUITES["rosidl_generator_py"]
    assert f"| `rosidl_generator_py` | {words} | 17 of 17 | 15 of 17 | - | - | [1](#note-1) |\n" in text
    assert "| 1 of 2 | - | - | - | [1](#note-1), [2](#note-2) |\n" in text
    assert "| `org/robot_msgs` | `main`, 1 type | - | - | - | 1,200 of 1,200 |  |\n" in text
    assert text.count("Two are for Windows.") == 1
    assert "- Jazzy: rosidl 4.6.5\n" in text


def test_the_page_is_what_the_counts_say(tmp_path: Path) -> None:
    """After a new count, run `python -m tests.upstream.page`."""
    assert (DOCS / PAGE).read_text(encoding="utf-8") == page(read(DOCS / FIGURES))
    (tmp_path / PAGE).parent.mkdir()
    assert write_page(tmp_path) == 0
    assert "No suite was counted." in (tmp_path / PAGE).read_text(encoding="utf-8")


def test_every_shortfall_is_explained() -> None:
    found = read(DOCS / FIGURES)
    rows: tuple[Suite | Repository, ...] = (*found.suites, *found.repositories)
    for row in rows:
        assert set(row.counts) <= set(DISTRIBUTIONS), row.name
        short = [name for name, (passed, total) in row.counts.items() if passed < total]
        assert row.notes or not short, (row.name, short)
