"""The progress of a build."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.build.events import Aborted, Event, Finished, Fresh, Output, Skipped, Started, StepStarted
from forge.build.tasks import Step, StepKind
from forge.plugins.charts.progress import Progress, Running, counted_share, expectations
from forge.plugins.charts.status import lines

NAMES = st.sampled_from(["a", "b", "c", "d"])
EVENTS = st.one_of(
    NAMES.map(Started),
    st.builds(StepStarted, NAMES, st.just(Step(StepKind.BUILD, (), Path()))),
    st.builds(Finished, NAMES, st.integers(0, 1), st.floats(0, 9)),
    st.builds(Aborted, NAMES, st.floats(0, 9)),
    NAMES.map(Fresh),
    st.builds(Skipped, NAMES, st.just("x")),
    st.builds(Output, NAMES, st.sampled_from([b"[1/4] c++\n", b"[ 80%] c++\n", b"[9/3]\n"]), st.booleans()),
)


def after(progress: Progress, *events: tuple[float, Event]) -> Progress:
    """Return the progress after timed events."""
    for now, event in events:
        progress = progress.after(event, now)
    return progress


def texts(
    progress: Progress, now: float, room: int = 8, width: int = 40, **more: frozenset[str]
) -> list[str]:
    """Return the status lines without their styles."""
    return ["".join(text for _, text in line) for line in lines(progress, now, room, width, **more)]


def test_running_packages_show_their_current_step() -> None:
    begun = Progress(0.0, {}, 3)
    step = StepStarted("b", Step(StepKind.CONFIGURE, (), Path()))
    now = after(begun, (1, Started("a")), (2, Started("b")), (3, step), (4, Finished("a", 1, 3.0)))
    assert now.running == (Running("b", 2, "cmake"),)
    assert now.done == {"a"}
    assert now.failed == ("a",)
    assert texts(now, 5.0, width=30) == ["33%  1/3 packages  5.0s", "  b  cmake  3.0s", "  failed: a"]


BUILD = Step(StepKind.BUILD, (), Path())


def test_package_progress_follows_the_build_tool() -> None:
    """The count of the newest step is shown; the share of the package never decreases."""
    begun = after(Progress(0.0, {}, 2), (0, Started("a")), (0, StepStarted("a", BUILD)))
    counted = after(begun, (1, Output("a", b"[1/4] x.cpp\n[2/4] y.cpp\n", stderr=False)))
    assert texts(counted, 9.3, width=80) == [
        "[=======>                      ]  25%  0/2 packages  9.3s",
        "  a  build  50%  9.3s",
    ]
    assert after(counted, (2, Output("a", b"[4/4] z\n", stderr=True))) == counted
    nested = after(counted, (2, Output("a", b"[ 10%] Building\n", stderr=False)))
    assert (nested.running[0].share, nested.share(9.3)) == (0.1, 0.25)
    assert after(nested, (2, Output("a", b"[4/4] z\n[1/1] z\n", stderr=False))).running[0].made == 1.0
    installing = after(nested, (3, StepStarted("a", Step(StepKind.INSTALL, (), Path()))))
    assert texts(installing, 9.3)[1] == "  a  install  9.3s"
    assert texts(after(installing, (9, Finished("a", 0, 9.0))), 10.0, width=80) == [
        "[===============>              ]  50%  1/2 packages  10.0s"
    ]


@pytest.mark.parametrize(
    ("output", "share"),
    [
        (b"[3/12] Building CXX object\n[6/12] Building CXX object\n", 0.5),
        (b"[ 25%] Building CXX object CMakeFiles/x.dir/x.cpp.o\n", 0.25),
        (b"[100%] Built target x\nnote\n", 1.0),
        (b"1/4 Test #1: gtest .......   Passed    0.01 sec\n", 0.25),
        (b"test/test_a.py ..F    [ 60%]\n", 0.6),
        (b"[1/0] nothing\n", None),
        (b"[INFO] ready\n", None),
        (b"1 of 2\n", None),
        (b"", None),
    ],
)
def test_progress_counts_of_build_tools_are_parsed(output: bytes, share: float | None) -> None:
    assert counted_share(output) == share


def test_the_remaining_time_is_estimated_from_the_pace_so_far() -> None:
    """Two of four equal packages took ten seconds, and half of the third is done."""
    begun = Progress(0.0, expectations("abcd", {"a": 6.0, "b": 6.0, "c": 6.0}), 4)
    halfway = after(begun, (0, Started("a")), (5, Finished("a", 0, 5.0)), (7, Finished("b", 0, 2.0)))
    assert halfway.left(1.0) is None
    assert halfway.left(10.0) == 10.0
    running = after(halfway, (7, Started("c")))
    assert running.left(10.0) == (24 - 15) * 10 / 15
    assert after(running, (10, Fresh("d"))).left(10.0) == (18 - 15) * 10 / 15


def test_a_damaged_record_of_durations_gives_no_estimate() -> None:
    """A package with a recorded duration of 2.2e-308 seconds would have an infinite pace."""
    begun = Progress(0.0, expectations("ab", {"a": 2.2e-308, "b": 1.0}), 2)
    after_a = after(begun, (0, Started("a")), (5, Finished("a", 0, 5.0)))
    assert after_a.left(10.0) is None
    assert texts(after_a, 10.0, width=30) == ["0%  1/2 packages  10.0s"]


@given(st.lists(st.tuples(st.floats(0, 100), EVENTS)), st.dictionaries(NAMES, st.floats(0, 100)))
def test_any_order_of_events_is_handled(
    events: list[tuple[float, Event]], expected: dict[str, float]
) -> None:
    now = after(Progress(0.0, expected, 4), *events)
    left = now.left(100.0)
    assert left is None or left >= 0
    assert 0 <= now.share(100.0) <= 1
    assert len(texts(now, 100.0, 2)) <= 5
