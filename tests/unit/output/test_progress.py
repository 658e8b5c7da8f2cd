"""The progress of a build."""

from __future__ import annotations

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from forge.build.events import Aborted, Event, Finished, Fresh, Skipped, Started, StepStarted
from forge.build.tasks import Step, StepKind
from forge.output.live import lines
from forge.output.progress import Progress, Running, expectations

NAMES = st.sampled_from(["a", "b", "c", "d"])
EVENTS = st.one_of(
    NAMES.map(Started),
    st.builds(StepStarted, NAMES, st.just(Step(StepKind.BUILD, (), Path()))),
    st.builds(Finished, NAMES, st.integers(0, 1), st.floats(0, 9)),
    st.builds(Aborted, NAMES, st.floats(0, 9)),
    NAMES.map(Fresh),
    st.builds(Skipped, NAMES, st.just("x")),
)


def after(progress: Progress, *events: tuple[float, Event]) -> Progress:
    """Return where a build stands after timed events."""
    for now, event in events:
        progress = progress.after(event, now)
    return progress


def lines_of(progress: Progress, now: float) -> str:
    """Return the first line."""
    return next(lines(progress, now, 8))[1]


def test_what_runs_is_known_with_its_step() -> None:
    begun = Progress(0.0, {}, 3)
    step = StepStarted("b", Step(StepKind.CONFIGURE, (), Path()))
    now = after(begun, (1, Started("a")), (2, Started("b")), (3, step), (4, Finished("a", 1, 3.0)))
    assert now.running == (Running("b", 2, "cmake"),)
    assert now.done == {"a"}
    assert now.failed == ("a",)
    assert [line for _, line in lines(now, 5.0, 8)] == ["[1/3]  5.00s", "  b  cmake     3.00s", "  failed: a"]


def test_what_does_not_fit_is_counted() -> None:
    many = after(Progress(0.0, {}, 9), *((0.0, Started(f"p{number}")) for number in range(9)))
    assert [line for _, line in lines(many, 1.0, 2)][1:] == [
        "  p0            1.00s",
        "  p1            1.00s",
        "  and 7 more",
    ]


def test_the_rest_is_estimated_at_the_pace_until_now() -> None:
    """Two of four equal packages took ten seconds, and half of the third is done."""
    begun = Progress(0.0, expectations("abcd", {"a": 6.0, "b": 6.0, "c": 6.0}), 4)
    halfway = after(begun, (0, Started("a")), (5, Finished("a", 0, 5.0)), (7, Finished("b", 0, 2.0)))
    assert halfway.left(1.0) is None
    assert halfway.left(10.0) == 10.0
    running = after(halfway, (7, Started("c")))
    assert running.left(10.0) == (24 - 15) * 10 / 15
    assert after(running, (10, Fresh("d"))).left(10.0) == (18 - 15) * 10 / 15


def test_a_damaged_record_of_durations_gives_no_estimate() -> None:
    """The pace of a package that is said to take 2.2e-308 seconds is infinite."""
    begun = Progress(0.0, expectations("ab", {"a": 2.2e-308, "b": 1.0}), 2)
    after_a = after(begun, (0, Started("a")), (5, Finished("a", 0, 5.0)))
    assert after_a.left(10.0) is None
    assert [line for _, line in lines(after_a, 10.0, 8)] == ["[1/2]  10.0s"]


def test_what_may_be_up_to_date_is_not_estimated() -> None:
    """An edit that changes nothing installed rebuilds one package, however many depend on it."""
    known = dict.fromkeys("abcd", 10.0)
    begun = after(Progress(0.0, known, 4, unsure=frozenset("cd")), (0, Started("a")))
    assert begun.left(5.0) == 15.0
    assert lines_of(begun, 5.0) == "[0/4]  5.00s  at least 15.0s left"
    both = after(begun, (10, Finished("a", 0, 10.0)), (10, Started("c")))
    assert both.left(10.0) == 20.0, "c was not up to date"
    end = after(both, (20, Finished("c", 0, 10.0)), (20, Fresh("d")))
    assert lines_of(end, 20.0) == "[3/4]  20.0s  about 10.0s left"


def test_without_experience_there_is_no_estimate() -> None:
    assert after(Progress(0.0, expectations("ab", {}), 2), (9, Finished("a", 0, 9.0))).left(10.0) is None


@given(st.lists(st.tuples(st.floats(0, 100), EVENTS)), st.dictionaries(NAMES, st.floats(0, 100)))
def test_any_order_of_events_is_survived(
    events: list[tuple[float, Event]], expected: dict[str, float]
) -> None:
    now = after(Progress(0.0, expected, 4), *events)
    left = now.left(100.0)
    assert left is None or left >= 0
    assert len([line for _, line in lines(now, 100.0, 2)]) <= 5
