"""Dask: messages and remote tasks, each by itself."""

import pickle
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from distributed import Future

from forge.base.errors import HostError
from forge.build.events import Aborted, Event, Finished, Output
from forge.build.tasks import Step, StepKind, Task
from forge.execution.options import JobOptions
from forge.plugins.dask.connection import Call, Connection
from forge.plugins.dask.messages import Mailbox, RemoteTask, Router, TaskRequest
from tests.packages import package


def task(folder: Path, *programs: str) -> Task:
    """Return a task whose steps are Python programs."""
    steps = tuple(Step(StepKind.INSTALL, (sys.executable, "-c", code), folder) for code in programs)
    return Task("a", package("a"), folder, folder / "a", (), steps, "")


def message(attempt: str, number: int, content: object) -> tuple[float, dict[str, object]]:
    return 0.0, {"attempt": attempt, "number": number, "content": pickle.dumps(content)}


def test_messages_of_an_abandoned_attempt_are_ignored() -> None:
    router = Router()
    mailbox = router.open("key")
    for attempt in ("first", "second"):
        router.deliver(message(attempt, 0, ("key", TaskRequest(attempt, "tcp://1", "host"))))
    router.deliver(message("nobody's", 1, Aborted("a", 0.0)))
    for expected in ("first", "second"):
        request = mailbox.get()
        assert isinstance(request, TaskRequest)
        assert request.attempt == expected
        mailbox.follow(request.attempt)
    router.deliver(message("first", 1, Aborted("a", 0.0)))
    router.deliver(message("second", 1, Finished("a", 0, 1.0)))
    assert mailbox.get() == Finished("a", 0, 1.0)


def test_a_lost_message_is_detected() -> None:
    router = Router()
    mailbox = router.open("key")
    router.deliver(message("one", 0, ("key", TaskRequest("one", "tcp://1", "host"))))
    mailbox.get()
    mailbox.follow("one")
    router.deliver(message("one", 2, Aborted("a", 0.0)))
    with pytest.raises(HostError, match="message from a worker was lost"):
        mailbox.get()


class Promise:
    """A Dask future that has ended, possibly with an error."""

    def __init__(self, status: str, error: Exception | None = None) -> None:
        self.status = status
        self._error = error

    def exception(self) -> Exception | None:
        return self._error

    def done(self) -> bool:
        return True


class Quiet:
    """A connection without messages from workers; `command` is the last command sent to all."""

    def __init__(self, command: str = "") -> None:
        self.command = command
        self.cluster = SimpleNamespace(address="tcp://there")
        self.handed: list[TaskRequest] = []

    def deliver_task(self, request: TaskRequest, _task: RemoteTask) -> None:
        self.handed.append(request)


def called(
    connection: Quiet, tmp_path: Path, *messages: object, promise: Promise | None = None
) -> list[Event]:
    mailbox = Mailbox()
    for content in messages:
        mailbox.put("", 0, content)
    remote_task = RemoteTask(task(tmp_path), {}, JobOptions(), tmp_path / "lock")
    call = Call(
        cast("Connection", connection),
        "a",
        lambda *_: remote_task,
        mailbox,
        cast("Future[Any]", promise or Promise("pending")),
    )
    try:
        return list(call.events())
    finally:
        call.close()


def test_a_task_without_a_worker_is_aborted_on_interrupt(tmp_path: Path) -> None:
    assert called(Quiet(), tmp_path, "interrupt") == [Aborted("a", 0.0)]


def test_no_task_is_started_while_the_build_stops(tmp_path: Path) -> None:
    connection = Quiet("finish")
    assert called(connection, tmp_path, TaskRequest("one", "tcp://1", "host")) == [Aborted("a", 0.0)]
    assert connection.handed == []


def test_a_second_worker_is_reported_and_gets_the_task(tmp_path: Path) -> None:
    connection = Quiet()
    requests = (TaskRequest("one", "tcp://1", "first"), TaskRequest("two", "tcp://2", "second"))
    said = called(connection, tmp_path, *requests, Finished("a", 0, 1.0))
    assert said == [
        Output("a", b"forge: the worker on first was lost; 'a' is restarted on second\n", stderr=True),
        Finished("a", 0, 1.0),
    ]
    assert connection.handed == [*requests]


def test_a_worker_that_does_not_respond_is_abandoned(tmp_path: Path) -> None:
    said = called(Quiet(), tmp_path, TaskRequest("one", "tcp://1", "first"), "interrupt", "give up")
    assert said == [
        Output("a", b"forge: the worker on first does not respond and is abandoned\n", stderr=True),
        Aborted("a", 0.0),
    ]


class KilledWorker(Exception):
    """What Dask raises."""


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (KilledWorker(), b"every worker that ran it died; see the logs of the workers"),
        (RuntimeError("the step runner exited with code -9"), b"the step runner exited with code -9"),
    ],
)
def test_a_killed_worker_fails_the_package(tmp_path: Path, error: Exception, words: bytes) -> None:
    said = called(Quiet(), tmp_path, "ended", promise=Promise("error", error))
    assert said == [
        Output("a", b"forge: 'a' failed: " + words + b"\n", stderr=True),
        Finished("a", 1, 0.0),
    ]


def test_a_dropped_task_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(HostError, match="the scheduler at 'tcp://there' dropped the task 'a'"):
        called(Quiet(), tmp_path, "ended", promise=Promise("cancelled"))
    with pytest.raises(HostError, match="the worker's result for 'a' was not received"):
        called(Quiet(), tmp_path, "ended", "lost", promise=Promise("finished"))
