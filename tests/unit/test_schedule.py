"""What may start next, by laws."""

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from forge.graph import closures, order
from forge.model import Aborted, BuildPlan, Finished, Output, Skipped, Started, Task
from forge.schedule import Board
from tests.packages import package
from tests.strategies import graphs


def plan_of(graph: dict[str, frozenset[str]]) -> BuildPlan:
    """Return a plan without steps whose tasks need what the graph says, however deep."""
    ordered = order(graph) or ()
    below = closures(graph, ordered)
    somewhere = Path("somewhere")
    return BuildPlan(
        {
            name: Task(name, package(name), somewhere, somewhere, tuple(sorted(below[name])), (), "")
            for name in ordered
        }
    )


@given(graphs(), st.integers(0, 3), st.sets(st.integers(0, 7)), st.booleans(), st.randoms())
def test_a_task_ends_once_after_its_needs_and_at_most_limit_run(
    graph: dict[str, frozenset[str]],
    limit: int,
    bad: set[int],
    continue_on_error: bool,  # noqa: FBT001  (hypothesis draws it)
    random: st.randoms,  # type: ignore[valid-type]
) -> None:
    plan = plan_of(graph)
    failing = {name for index, name in enumerate(plan.tasks) if index in bad}
    board = Board(plan, limit, continue_on_error=continue_on_error)
    started: list[str] = []
    done: list[str] = []
    skipped: dict[str, str] = {}
    while True:
        for event in board.advance():
            if isinstance(event, Started):
                assert set(plan.tasks[event.task].needs) <= set(done)
                started.append(event.task)
            else:
                skipped[event.task] = event.because
        if not board.running:
            break
        assert not limit or len(board.running) <= limit
        name = random.choice(sorted(board.running))  # type: ignore[attr-defined]
        board.note(Output(name, b"", stderr=False))
        board.note(Finished(name, int(name in failing), 0.0))
        if name not in failing:
            done.append(name)
    assert sorted([*started, *skipped]) == sorted(plan.tasks)
    assert len(set(started)) == len(started)
    if not failing:
        assert not skipped
    if continue_on_error:
        for name in plan.tasks:
            assert (name in skipped) == bool(set(plan.tasks[name].needs) & failing)
            assert name not in skipped or skipped[name] in failing | set(skipped)


def test_packages_that_more_others_wait_for_go_first() -> None:
    graph = {"a": frozenset[str](), "b": frozenset[str](), "c": frozenset({"b"}), "d": frozenset({"c"})}
    assert Board(plan_of(graph), 1).advance() == [Started("b")]


def test_after_a_failure_nothing_starts() -> None:
    board = Board(plan_of({"a": frozenset(), "b": frozenset(), "c": frozenset()}), 1)
    assert board.advance() == [Started("a")]
    board.note(Finished("a", 1, 0.0))
    assert board.stopped
    assert board.advance() == [Skipped("b", "a"), Skipped("c", "a")]


def test_an_aborted_package_holds_back_those_that_need_it() -> None:
    board = Board(plan_of({"a": frozenset(), "b": frozenset({"a"})}), 0)
    board.advance()
    board.note(Aborted("a", 0.0))
    assert board.advance() == [Skipped("b", "a")]
