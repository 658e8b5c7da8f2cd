"""The parts of a cluster by themselves: messages, jobs, step runners; then all in one."""

from __future__ import annotations

import logging
import os
import pickle
import sys
import threading
import time
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import pytest
from distributed import LocalCluster

from forge.base.errors import EnvironmentFault
from forge.build.events import Aborted, Event, Finished, Output, StepFinished, StepStarted
from forge.build.tasks import Step, StepKind, Task
from forge.execution.dask import worker
from forge.execution.dask.connection import Call
from forge.execution.dask.messages import FINISH, Mailbox, RemoteTask, Router, TaskRequest, WorkerLimits
from forge.execution.dask.step_runner import COMMANDS_THREAD, read_message, run_task, with_length
from forge.execution.dask.worker_jobs import WorkerJobs
from tests.packages import manifest_text, package

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from distributed import Future

    from forge.execution.dask.connection import Connection
    from tests.conftest import Forge, Tree


def task(folder: Path, *programs: str) -> Task:
    """Return a task whose steps are Python programs."""
    steps = tuple(Step(StepKind.INSTALL, (sys.executable, "-c", code), folder) for code in programs)
    return Task("a", package("a"), folder, folder / "a", (), steps, "")


def message(attempt: str, number: int, content: object) -> tuple[float, dict[str, object]]:
    """Return a message as Dask delivers it."""
    return 0.0, {"attempt": attempt, "number": number, "content": pickle.dumps(content)}


def test_messages_of_an_attempt_that_was_given_up_are_not_read() -> None:
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


def test_a_message_that_is_lost_is_noticed() -> None:
    router = Router()
    mailbox = router.open("key")
    router.deliver(message("one", 0, ("key", TaskRequest("one", "tcp://1", "host"))))
    mailbox.get()
    mailbox.follow("one")
    router.deliver(message("one", 2, Aborted("a", 0.0)))
    with pytest.raises(EnvironmentFault, match="message from a worker was lost"):
        mailbox.get()


def test_slots_have_a_job_each_and_share_the_rest() -> None:
    jobs = WorkerJobs(5, 2)
    jobs.prepare({"PATH": os.environ["PATH"]})
    for _ in range(2):
        with jobs.slot() as one, jobs.slot() as two:
            assert one == two
            number, auth = one.arguments
            assert number == "5"
            reader = os.open(auth.removeprefix("fifo:"), os.O_RDONLY) if auth.startswith("fifo:") else None
            if reader is not None:
                # What is taken and never given back is there again once nobody is at work.
                assert os.read(reader, 10) == b"+++"
                os.close(reader)


def test_where_no_tool_takes_jobs_each_slot_has_its_part(tmp_path: Path) -> None:
    jobs = WorkerJobs(5, 2)
    tool = tmp_path / "ninja"
    tool.write_text("#!/bin/sh\nexit 1\n", encoding="utf-8")
    tool.chmod(0o755)
    assert jobs.prepare({"PATH": "", "NINJA": str(tool)}) in {(), ("make",)}
    if not jobs.prepare({}):
        with jobs.slot() as settings:
            assert settings.arguments == ("2", "")


class RunningSteps:
    """A step runner in a thread, at the other end of two pipes."""

    def __init__(self, remote_task: RemoteTask) -> None:
        """Start it and send the task."""
        theirs, self._source = os.pipe()
        self.target, ours = os.pipe()
        self._ends = (os.fdopen(theirs, "rb", buffering=0), os.fdopen(ours, "wb"))
        self.thread = threading.Thread(target=run_task, args=(["1", ""], *self._ends))
        self.thread.start()
        os.write(self._source, with_length(pickle.dumps(remote_task)))

    def events(self) -> Iterator[Event]:
        """Yield its events, up to the last one."""
        with os.fdopen(self.target, "rb") as stream:
            while True:
                event = pickle.loads(read_message(stream))  # noqa: S301  (our own)
                yield event
                if isinstance(event, Finished | Aborted):
                    break
        self.thread.join()
        self.leave()
        for thread in [one for one in threading.enumerate() if one.name == COMMANDS_THREAD]:
            thread.join()
        for end in self._ends:
            end.close()

    def send(self, command: str) -> None:
        """Send a command to it."""
        os.write(self._source, f"{command}\n".encode())

    def leave(self) -> None:
        """Close its stdin: the result is no longer needed."""
        if self._source >= 0:
            os.close(self._source)
            self._source = -1


def test_a_step_runner_reports_every_event(tmp_path: Path) -> None:
    running = RunningSteps(
        RemoteTask(task(tmp_path, "print('hello')"), dict(os.environ), WorkerLimits(), tmp_path / "lock")
    )
    kinds = [type(event) for event in running.events()]
    assert kinds == [StepStarted, Output, StepFinished, Finished]


@pytest.mark.parametrize("command", [FINISH, "interrupt", None])
def test_a_step_runner_ends_at_a_command_or_the_end_of_stdin(tmp_path: Path, command: str | None) -> None:
    program = "import time; print('begun', flush=True); time.sleep(%s)" % (1 if command == FINISH else 60)
    running = RunningSteps(
        RemoteTask(
            task(tmp_path, program, "print('never')"), dict(os.environ), WorkerLimits(), tmp_path / "lock"
        )
    )
    events = running.events()
    assert isinstance(next(events), StepStarted)
    assert isinstance(next(events), Output)
    if command is None:
        running.leave()
    else:
        running.send(command)
    assert isinstance([*events][-1], Aborted)


class Promise:
    """What Dask says of a task: how it ended, and by which error."""

    def __init__(self, status: str, error: Exception | None = None) -> None:
        """Remember."""
        self.status = status
        self._error = error

    def exception(self) -> Exception | None:
        """Return the error."""
        return self._error

    def done(self) -> bool:
        """Tell that it ended."""
        return True


class Quiet:
    """A connection without messages from workers; `command` is the last command sent to all."""

    def __init__(self, command: str = "") -> None:
        """Store the command."""
        self.command = command
        self.cluster = SimpleNamespace(address="tcp://there")
        self.handed: list[TaskRequest] = []

    def deliver_task(self, request: TaskRequest, _task: RemoteTask) -> None:
        """Note the request."""
        self.handed.append(request)


def called(
    connection: Quiet, tmp_path: Path, *messages: object, promise: Promise | None = None
) -> list[Event]:
    """Return the events of a task after some messages."""
    mailbox = Mailbox()
    for content in messages:
        mailbox.put("", 0, content)
    remote_task = RemoteTask(task(tmp_path), {}, WorkerLimits(), tmp_path / "lock")
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


def test_a_task_that_no_worker_has_is_given_up_at_once_when_the_build_ends(tmp_path: Path) -> None:
    assert called(Quiet(), tmp_path, "interrupt") == [Aborted("a", 0.0)]


def test_nothing_begins_once_the_build_ends(tmp_path: Path) -> None:
    connection = Quiet("finish")
    assert called(connection, tmp_path, TaskRequest("one", "tcp://1", "host")) == [Aborted("a", 0.0)]
    assert connection.handed == []


def test_a_second_worker_is_reported_and_gets_the_task_too(tmp_path: Path) -> None:
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


class KilledWorker(Exception):  # noqa: N818  (Dask's name)
    """What Dask raises."""


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (KilledWorker(), b"every worker that ran it died; see the logs of the workers"),
        (RuntimeError("the step runner exited with code -9"), b"the step runner exited with code -9"),
    ],
)
def test_a_fault_of_workers_is_a_failure_of_the_package(
    tmp_path: Path, error: Exception, words: bytes
) -> None:
    said = called(Quiet(), tmp_path, "ended", promise=Promise("error", error))
    assert said == [
        Output("a", b"forge: 'a' failed: " + words + b"\n", stderr=True),
        Finished("a", 1, 0.0),
    ]


def test_a_task_that_vanishes_ends_the_build(tmp_path: Path) -> None:
    with pytest.raises(EnvironmentFault, match="the scheduler at 'tcp://there' dropped the task 'a'"):
        called(Quiet(), tmp_path, "ended", promise=Promise("cancelled"))
    with pytest.raises(EnvironmentFault, match="the worker's result for 'a' was not received"):
        called(Quiet(), tmp_path, "ended", "lost", promise=Promise("finished"))


@pytest.mark.needs("cmake", "ninja")
def test_a_cluster_within_this_process_builds(forge: Forge, tree: Tree) -> None:
    lists = "cmake_minimum_required(VERSION 3.18)\nproject({0} NONE)\ninstall(FILES here DESTINATION {0})\n"
    root = tree(
        {
            f"src/{name}/{file}": text
            for name in ("a", "b")
            for file, text in (
                ("package.xml", manifest_text(name, build_type="cmake")),
                ("CMakeLists.txt", lists.format(name)),
                ("here", "x"),
            )
        }
    )
    program = "for _ in range(150): print('0123456789\\\\n' * 10000, end='', flush=True)"
    flood = (
        lists.format("a")
        + f'add_custom_target(talk ALL COMMAND "{sys.executable}" -c "{program}" VERBATIM)\n'
    )
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with LocalCluster(
        n_workers=1,
        threads_per_worker=2,
        processes=False,
        protocol="tcp",
        host="127.0.0.1",
        dashboard_address=None,
        local_directory=str(root / "worker"),
    ) as cluster:
        address = cluster.scheduler_address
        ran = forge("build", "--executor", "dask", "--scheduler", address, cwd=root)
        assert ran.code == 0, ran.err
        assert "Summary: 2 packages finished" in ran.out
        (root / "src/a/CMakeLists.txt").write_text("no such command()\n", encoding="utf-8")
        ran = forge("build", "--executor", "dask", "--scheduler", address, cwd=root)
        assert ran.code == 1
        assert "first error in step " in ran.err
        # More than may be under way at a time.
        (root / "src/a/CMakeLists.txt").write_text(flood, encoding="utf-8")
        ran = forge("build", "--executor", "dask", "--scheduler", address, cwd=root)
        assert ran.code == 0, ran.err
        log = root / "log/latest_build/a/stdout.log"
        assert log.read_bytes().count(b"0123456789\n") == 1_500_000
        while worker._attempts:  # noqa: SLF001  (the last step runner ends a moment after its last event)
            time.sleep(0.01)
