"""JSON events, for `--json` and for the log."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.snippets import ROOT
from tests.testable import PYTEST, cmake_package, python_package

FAILS = 'message("this goes to stderr")\nmessage(FATAL_ERROR "no luck")'


def events_in(text: str) -> list[dict[str, object]]:
    """Return the events; each line must be one."""
    return [json.loads(line) for line in text.splitlines()]


def words(events: list[dict[str, object]], package: str) -> list[object]:
    """Return the names of a package's events without those of steps."""
    return [
        event["event"]
        for event in events
        if event.get("package") == package and not str(event["event"]).startswith("Step")
    ]


@pytest.fixture
def two(tree: Tree) -> Path:
    """Return a workspace in a folder with a space; b depends on a."""
    files = {**cmake_package("a"), **cmake_package("b", needs="<depend>a</depend>")}
    return tree({f"my ws/{name}": text for name, text in files.items()}) / "my ws"


def test_json_output_has_one_event_per_line(forge: Forge, two: Path) -> None:
    ran = forge("build", "--json", "--explain", cwd=two)
    assert ran.code == 0, ran.err
    events = events_in(ran.out)
    assert words(events, "b") == ["Planned", "Started", "Finished"]
    finished = {str(e["package"]): e for e in events if e["event"] == "Finished"}
    assert finished["a"]["code"] == 0
    assert (two / str(finished["a"]["log"])).is_dir()
    assert events[-1]["event"] == "Summary"
    assert (events[-1]["code"], events[-1]["finished"]) == (0, ["a", "b"])
    times = [event["time"] for event in events]
    assert times == sorted(times, key=float)  # type: ignore[arg-type]
    assert events_in((two / "log/latest_build/events.jsonl").read_text()) == events


def test_an_up_to_date_build_lists_its_packages(forge: Forge, two: Path) -> None:
    forge("build", cwd=two)
    events = events_in(forge("build", "--json", cwd=two).out)
    assert [(e["event"], e.get("package")) for e in events] == [
        *(("Fresh", "a"), ("Fresh", "b")),
        ("Summary", None),
    ]
    assert events[-1]["unchanged"] == ["a", "b"]
    assert events[-1]["log"] is None


def test_a_changed_task_is_reported_with_its_reason(forge: Forge, two: Path) -> None:
    forge("build", cwd=two)
    with (two / "src/a/CMakeLists.txt").open("a") as stream:
        stream.write("# more\n")
    events = events_in(forge("build", "--json", "--dry-run", cwd=two).out)
    planned = {str(e["package"]): e for e in events if e["event"] == "Planned"}
    assert "CMakeLists.txt" in str(planned["a"]["reason"])
    assert (planned["a"]["conditional"], planned["b"]["conditional"]) == (False, True)
    steps = planned["a"]["steps"]
    assert isinstance(steps, list)
    assert [step["step"] for step in steps][-1] == "install"
    events = events_in(forge("build", "--json", cwd=two).out)
    assert words(events, "a") == ["Planned", "Started", "Finished"]
    assert words(events, "b") == ["Planned", "Fresh"]


def test_a_failure_contains_its_error_and_the_command_to_repeat_it(forge: Forge, tree: Tree) -> None:
    root = tree({**cmake_package("bad", FAILS), **cmake_package("later", needs="<depend>bad</depend>")})
    ran = forge("build", "--json", cwd=root)
    assert ran.code == 1
    events = events_in(ran.out)
    (finished,) = (e for e in events if e["event"] == "Finished")
    assert (finished["package"], finished["code"], finished["step"]) == ("bad", 1, "cmake")
    assert "no luck" in str(finished["error"])
    assert "environment.sh" in str(finished["repeat"])
    assert [(e["package"], e["because"]) for e in events if e["event"] == "Skipped"] == [("later", "bad")]
    assert events[-1]["code"] == 1
    assert (events[-1]["failed"], events[-1]["stderr"]) == (["bad"], ["bad"])
    assert events[-1]["not_processed"] == ["later"]
    assert "Failed   <<< bad" in ran.err


def test_program_output_can_be_included(forge: Forge, tree: Tree) -> None:
    root = tree(cmake_package("a", 'message(STATUS "a word")'))
    assert "a word" not in forge("build", "--json", "--event-handlers", "console_cohesion+", cwd=root).out
    ran = forge("build", "--json", "--cmake-force-configure", "--event-handlers", "console_direct+", cwd=root)
    (line,) = (e for e in events_in(ran.out) if "a word" in str(e.get("line")))
    assert (line["event"], line["package"], line["stderr"]) == ("Output", "a", False)
    assert "Output" not in (root / "log/latest_build/events.jsonl").read_text()


@pytest.mark.needs("ctest")
def test_test_events_name_failures_and_the_command_to_repeat_them(forge: Forge, tree: Tree) -> None:
    root = tree(
        {
            **cmake_package("c", 'add_test(bad "false")'),
            **python_package("p", PYTEST.format(name="p"), pytest=True),
            **cmake_package("absent"),
        }
    )
    built = forge("build", "--packages-skip", "absent", cwd=root, env={"PYTHONPATH": str(ROOT)})
    assert built.code == 0, built.err
    ran = forge("test", "--json", cwd=root)
    events = events_in(ran.out)
    finished = {str(e["package"]): e for e in events if e["event"] == "Finished"}
    assert {name: (e["code"], e["test_failures"]) for name, e in finished.items()} == {
        "c": (0, True),
        "p": (0, True),
        "absent": (1, False),
    }
    assert finished["absent"]["error"] == ["'absent' cannot be tested: 'absent' is not built"]
    assert finished["absent"]["hint"] == "forge build --packages-up-to absent"
    failed = [e for e in events if e["event"] == "TestFailure"]
    assert [(e["package"], e["test"]) for e in failed] == [("c", "bad"), ("p", "tests.test_p.test_value[2]")]
    assert "ctest" in str(failed[0]["repeat"])
    assert events[-1]["test_failures"] == ["c", "p"]
    assert events[-1]["code"] == ran.code == 1
    assert events_in((root / "log/latest_test/events.jsonl").read_text()) == events
    ran = forge("test", "--json", "--return-code-on-test-failure", "--packages-select", "c", cwd=root)
    assert events_in(ran.out)[-1]["code"] == ran.code == 1
    ran = forge("test", "--json", "--packages-select", "c", cwd=root)
    assert events_in(ran.out)[-1]["code"] == ran.code == 0


def test_an_interrupted_build_is_reported(tree: Tree) -> None:
    sleep = 'execute_process(COMMAND "${CMAKE_COMMAND}" -E sleep 60)'
    root = tree({**cmake_package("a", sleep), **cmake_package("b", needs="<depend>a</depend>")})
    argv = [sys.executable, "-m", "forge", "build", "--json"]
    with subprocess.Popen(argv, cwd=root, stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None
        lines = []
        for line in running.stdout:
            lines.append(line)
            if '"StepStarted"' in line:
                running.send_signal(signal.SIGINT)
    events = events_in("".join(lines))
    assert words(events, "a") == ["Planned", "Started", "Aborted"]
    assert words(events, "b") == ["Planned", "Skipped"]
    assert events[-1]["code"] == running.returncode == 130
    assert events[-1]["aborted"] == ["a"]
