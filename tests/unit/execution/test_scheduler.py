"""Properties of the scheduler."""

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from forge.base.graph import closures, order
from forge.build.events import Finished, Output, Started
from forge.build.tasks import BuildPlan, Task
from forge.execution.loop import Scheduler
from tests.packages import package
from tests.strategies import graphs


def plan_of(graph: dict[str, frozenset[str]]) -> BuildPlan:
    """Return a plan without steps whose tasks need all transitive dependencies in the graph."""
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
def test_scheduling_respects_dependencies_and_the_limit(
    graph: dict[str, frozenset[str]],
    limit: int,
    bad: set[int],
    continue_on_error: bool,
    random: st.randoms,  # type: ignore[valid-type]
) -> None:
    plan = plan_of(graph)
    failing = {name for index, name in enumerate(plan.tasks) if index in bad}
    scheduler = Scheduler(plan, limit, continue_on_error=continue_on_error)
    started: list[str] = []
    done: list[str] = []
    skipped: dict[str, str] = {}
    while True:
        for event in scheduler.advance():
            if isinstance(event, Started):
                assert set(plan.tasks[event.task].needs) <= set(done)
                started.append(event.task)
            else:
                skipped[event.task] = event.because
        if not scheduler.running:
            break
        assert not limit or len(scheduler.running) <= limit
        name = random.choice(sorted(scheduler.running))  # type: ignore[attr-defined]
        scheduler.note(Output(name, b"", stderr=False))
        scheduler.note(Finished(name, int(name in failing), 0.0))
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


@given(graphs(), st.integers(1, 3), st.lists(st.integers(0, 9), min_size=8, max_size=8))
def test_tasks_with_the_longest_remaining_path_start_first(
    graph: dict[str, frozenset[str]], limit: int, lengths: list[int]
) -> None:
    plan = plan_of(graph)
    seconds = {name: float(length) for name, length in zip(plan.tasks, lengths, strict=False) if length}
    known = sorted(seconds.values())
    usual = known[len(known) // 2] if known else 0.0

    def chain(name: str) -> float:
        above = [chain(other) for other in graph if name in graph[other]]
        return seconds.get(name, usual) + max(above, default=0.0)

    scheduler = Scheduler(plan, limit, seconds)
    done: set[str] = set()
    waiting = set(plan.tasks)
    while (events := scheduler.advance()) or scheduler.running:
        started = {event.task for event in events}
        waiting -= started
        ready = {name for name in waiting if graph[name] <= done}
        assert not ready or not started or min(map(chain, started)) >= max(map(chain, ready))
        name = min(scheduler.running, key=lambda one: seconds.get(one, usual))
        scheduler.note(Finished(name, 0, 0.0))
        done.add(name)
    assert not waiting


def test_long_chains_start_before_short_ones() -> None:
    """Three packages wait for 'wide', but the path after 'deep' takes longer."""
    graph = {"wide": frozenset[str](), "deep": frozenset[str](), "end": frozenset({"deep"})}
    graph |= {name: frozenset({"wide"}) for name in "abc"}
    known = {"wide": 1.0, "deep": 1.0, "end": 9.0, "a": 1.0, "b": 1.0, "c": 1.0}
    assert Scheduler(plan_of(graph), 1).advance() == [Started("wide")]
    assert Scheduler(plan_of(graph), 1, known).advance() == [Started("deep")]
    first = next(iter(plan_of(graph).tasks))
    for seconds in (known, {**known, "wide": 99.0}):
        assert Scheduler(plan_of(graph), 1, seconds, in_order=True).advance() == [Started(first)]


def test_packages_without_history_have_the_average_duration() -> None:
    graph = {name: frozenset[str]() for name in ("short", "new", "long", "longer")}
    scheduler = Scheduler(plan_of(graph), 1, {"short": 1.0, "long": 5.0, "longer": 7.0})
    order = []
    while events := scheduler.advance():
        order += [event.task for event in events]
        scheduler.note(Finished(order[-1], 0, 0.0))
    assert order[0] == "longer"
    assert order[-1] == "short"
