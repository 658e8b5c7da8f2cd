"""Log files."""

import re
import time
from contextlib import closing
from pathlib import Path

import pytest

from forge.base.errors import HostError
from forge.build.events import (
    Aborted,
    Finished,
    Output,
    Skipped,
    Started,
    StepFinished,
    StepStarted,
)
from forge.build.tasks import Step, StepKind
from forge.output.logs import open_log


def test_each_run_has_a_log_folder_and_latest_links_to_it(tmp_path: Path) -> None:
    logs = tmp_path / "log"
    folders = []
    for _ in range(2):
        with closing(open_log(logs, "build", ["forge", "build"])) as log_writer:
            folders.append(log_writer.folder)
    assert folders[0] != folders[1]
    assert (logs / "latest").resolve() == (logs / "latest_build").resolve() == folders[1]
    assert (logs / "COLCON_IGNORE").is_file()


def test_events_are_logged_to_the_files_that_colcon_tools_read(tmp_path: Path) -> None:
    step = Step(StepKind.BUILD, ("make", "a b"), tmp_path)
    with closing(open_log(tmp_path, "build", ["forge"], base_paths=["."])) as log_writer:
        log_writer.announce({"old": {}, "a": {"old": Path("/i/old")}}, unselected=["z", "y"], fresh=["old"])
        for event in (
            Started("a"),
            StepStarted("a", step, (("X", "1 2"),)),
            Output("a", b"out\n", stderr=False),
            Output("a", b"err\n", stderr=True),
            StepFinished("a", step, 3),
            Finished("a", 3, 0.5, step),
            Skipped("b", "a"),
            Started("c"),
            Aborted("c", 0.1),
        ):
            log_writer.write(event)
    run, folder = tmp_path / "latest", tmp_path / "latest" / "a"
    lines = (run / "events.log").read_text().splitlines()
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
            f"(a) Command: {{'cmd': ['make', 'a b'], 'cwd': '{tmp_path}', "
            "'env': OrderedDict([('X', '1 2')]), 'shell': False}"
        ),
        r"(a) StdoutLine: {'line': b'out\n'}",
        r"(a) StderrLine: {'line': b'err\n'}",
        "(a) CommandEnded: {'returncode': 3}",
        "(a) JobEnded: {'identifier': 'a', 'rc': 3}",
        "(b) JobSkipped: {'identifier': 'b'}",
        "(c) JobStarted: {'identifier': 'c'}",
        "(c) JobEnded: {'identifier': 'c', 'rc': 'SIGINT'}",
        "(-) EventReactorShutdown: {}",
    ]
    general = (run / "logger_all.log").read_text()
    assert "Parsed command line arguments: Namespace(verb_name='build', base_paths=['.'])\n" in general
    assert general.count(" command in '") == 2
    assert (folder / "stdout.log").read_text() == "out\n"
    assert (folder / "stderr.log").read_text() == "err\n"
    assert (folder / "stdout_stderr.log").read_text() == "out\nerr\n"
    assert (folder / "command.log").read_text() == (
        f"Invoking command in '{tmp_path}': X='1 2' make 'a b'\n"
        f"Invoked command in '{tmp_path}' returned '3': make 'a b'\n"
    )
    assert len((folder / "streams.log").read_text().splitlines()) == 4


def test_inherited_values_of_variables_are_not_logged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LIST", "/of/the user")
    monkeypatch.setenv("EMPTY", "")
    step = Step(StepKind.BUILD, ("make",), tmp_path)
    changes = (("LIST", "/a b:/of/the user"), ("EMPTY", "x"), ("NEW", "y"), ("NONE", ""))
    with closing(open_log(tmp_path, "build", ["forge"])) as log_writer:
        log_writer.write(StepStarted("a", step, changes))
    everything = "".join(path.read_text() for path in (tmp_path / "latest").rglob("*.log"))
    assert "/of/the user" not in everything
    assert "('LIST', '/a b:${LIST}'), ('EMPTY', 'x'), ('NEW', 'y'), ('NONE', '')" in everything
    assert (tmp_path / "latest/a/command.log").read_text() == (
        f"Invoking command in '{tmp_path}': LIST='/a b:'${{LIST}} EMPTY=x NEW=y NONE='' make\n"
    )


def test_a_silent_build_logs_timer_events(tmp_path: Path) -> None:
    with closing(open_log(tmp_path, "build", ["forge"])) as log_writer:
        log_writer.write(Started("a"))
        end = time.monotonic() + 30
        while (tmp_path / "latest/events.log").read_text().count("TimerEvent") < 2 and time.monotonic() < end:
            time.sleep(0.1)
    assert (tmp_path / "latest/events.log").read_text().count("TimerEvent") >= 2


def test_a_user_file_named_latest_is_kept(tmp_path: Path) -> None:
    (tmp_path / "latest").write_text("mine")
    open_log(tmp_path, "build", []).close()
    assert (tmp_path / "latest").read_text() == "mine"


def test_a_log_folder_that_cannot_be_created_is_reported(tmp_path: Path) -> None:
    (tmp_path / "log").write_text("a file")
    with pytest.raises(HostError) as error:
        open_log(tmp_path / "log", "build", [])
    assert error.value.problems[0].hint == "choose another folder with --log-base DIR"


def test_passwords_are_not_logged(tmp_path: Path) -> None:
    """Logs are shared, and a command line may contain credentials."""
    argv = ["forge", "build", "--remote-cache=https://me:pass@word@host:1/x", "-DA=ssh://git@host", "a@b"]
    open_log(tmp_path, "build", argv).close()
    said = (tmp_path / "latest/logger_all.log").read_text(encoding="utf-8")
    assert said.splitlines()[0] == (
        "[0.000s] DEBUG:colcon:Command line arguments: "
        "['forge', 'build', '--remote-cache=https://...@host:1/x', '-DA=ssh://...@host', 'a@b']"
    )
