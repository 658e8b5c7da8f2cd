"""The pool and the budget: tokens are conserved, packages are served, nobody waits for ever."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import threading
import time
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from forge.build.model import BuildInputs, BuildRecord
from forge.build.tasks import BuildPlan, Step, StepKind, Task
from forge.execution.job_pool import JobPool
from forge.execution.jobserver import (
    FIFO,
    PIPE,
    TOKEN,
    common_style,
    create_pool,
    join_pool,
    supported_styles,
    without_jobserver_notices,
)
from forge.execution.loop import execute
from forge.execution.makeflags import MakeFlags, read_make_flags
from forge.execution.runner import ProcessRunner, TaskLifecycle
from forge.execution.scheduler import Scheduler
from tests.packages import package

if TYPE_CHECKING:
    from collections.abc import Callable

BOTH, ONLY_FIFO, ONLY_PIPE, NONE = (
    frozenset({FIFO, PIPE}),
    frozenset({FIFO}),
    frozenset({PIPE}),
    frozenset[str](),
)
FLUENT = frozenset({"ninja", "make"})


def wait_for(true: Callable[[], bool]) -> None:
    """Wait until something holds that another thread brings about."""
    for _ in range(500):
        if true():
            return
        time.sleep(0.01)
    pytest.fail("it never came to that")


def lying_in(auth: str) -> bytes:
    """Take all tokens out of the pool at an address, and put them back."""
    end = os.open(auth.removeprefix("fifo:"), os.O_RDWR | os.O_NONBLOCK)
    try:
        found = os.read(end, 100)
        os.write(end, found)
    except BlockingIOError:
        found = b""
    os.close(end)
    return found


def step(tmp_path: Path, kind: StepKind = StepKind.BUILD) -> Step:
    """Return a step in a folder."""
    return Step(kind, ("true",), tmp_path)


def auth_in(budget: JobPool, tmp_path: Path) -> str:
    """Return the address of the pool that tools are told of."""
    with budget.tools(step(tmp_path), {}) as (variables, _):
        return read_make_flags(variables["MAKEFLAGS"]).auth or ""


@pytest.mark.parametrize(
    ("spoken_by", "style"),
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
def test_a_run_has_the_one_style_that_all_its_tools_speak(
    spoken_by: dict[str, frozenset[str]], style: str | None
) -> None:
    assert common_style(spoken_by) == style


@pytest.mark.needs("make")
def test_a_tool_is_tried(tmp_path: Path) -> None:
    """GNU make says in its version what it speaks; a program that speaks nothing, or fails, is no speaker."""
    make = shutil.which("make") or ""
    version = subprocess.run((make, "--version"), capture_output=True, text=True, check=True).stdout.split()[
        2
    ]
    expected = BOTH if tuple(map(int, version.split(".")[:2])) >= (4, 4) else ONLY_PIPE
    assert supported_styles("make", Path(make), os.environ) == expected
    assert supported_styles("ninja", Path(make), os.environ) == NONE
    assert supported_styles("make", tmp_path / "none", os.environ) == NONE


@pytest.mark.needs("ninja")
def test_ninjas_speak_as_their_version_lets_expect() -> None:
    ninja = shutil.which("ninja") or ""
    said = subprocess.run((ninja, "--version"), capture_output=True, text=True, check=True).stdout.strip()
    found = supported_styles("ninja", Path(ninja), os.environ)
    if tuple(map(int, said.split(".")[:2])) >= (1, 13):
        assert FIFO in found
        assert (PIPE in found) == ("pipe" in said)
    elif "jobserver" in said:
        assert found == ONLY_PIPE
    else:
        assert found == NONE


def test_ninjas_remarks_about_the_jobserver_are_no_output() -> None:
    blurb = b"ninja: Jobserver mode detected:  -j2 --jobserver-auth=3,4\n"
    warning = b"ninja: warning: Jobserver 'pipe' mode detected, a pool that"
    error = b"ninja: error: loading 'build.ninja'\n"
    assert without_jobserver_notices(error + blurb + error + warning) == error + error
    assert without_jobserver_notices(blurb) == b""
    assert without_jobserver_notices(error) == error


def test_tokens_that_no_package_has_are_the_tools(tmp_path: Path) -> None:
    """And all come back: three jobs, of which packages hold two, then one, then none."""
    with closing(JobPool(3, create_pool(FIFO), FLUENT)) as budget:
        auth = auth_in(budget, tmp_path)
        with budget.package() as first:
            assert first
            wait_for(lambda: lying_in(auth) == TOKEN * 2)
            with budget.package():
                wait_for(lambda: lying_in(auth) == TOKEN)
            wait_for(lambda: lying_in(auth) == TOKEN * 2)
        wait_for(lambda: lying_in(auth) == TOKEN * 3)


def test_a_package_gets_the_token_that_a_tool_returns(tmp_path: Path) -> None:
    with closing(JobPool(2, create_pool(FIFO), FLUENT)) as budget:
        auth = auth_in(budget, tmp_path)
        with budget.package():
            wait_for(lambda: lying_in(auth) == TOKEN)
            tool = os.open(auth.removeprefix("fifo:"), os.O_RDWR)
            token = os.read(tool, 1)
            begun = threading.Event()

            def run() -> None:
                with budget.package():
                    begun.set()

            thread = threading.Thread(target=run)
            thread.start()
            assert not begun.wait(0.1)
            os.write(tool, token)
            assert begun.wait(5)
            thread.join()
            os.close(tool)


def test_packages_never_outnumber_the_jobs() -> None:
    running: list[int] = []
    most: list[int] = []
    with closing(JobPool(3, create_pool(PIPE))) as budget:

        def run(number: int) -> None:
            for _ in range(5):
                with budget.package():
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


def test_lost_tokens_are_replaced_when_nothing_runs(tmp_path: Path) -> None:
    """A tool that is killed returns nothing; the next package must not wait for it for ever."""
    with closing(JobPool(2, create_pool(FIFO), FLUENT)) as budget:
        auth = auth_in(budget, tmp_path)
        with budget.package():
            pass
        wait_for(lambda: lying_in(auth) == TOKEN * 2)
        thief = os.open(auth.removeprefix("fifo:"), os.O_RDWR)
        os.read(thief, 2)
        with budget.package() as begun:
            assert begun
        os.close(thief)


def test_while_memory_is_short_one_package_runs_and_the_pool_is_drained(tmp_path: Path) -> None:
    short = threading.Event()
    with closing(JobPool(3, create_pool(FIFO), FLUENT, is_short=short.is_set)) as budget:
        auth = auth_in(budget, tmp_path)
        begun = threading.Event()

        def run() -> None:
            with budget.package():
                begun.set()

        with budget.package():
            wait_for(lambda: lying_in(auth) == TOKEN * 2)
            short.set()
            wait_for(lambda: lying_in(auth) == b"")
            second = threading.Thread(target=run)
            second.start()
            assert not begun.wait(0.4)
            short.clear()
            assert begun.wait(5)
            second.join()
            wait_for(lambda: lying_in(auth) == TOKEN * 2)
        short.set()
        for _ in range(3):
            with budget.package() as alone:
                assert alone


def test_a_stopped_build_begins_no_package() -> None:
    with closing(JobPool(1)) as budget:
        results: list[bool] = []

        def run() -> None:
            with budget.package() as begun:
                results.append(begun)

        with budget.package():
            waiting = threading.Thread(target=run)
            waiting.start()
            time.sleep(0.05)
            budget.stop()
            waiting.join()
    assert results == [False]


def test_what_a_step_is_told_depends_on_its_tool(tmp_path: Path) -> None:
    given = {"MAKEFLAGS": "-k -j9", "CMAKE_BUILD_PARALLEL_LEVEL": "9", "X": "1"}
    flags = MakeFlags(rest=("-k",))
    with closing(JobPool(4, create_pool(PIPE), frozenset({"make"}), flags)) as budget, budget.package():
        with budget.tools(step(tmp_path, StepKind.CONFIGURE), given) as (variables, descriptors):
            assert variables == {"MAKEFLAGS": "-k", "CMAKE_BUILD_PARALLEL_LEVEL": "1", "X": "1"}
            assert not descriptors
        with budget.tools(step(tmp_path), given) as (variables, descriptors):
            reader, writer = descriptors
            assert variables == {"MAKEFLAGS": f"-j4 --jobserver-auth={reader},{writer} -k", "X": "1"}
        (tmp_path / "build.ninja").touch()
        with budget.tools(step(tmp_path), given) as (variables, descriptors):
            assert variables == {"MAKEFLAGS": "-k", "CMAKE_BUILD_PARALLEL_LEVEL": "4", "X": "1"}
            assert not descriptors


def test_fixed_shares_add_up_to_the_budget(tmp_path: Path) -> None:
    level = "CMAKE_BUILD_PARALLEL_LEVEL"
    with closing(JobPool(5)) as budget, budget.package():
        with budget.package(), budget.tools(step(tmp_path), {}) as (one, _):
            assert one[level] == "2"
            with budget.tools(step(tmp_path), {}) as (other, _):
                assert other[level] == "2"
        with budget.tools(step(tmp_path), {}) as (alone, _):
            assert alone[level] == "5"


@pytest.mark.parametrize("style", [FIFO, PIPE])
def test_a_pool_above_us_is_joined_and_left_as_it_was(style: str, tmp_path: Path) -> None:
    """One job needs no token of it: the one that the make above gave by starting us."""
    with closing(create_pool(style)) as outer:
        outer.give(b"a")
        outer.give(b"b")
        pool = join_pool(outer.auth)
        assert pool is not None
        assert (pool.style, pool.joined) == (style, True)
        with closing(JobPool(8, pool, FLUENT)) as budget:
            assert auth_in(budget, tmp_path) == outer.auth
            with budget.package(), budget.package(), budget.package():
                assert outer.take_now() == b""
                begun = threading.Event()

                def run() -> None:
                    with budget.package():
                        begun.set()

                fourth = threading.Thread(target=run)
                fourth.start()
                assert not begun.wait(0.1)
                outer.give(b"c")
                assert begun.wait(5)
                fourth.join()
        assert sorted(outer.take_now() for _ in range(4)) == [b"", b"a", b"b", b"c"]


@pytest.mark.parametrize("auth", ["900,901", "fifo:/no/such/fifo", f"fifo:{os.devnull}", "0", "a,b", "-2,-2"])
def test_what_is_no_pool_cannot_be_joined(auth: str) -> None:
    assert join_pool(auth) is None


def test_a_budget_that_nobody_uses_ends_at_once() -> None:
    """Also one that joined, which waits for a token that never comes."""
    program = """if True:
        import threading
        from contextlib import closing
        from forge.execution.job_pool import JobPool
        from forge.execution.jobserver import create_pool, join_pool
        outer = create_pool("fifo")
        with closing(JobPool(2, create_pool("pipe"))):
            pass
        with closing(JobPool(2, join_pool(outer.auth))) as budget, budget.package():
            threading.Thread(target=lambda: budget.package().__enter__(), daemon=True).start()
            threading.Event().wait(0.1)
    """
    subprocess.run((sys.executable, "-W", "error", "-c", program), check=True, timeout=20)


def test_what_waits_for_a_token_is_aborted_with_the_build(tmp_path: Path) -> None:
    """Two packages may begin, but there is one job: when the first fails, the second never ran.

    The failure and the token it gives back race through two threads: one clean stop in five is asked for.
    """
    ends = [_end_of_the_one_that_waits(tmp_path / str(number)) for number in range(5)]
    assert ["Started", "Aborted"] in ends


def _end_of_the_one_that_waits(tmp_path: Path) -> list[str]:
    tmp_path.mkdir()
    steps = {
        "bad": "import time; time.sleep(0.3); raise SystemExit(1)",
        "late": "print('never')",
    }
    tasks = {
        name: Task(
            name,
            package(name),
            tmp_path,
            tmp_path / name,
            (),
            (Step(StepKind.INSTALL, (sys.executable, "-c", code), tmp_path),),
            "",
        )
        for name, code in steps.items()
    }
    plan = BuildPlan(tasks)
    with closing(JobPool(1)) as budget:
        runner = ProcessRunner(
            TaskLifecycle(
                lambda _: os.environ, lambda _task, _variables: None, lambda _: BuildRecord(BuildInputs())
            ),
            budget,
        )
        events = list(execute(plan, runner, Scheduler(plan, 2), lambda task: task))
    return [type(event).__name__ for event in events if event.task == "late"]


def test_memory_is_looked_at_by_the_clock_however_many_packages_come_and_go() -> None:
    looks: list[float] = []

    def short() -> bool:
        looks.append(time.monotonic())
        return False

    begun = time.monotonic()
    with closing(JobPool(2, is_short=short)) as budget:
        for _ in range(200):
            with budget.package():
                time.sleep(0.001)
        passed = time.monotonic() - begun
        assert len(looks) <= 2 + passed / 0.25
        wait_for(lambda: looks[-1] - begun > passed)
