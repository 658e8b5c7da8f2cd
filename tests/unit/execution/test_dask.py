"""The parts of a cluster by themselves: archives, feeds, letters, jobs, attendants; then all in one."""

from __future__ import annotations

import json
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
from forge.build.inputs.fingerprints import source_files
from forge.build.tasks import Step, Task
from forge.execution.dask import remote_task
from forge.execution.dask.connection import Call
from forge.execution.dask.feed_reading import FeedReader, Verdict
from forge.execution.dask.model import FINISH, RemoteTask, SourceBundle, TaskRequest, Terms
from forge.execution.dask.router import Mailbox, Router
from forge.execution.dask.sharing import Share
from forge.execution.dask.sources import ArchiveStore, Unshippable, pack_sources, unpack_bundle
from forge.execution.dask.step_runner import COMMANDS_THREAD, read_message, run_task, with_length
from tests.evolving import look
from tests.packages import manifest_text, package

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from distributed import Future

    from forge.execution.dask.connection import Connection
    from tests.conftest import Forge, Tree


def task(folder: Path, *programs: str) -> Task:
    """Return a task whose steps are Python programs."""
    steps = tuple(Step(f"step {i}", (sys.executable, "-c", code), folder) for i, code in enumerate(programs))
    return Task("a", package("a"), folder, folder / "a", (), steps, "")


@pytest.fixture
def source(tree: Tree) -> Path:
    """Return a package with a program, a link and a folder."""
    root = tree(
        {
            "src/a/package.xml": "<package/>\n",
            "src/a/bin/run": "#!/bin/sh\n",
            "src/a/deep/er/data.txt": "\n",
            "src/a/.clang-format": "\n",
        }
    )
    (root / "src/a/link").symlink_to("deep")
    return root / "src/a"


def test_an_archive_holds_what_counts_as_sources_and_is_always_the_same(source: Path, tmp_path: Path) -> None:
    stock = ArchiveStore(tmp_path / "stock")
    digest = stock.digest(source)
    os.utime(source / "package.xml", (1, 1))
    assert pack_sources(source) == b"".join(piece for piece, _ in stock.pieces(digest))
    bundle = SourceBundle(
        "ws", (("src/a", digest),), (("some.meta", "{}"),), tmp_path / "there", tmp_path / "stock"
    )
    unpack_bundle(bundle)
    laid = tmp_path / "there/src/a"
    assert [os.path.relpath(path, laid) for path in source_files(str(laid))] == [
        os.path.relpath(path, source) for path in source_files(str(source))
    ]
    assert look(source) == look(laid)
    stock.close()
    assert not (tmp_path / "stock").exists()


def test_what_is_laid_out_is_left_alone_until_it_changes(source: Path, tmp_path: Path) -> None:
    stock = ArchiveStore(tmp_path / "stock")
    one = (("src/a", stock.digest(source)),)
    there = tmp_path / "there"
    unpack_bundle(SourceBundle("ws", one, (), there, tmp_path / "stock"))
    (there / "src/a/mark").write_text("here\n", encoding="utf-8")
    unpack_bundle(SourceBundle("ws", one, (), there, tmp_path / "stock"))
    assert (there / "src/a/mark").exists()
    (source / "package.xml").write_text("<other/>\n", encoding="utf-8")
    two = (("src/b", ArchiveStore(tmp_path / "stock").digest(source)),)
    unpack_bundle(SourceBundle("ws", two, (), there, tmp_path / "stock"))
    assert not (there / "src/a").exists()
    assert (there / "src/b/package.xml").read_text(encoding="utf-8") == "<other/>\n"


@pytest.mark.parametrize("target", ["/etc/hostname", "../../elsewhere"])
def test_a_link_that_leads_out_of_a_package_cannot_be_shipped(source: Path, target: str) -> None:
    (source / "out").symlink_to(target)
    with pytest.raises(Unshippable, match="is a link that leaves the package"):
        pack_sources(source)


def test_a_feed_becomes_events_of_our_own_task(tmp_path: Path) -> None:
    ours = task(tmp_path, "pass")
    reader = FeedReader(ours, "/there/ws", "/here")
    said = [
        {"event": "Finished", "package": "need", "code": 0, "cache": "from the cache"},
        {"event": "Finished", "package": "other", "code": 3},
        {"event": "StepStarted", "package": "a", "step": "step 0", "argv": ["x"]},
        {"event": "Output", "package": "a", "line": "/there/ws/src/a.c:1: no\n", "stderr": True},
        {"event": "StepFinished", "package": "a", "step": "step 0", "code": 1},
        {"event": "Finished", "package": "a", "code": 1, "step": "step 0"},
    ]
    whole = "no json\n" + "".join(json.dumps(one) + "\n" for one in said)
    pieces = (whole[:70].encode(), whole[70:].encode())
    assert [event for piece in pieces for event in reader.read(piece)] == [
        StepStarted("a", ours.steps[0]),
        Output("a", b"/here/src/a.c:1: no\n", stderr=True),
        StepFinished("a", ours.steps[0], 1),
    ]
    assert reader.verdict == Verdict(1, ours.steps[0])
    assert reader.others == {"other": 3}


def letter(attempt: str, number: int, content: object) -> tuple[float, dict[str, object]]:
    """Return a letter as Dask brings it."""
    return 0.0, {"visit": attempt, "number": number, "letter": pickle.dumps(content)}


def test_letters_of_an_attempt_that_was_given_up_are_not_read() -> None:
    post = Router()
    box = post.open("key")
    for attempt in ("first", "second"):
        post.deliver(letter(attempt, 0, ("key", TaskRequest(attempt, "tcp://1", "host", "/folder"))))
    post.deliver(letter("nobody's", 1, Aborted("a", 0.0)))
    for expected in ("first", "second"):
        request = box.get()
        assert isinstance(request, TaskRequest)
        assert request.attempt == expected
        box.follow(request.attempt)
    post.deliver(letter("first", 1, Aborted("a", 0.0)))
    post.deliver(letter("second", 1, Finished("a", 0, 1.0)))
    assert box.get() == Finished("a", 0, 1.0)


def test_a_letter_that_is_lost_is_noticed() -> None:
    post = Router()
    box = post.open("key")
    post.deliver(letter("one", 0, ("key", TaskRequest("one", "tcp://1", "host", "/folder"))))
    box.get()
    box.follow("one")
    post.deliver(letter("one", 2, Aborted("a", 0.0)))
    with pytest.raises(EnvironmentFault, match="message from a worker was lost"):
        box.get()


def test_slots_have_a_job_each_and_share_the_rest() -> None:
    share = Share(5, 2)
    share.prepare({"PATH": os.environ["PATH"]})
    for _ in range(2):
        with share.slot() as one, share.slot() as two:
            assert one == two
            jobs, auth = one.arguments
            assert jobs == "5"
            reader = os.open(auth.removeprefix("fifo:"), os.O_RDONLY) if auth.startswith("fifo:") else None
            if reader is not None:
                # What is taken and never given back is there again once nobody is at work.
                assert os.read(reader, 10) == b"+++"
                os.close(reader)


def test_where_no_tool_takes_jobs_each_slot_has_its_part(tmp_path: Path) -> None:
    share = Share(5, 2)
    tool = tmp_path / "ninja"
    tool.write_text("#!/bin/sh\nexit 1\n", encoding="utf-8")
    tool.chmod(0o755)
    assert share.prepare({"PATH": "", "NINJA": str(tool)}) in {(), ("make",)}
    if not share.prepare({}):
        with share.slot() as ticket:
            assert ticket.arguments == ("2", "")


class Attended:
    """An attendant in a thread of ours, at the other end of two pipes."""

    def __init__(self, remote_task: RemoteTask) -> None:
        """Start it and send the errand."""
        theirs, self._source = os.pipe()
        self.target, ours = os.pipe()
        self._ends = (os.fdopen(theirs, "rb", buffering=0), os.fdopen(ours, "wb"))
        self.thread = threading.Thread(target=run_task, args=(["1", ""], *self._ends))
        self.thread.start()
        os.write(self._source, with_length(pickle.dumps(remote_task)))

    def events(self) -> Iterator[Event]:
        """Yield what it says, up to its last word."""
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

    def say(self, word: str) -> None:
        """Say a word to it."""
        os.write(self._source, f"{word}\n".encode())

    def leave(self) -> None:
        """Say that nobody waits any more."""
        if self._source >= 0:
            os.close(self._source)
            self._source = -1


def test_an_attendant_tells_all_that_happens(tmp_path: Path) -> None:
    attended = Attended(
        RemoteTask(task(tmp_path, "print('hello')"), dict(os.environ), Terms(), tmp_path / "lock")
    )
    kinds = [type(event) for event in attended.events()]
    assert kinds == [StepStarted, Output, StepFinished, Finished]


@pytest.mark.parametrize("word", [FINISH, "interrupt", None])
def test_an_attendant_ends_when_it_is_told_or_left_alone(tmp_path: Path, word: str | None) -> None:
    program = "import time; print('begun', flush=True); time.sleep(%s)" % (1 if word == FINISH else 60)
    attended = Attended(RemoteTask(task(tmp_path, program, "print('never')"), dict(os.environ), Terms()))
    events = attended.events()
    assert isinstance(next(events), StepStarted)
    assert isinstance(next(events), Output)
    if word is None:
        attended.leave()
    else:
        attended.say(word)
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
    """A line over which nobody says anything; `command` is what all were told."""

    def __init__(self, word: str = "") -> None:
        """Remember the word."""
        self.command = word
        self.cluster = SimpleNamespace(address="tcp://there")
        self.handed: list[TaskRequest] = []

    def deliver_task(self, request: TaskRequest, _errand: RemoteTask) -> None:
        """Note who got an errand."""
        self.handed.append(request)


def called(line: Quiet, tmp_path: Path, *letters: object, promise: Promise | None = None) -> list[Event]:
    """Return what is told of a task after some letters."""
    box = Mailbox()
    for said in letters:
        box.put("", 0, said)
    remote_task = RemoteTask(task(tmp_path), {}, Terms())
    call = Call(
        cast("Connection", line),
        "a",
        lambda *_: remote_task,
        box,
        cast("Future[Any]", promise or Promise("pending")),
    )
    try:
        return list(call.events())
    finally:
        call.close()


def test_a_task_that_no_worker_has_is_given_up_at_once_when_the_build_ends(tmp_path: Path) -> None:
    assert called(Quiet(), tmp_path, "interrupt") == [Aborted("a", 0.0)]


def test_nothing_begins_once_the_build_ends(tmp_path: Path) -> None:
    line = Quiet("finish")
    assert called(line, tmp_path, TaskRequest("one", "tcp://1", "host", "/")) == [Aborted("a", 0.0)]
    assert line.handed == []


def test_a_second_worker_is_told_of_and_gets_the_errand_too(tmp_path: Path) -> None:
    line = Quiet()
    knocks = (TaskRequest("one", "tcp://1", "first", "/"), TaskRequest("two", "tcp://2", "second", "/"))
    said = called(line, tmp_path, *knocks, Finished("a", 0, 1.0))
    assert said == [
        Output("a", b"forge: the worker on first was lost; 'a' is restarted on second\n", stderr=True),
        Finished("a", 0, 1.0),
    ]
    assert line.handed == [*knocks]


def test_who_does_not_answer_is_left_alone(tmp_path: Path) -> None:
    said = called(Quiet(), tmp_path, TaskRequest("one", "tcp://1", "first", "/"), "interrupt", "give up")
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
        while remote_task._attempts:  # noqa: SLF001  (the last attendant ends a moment after its last word)
            time.sleep(0.01)
