"""`events.log` and `logger_all.log` have what colcon's tools read."""

import re
import sys
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from forge.base.layout import Layout
from forge.build.events import Output, StepFinished, StepStarted
from forge.build.tasks import BuildPlan, Step, StepKind, Task
from forge.output.reporters import Run
from forge.plugins.colcon_logs.reporter import EventLog
from forge.workspace.selection import Query
from tests.packages import package

STEP = Step(StepKind.BUILD, ("make", "a b"), Path("/w"))


@pytest.fixture
def run(tmp_path: Path) -> Run:
    layout = Layout(Path("/b"), Path("/i"), tmp_path)
    plan = BuildPlan({"a": Task("a", package("a"), tmp_path, tmp_path, ("old",), (), "new")}, ("old",))
    packages = {name: package(name) for name in ("a", "old", "y", "z")}
    packages["e"] = replace(package("e"), embedded=True)
    return Run("build", plan, layout, tmp_path, tmp_path, time.monotonic(), str, Query(), packages)


def test_events_are_logged_as_by_colcon(run: Run, tmp_path: Path) -> None:
    with closing(EventLog(run)) as log:
        log.observe({"event": "Fresh", "package": "old"})
        log.observe({"event": "Started", "package": "a"})
        log.follow(StepStarted("a", STEP, (("X", "1 2"),)))
        log.follow(Output("a", b"out\n", stderr=False))
        log.follow(Output("a", b"err\n", stderr=True))
        log.follow(StepFinished("a", STEP, 3))
        log.observe({"event": "Finished", "package": "a", "code": 3, "test_failures": True})
        log.observe({"event": "Skipped", "package": "b", "because": "a"})
        log.observe({"event": "Aborted", "package": "c"})
        log.observe({"event": "Finished", "package": "unbuilt", "code": 1, "test_failures": False})
    lines = (tmp_path / "events.log").read_text().splitlines()
    assert all(re.match(r"\[\d+\.\d{6}\] \(", line) for line in lines)
    assert [line.partition("] ")[2] for line in lines] == [
        "(-) TimerEvent: {}",
        "(-) JobUnselected: {'identifier': 'y'}",
        "(-) JobUnselected: {'identifier': 'z'}",
        "(old) JobQueued: {'identifier': 'old', 'dependencies': OrderedDict()}",
        "(a) JobQueued: {'identifier': 'a', 'dependencies': OrderedDict([('old', '/i/old')])}",
        "(old) JobStarted: {'identifier': 'old'}",
        "(old) JobEnded: {'identifier': 'old', 'rc': 0}",
        "(a) JobStarted: {'identifier': 'a'}",
        "(a) JobProgress: {'identifier': 'a', 'progress': 'build'}",
        (
            "(a) Command: {'cmd': ['make', 'a b'], 'cwd': '/w', "
            "'env': OrderedDict([('X', '1 2')]), 'shell': False}"
        ),
        r"(a) StdoutLine: {'line': b'out\n'}",
        r"(a) StderrLine: {'line': b'err\n'}",
        "(a) CommandEnded: {'returncode': 3}",
        "(a) TestFailure: {'identifier': 'a'}",
        "(a) JobEnded: {'identifier': 'a', 'rc': 3}",
        "(b) JobSkipped: {'identifier': 'b'}",
        "(c) JobEnded: {'identifier': 'c', 'rc': 'SIGINT'}",
        "(unbuilt) JobQueued: {'identifier': 'unbuilt', 'dependencies': OrderedDict()}",
        "(unbuilt) JobStarted: {'identifier': 'unbuilt'}",
        "(unbuilt) JobEnded: {'identifier': 'unbuilt', 'rc': 1}",
        "(-) EventReactorShutdown: {}",
    ]
    general = (tmp_path / "logger_all.log").read_text()
    assert "Parsed command line arguments: Namespace(verb_name='build', build_base='/b'," in general
    assert general.count(" command in '") == 2


def test_inherited_values_of_variables_are_not_logged(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LIST", "/of/the user")
    monkeypatch.setenv("EMPTY", "")
    changes = (("LIST", "/a b:/of/the user"), ("EMPTY", "x"), ("NEW", "y"), ("NONE", ""))
    with closing(EventLog(run)) as log:
        log.follow(StepStarted("a", STEP, changes))
    everything = "".join(path.read_text() for path in tmp_path.glob("*.log"))
    assert "/of/the user" not in everything
    assert "('LIST', '/a b:${LIST}'), ('EMPTY', 'x'), ('NEW', 'y'), ('NONE', '')" in everything


def test_a_silent_build_logs_timer_events(run: Run, tmp_path: Path) -> None:
    with closing(EventLog(run)) as log:
        log.observe({"event": "Started", "package": "a"})
        end = time.monotonic() + 30
        while (tmp_path / "events.log").read_text().count("TimerEvent") < 2 and time.monotonic() < end:
            time.sleep(0.1)
    assert (tmp_path / "events.log").read_text().count("TimerEvent") >= 2


def test_passwords_are_not_logged(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Logs are shared, and a command line may contain credentials."""
    argv = ["forge", "build", "--remote-cache=https://me:pass@word@host:1/x", "-DA=ssh://git@host", "a@b"]
    monkeypatch.setattr(sys, "argv", argv)
    EventLog(run).close()
    assert (tmp_path / "logger_all.log").read_text(encoding="utf-8").splitlines()[0] == (
        "[0.000s] DEBUG:colcon:Command line arguments: "
        "['forge', 'build', '--remote-cache=https://...@host:1/x', '-DA=ssh://...@host', 'a@b']"
    )
