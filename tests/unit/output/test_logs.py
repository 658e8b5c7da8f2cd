"""Log files."""

from contextlib import closing
from pathlib import Path

import pytest

from forge.base.errors import HostError
from forge.build.events import (
    Aborted,
    Finished,
    Output,
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
        with closing(open_log(logs, "build")) as log_writer:
            folders.append(log_writer.folder)
    assert folders[0] != folders[1]
    assert (logs / "latest").resolve() == (logs / "latest_build").resolve() == folders[1]
    assert (logs / "COLCON_IGNORE").is_file()


STEP = Step(StepKind.BUILD, ("make", "a b"), Path("/w"))
EVENTS = (
    Started("a"),
    StepStarted("a", STEP, (("X", "1 2"),)),
    Output("a", b"out\n", stderr=False),
    Output("a", b"err\n", stderr=True),
    StepFinished("a", STEP, 3),
    Finished("a", 3, 0.5, STEP),
    Aborted("c", 0.1),
)


def test_output_and_commands_are_logged_to_the_files_of_the_package(tmp_path: Path) -> None:
    with closing(open_log(tmp_path, "build")) as log_writer:
        for event in EVENTS:
            log_writer.write(event)
    folder = tmp_path / "latest/a"
    assert (folder / "stdout.log").read_text() == "out\n"
    assert (folder / "stderr.log").read_text() == "err\n"
    assert (folder / "stdout_stderr.log").read_text() == "out\nerr\n"
    assert (folder / "command.log").read_text() == (
        "Invoking command in '/w': X='1 2' make 'a b'\nInvoked command in '/w' returned '3': make 'a b'\n"
    )
    assert len((folder / "streams.log").read_text().splitlines()) == 4


def test_inherited_values_of_variables_are_not_logged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LIST", "/of/the user")
    monkeypatch.setenv("EMPTY", "")
    step = Step(StepKind.BUILD, ("make",), tmp_path)
    changes = (("LIST", "/a b:/of/the user"), ("EMPTY", "x"), ("NEW", "y"), ("NONE", ""))
    with closing(open_log(tmp_path, "build")) as log_writer:
        log_writer.write(StepStarted("a", step, changes))
    assert (tmp_path / "latest/a/command.log").read_text() == (
        f"Invoking command in '{tmp_path}': LIST='/a b:'${{LIST}} EMPTY=x NEW=y NONE='' make\n"
    )


def test_a_user_file_named_latest_is_kept(tmp_path: Path) -> None:
    (tmp_path / "latest").write_text("mine")
    open_log(tmp_path, "build").close()
    assert (tmp_path / "latest").read_text() == "mine"


def test_a_log_folder_that_cannot_be_created_is_reported(tmp_path: Path) -> None:
    (tmp_path / "log").write_text("a file")
    with pytest.raises(HostError) as error:
        open_log(tmp_path / "log", "build")
    assert error.value.problems[0].hint == "choose another folder with --log-base DIR"
