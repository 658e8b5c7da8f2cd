"""The job pool loses no tokens, gives packages their jobs, and never deadlocks."""

import os
import threading
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from forge.build.tasks import Step, StepKind
from forge.execution.job_pool import JobPool
from forge.execution.jobserver import (
    FIFO,
    PIPE,
    TOKEN,
    common_style,
    create_pool,
    join_pool,
    without_jobserver_notices,
)
from forge.execution.makeflags import MakeFlags, read_make_flags

BOTH, ONLY_FIFO, ONLY_PIPE, NONE = (
    frozenset({FIFO, PIPE}),
    frozenset({FIFO}),
    frozenset({PIPE}),
    frozenset[str](),
)
TOOLS = frozenset({"ninja", "make"})


def wait_for(condition: Callable[[], bool]) -> None:
    """Wait until another thread makes a condition true."""
    for _ in range(500):
        if condition():
            return
        time.sleep(0.01)
    pytest.fail("timeout")


def tokens_in(auth: str) -> bytes:
    """Return the tokens in a pool, which stay there."""
    end = os.open(auth.removeprefix("fifo:"), os.O_RDWR | os.O_NONBLOCK)
    try:
        found = os.read(end, 100)
        os.write(end, found)
    except BlockingIOError:
        found = b""
    os.close(end)
    return found


def step(tmp_path: Path, kind: StepKind = StepKind.BUILD) -> Step:
    return Step(kind, ("true",), tmp_path)


def auth_in(job_pool: JobPool, tmp_path: Path) -> str:
    """Return the address of the pool in the MAKEFLAGS of tools."""
    with job_pool.tools(step(tmp_path), {}) as (variables, _):
        return read_make_flags(variables["MAKEFLAGS"]).auth or ""


@pytest.mark.parametrize(
    ("styles", "style"),
    [
        ({"ninja": BOTH, "make": ONLY_PIPE}, PIPE),
        ({"ninja": BOTH, "make": BOTH}, FIFO),
        ({"ninja": ONLY_FIFO, "make": BOTH}, FIFO),
        ({"ninja": ONLY_FIFO, "make": ONLY_PIPE}, PIPE),
        ({"ninja": NONE, "make": ONLY_PIPE}, PIPE),
        ({"ninja": BOTH}, FIFO),
        ({"ninja": NONE}, None),
        ({}, None),
    ],
)
def test_all_tools_of_a_build_share_one_jobserver_style(
    styles: dict[str, frozenset[str]], style: str | None
) -> None:
    assert common_style(styles) == style


def test_ninja_jobserver_notices_are_hidden() -> None:
    notice = b"ninja: Jobserver mode detected:  -j2 --jobserver-auth=3,4\n"
    warning = b"ninja: warning: Jobserver 'pipe' mode detected, a pool that"
    error = b"ninja: error: loading 'build.ninja'\n"
    assert without_jobserver_notices(error + notice + error + warning) == error + error


def test_tokens_not_held_by_packages_are_available_to_tools(tmp_path: Path) -> None:
    """All of them come back."""
    with closing(JobPool(3, create_pool(FIFO), TOOLS)) as job_pool:
        auth = auth_in(job_pool, tmp_path)
        with job_pool.package() as first:
            assert first
            wait_for(lambda: tokens_in(auth) == TOKEN * 2)
            with job_pool.package():
                wait_for(lambda: tokens_in(auth) == TOKEN)
            wait_for(lambda: tokens_in(auth) == TOKEN * 2)
        wait_for(lambda: tokens_in(auth) == TOKEN * 3)


def test_there_are_never_more_packages_than_jobs() -> None:
    running: list[int] = []
    most: list[int] = []
    with closing(JobPool(3, create_pool(PIPE))) as job_pool:

        def run(number: int) -> None:
            for _ in range(5):
                with job_pool.package():
                    running.append(number)
                    most.append(len(running))
                    time.sleep(0.001)
                    running.remove(number)

        threads = [threading.Thread(target=run, args=(number,)) for number in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert max(most) <= 3
    assert len(most) == 40


def test_an_exclusive_package_waits_for_others_and_blocks_new_ones() -> None:
    """Two that want to be alone do not wait for each other to end."""
    running: set[int] = set()
    alone: list[set[int]] = []
    with closing(JobPool(4, create_pool(PIPE))) as job_pool:

        def run(number: int) -> None:
            with job_pool.package():
                running.add(number)
                time.sleep(0.01)
                if number % 3 == 0:
                    running.discard(number)
                    with job_pool.alone():
                        for _ in range(5):
                            alone.append(set(running))
                            time.sleep(0.001)
                running.discard(number)

        threads = [threading.Thread(target=run, args=(number,)) for number in range(9)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(20)
            assert not thread.is_alive()
    assert alone == [set()] * 15


def test_an_exclusive_step_runs_one_job(tmp_path: Path) -> None:
    with (
        closing(JobPool(4, create_pool(FIFO), TOOLS)) as job_pool,
        job_pool.package(),
        job_pool.tools(step(tmp_path), {}, alone=True) as (variables, descriptors),
    ):
        assert variables["CMAKE_BUILD_PARALLEL_LEVEL"] == "1"
        assert "MAKEFLAGS" not in variables
        assert descriptors == ()


def test_lost_tokens_are_replaced_when_nothing_runs(tmp_path: Path) -> None:
    """A killed tool does not return its tokens; the next package must not wait for them forever."""
    with closing(JobPool(2, create_pool(FIFO), TOOLS)) as job_pool:
        auth = auth_in(job_pool, tmp_path)
        with job_pool.package():
            pass
        wait_for(lambda: tokens_in(auth) == TOKEN * 2)
        killed = os.open(auth.removeprefix("fifo:"), os.O_RDWR)
        os.read(killed, 2)
        with job_pool.package() as begun:
            assert begun
        os.close(killed)


def test_low_memory_allows_one_package_and_drains_the_pool(tmp_path: Path) -> None:
    short = threading.Event()
    with closing(JobPool(3, create_pool(FIFO), TOOLS, is_overloaded=short.is_set)) as job_pool:
        auth = auth_in(job_pool, tmp_path)
        begun = threading.Event()

        def run() -> None:
            with job_pool.package():
                begun.set()

        with job_pool.package():
            wait_for(lambda: tokens_in(auth) == TOKEN * 2)
            short.set()
            wait_for(lambda: tokens_in(auth) == b"")
            second = threading.Thread(target=run)
            second.start()
            assert not begun.wait(0.4)
            short.clear()
            assert begun.wait(5)
            second.join()
            wait_for(lambda: tokens_in(auth) == TOKEN * 2)
        short.set()
        for _ in range(3):
            with job_pool.package() as alone:
                assert alone


def test_variables_and_arguments_of_a_step_depend_on_its_tool(tmp_path: Path) -> None:
    given = {"MAKEFLAGS": "-k -j9", "CMAKE_BUILD_PARALLEL_LEVEL": "9", "X": "1"}
    flags = MakeFlags(rest=("-k",))

    def without_jobserver(jobs: str) -> dict[str, str]:
        return {"MAKEFLAGS": "-k", "CMAKE_BUILD_PARALLEL_LEVEL": jobs, "CARGO_BUILD_JOBS": jobs, "X": "1"}

    with closing(JobPool(4, create_pool(PIPE), frozenset({"make"}), flags)) as job_pool, job_pool.package():
        with job_pool.tools(step(tmp_path, StepKind.CONFIGURE), given) as (variables, descriptors):
            assert variables == without_jobserver("1")
            assert not descriptors
        with job_pool.tools(step(tmp_path), given) as (variables, descriptors):
            reader, writer = descriptors
            assert variables == {"MAKEFLAGS": f"-j4 --jobserver-auth={reader},{writer} -k", "X": "1"}
        (tmp_path / "build.ninja").touch()
        with job_pool.tools(step(tmp_path), given) as (variables, descriptors):
            assert variables == without_jobserver("4")
            assert not descriptors


@pytest.mark.parametrize("style", [FIFO, PIPE])
def test_an_outer_jobserver_is_joined_and_left_unchanged(style: str, tmp_path: Path) -> None:
    """One job needs no token: the parent make granted it implicitly."""
    with closing(create_pool(style)) as outer:
        outer.give(b"a")
        outer.give(b"b")
        pool = join_pool(outer.auth)
        assert pool is not None
        assert (pool.style, pool.joined) == (style, True)
        with closing(JobPool(8, pool, TOOLS)) as job_pool:
            assert auth_in(job_pool, tmp_path) == outer.auth
            with job_pool.package(), job_pool.package(), job_pool.package():
                assert outer.take_now() == b""
                begun = threading.Event()

                def run() -> None:
                    with job_pool.package():
                        begun.set()

                fourth = threading.Thread(target=run)
                fourth.start()
                assert not begun.wait(0.1)
                outer.give(b"c")
                assert begun.wait(5)
                fourth.join()
        assert sorted(outer.take_now() for _ in range(4)) == [b"", b"a", b"b", b"c"]


@pytest.mark.parametrize("auth", ["900,901", "fifo:/no/such/fifo", f"fifo:{os.devnull}", "0", "a,b", "-2,-2"])
def test_an_invalid_jobserver_is_not_joined(auth: str) -> None:
    assert join_pool(auth) is None


def test_a_package_gets_at_most_its_share_of_the_jobs() -> None:
    several = Step(StepKind.CTEST, ("ctest",), Path(), tests_at_once=3)
    pool = JobPool(8)
    with pool.package(), pool.tools(several, {}) as (first, _):
        assert first["CTEST_PARALLEL_LEVEL"] == "3"
        with pool.package(), pool.tools(several, {"CTEST_PARALLEL_LEVEL": "7"}) as (second, _):
            assert second["CTEST_PARALLEL_LEVEL"] == "7"
    pool.close()
