"""Dask: shared jobs, step runners, and a cluster in this process."""

import logging
import os
import pickle
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from distributed import LocalCluster

from forge.build.events import Aborted, Event, Finished, Output, StepFinished, StepStarted
from forge.execution.options import JobOptions
from forge.plugins.dask import worker
from forge.plugins.dask.messages import FINISH, RemoteTask
from forge.plugins.dask.step_runner import COMMANDS_THREAD, read_message, run_task, with_length
from forge.plugins.dask.worker import WorkerJobs
from tests.conftest import Forge, Tree
from tests.packages import manifest_text
from tests.plugins.dask.test_messages import task


def test_slots_share_the_remaining_jobs() -> None:
    jobs = WorkerJobs(5, 2)
    jobs.prepare({"PATH": os.environ["PATH"]})
    for _ in range(2):
        with jobs.slot() as one, jobs.slot() as two:
            assert one == two
            number, auth, _ = one
            assert number == "5"
            reader = os.open(auth.removeprefix("fifo:"), os.O_RDONLY) if auth.startswith("fifo:") else None
            if reader is not None:
                # Tokens that were never returned are restored once no slot is in use.
                assert os.read(reader, 10) == b"+++"
                os.close(reader)


def test_jobs_are_split_between_slots_without_a_jobserver(tmp_path: Path) -> None:
    jobs = WorkerJobs(5, 2)
    tool = tmp_path / "ninja"
    tool.write_text("#!/bin/sh\nexit 1\n", encoding="utf-8")
    tool.chmod(0o755)
    assert jobs.prepare({"PATH": "", "NINJA": str(tool)}) in {(), ("make",)}
    if not jobs.prepare({}):
        with jobs.slot() as slot:
            assert slot == ("2", "", ())


class RunningSteps:
    """A step runner in a thread, at the other end of two pipes."""

    def __init__(self, remote_task: RemoteTask) -> None:
        theirs, self._source = os.pipe()
        self.target, ours = os.pipe()
        self._ends = (os.fdopen(theirs, "rb", buffering=0), os.fdopen(ours, "wb"))
        self.thread = threading.Thread(target=self.run)
        self.thread.start()
        os.write(self._source, with_length(pickle.dumps(remote_task)))

    def run(self) -> None:
        source, target = self._ends
        with target:
            run_task(["1", ""], source, target)

    def events(self) -> Iterator[Event]:
        with os.fdopen(self.target, "rb") as stream:
            while True:
                event = pickle.loads(read_message(stream))
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
        os.write(self._source, f"{command}\n".encode())

    def leave(self) -> None:
        """Close its stdin: the result is no longer needed."""
        if self._source >= 0:
            os.close(self._source)
            self._source = -1


def test_a_step_runner_reports_all_events(tmp_path: Path) -> None:
    running = RunningSteps(
        RemoteTask(task(tmp_path, "print('hello')"), dict(os.environ), JobOptions(), tmp_path / "lock")
    )
    kinds = [type(event) for event in running.events()]
    assert kinds == [StepStarted, Output, StepFinished, Finished]


@pytest.mark.parametrize("command", [FINISH, "interrupt", None])
def test_a_step_runner_ends_on_request_or_when_its_parent_exits(tmp_path: Path, command: str | None) -> None:
    program = "import time; print('begun', flush=True); time.sleep(%s)" % (1 if command == FINISH else 60)
    running = RunningSteps(
        RemoteTask(
            task(tmp_path, program, "print('never')"), dict(os.environ), JobOptions(), tmp_path / "lock"
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


@pytest.mark.needs("cmake", "ninja")
def test_an_in_process_cluster_builds(forge: Forge, tree: Tree) -> None:
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
        assert "CMake Error" in ran.err
        # More messages than may be unacknowledged at a time.
        (root / "src/a/CMakeLists.txt").write_text(flood, encoding="utf-8")
        ran = forge("build", "--executor", "dask", "--scheduler", address, cwd=root)
        assert ran.code == 0, ran.err
        log = root / "log/latest_build/a/stdout.log"
        assert log.read_bytes().count(b"0123456789\n") == 1_500_000
        while worker._attempts:
            time.sleep(0.01)
