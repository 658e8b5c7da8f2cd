"""From events to the timings of a build, the critical path and a trace."""

import json
from collections.abc import Mapping, Sequence
from itertools import pairwise

from hypothesis import given, settings
from hypothesis import strategies as st

from forge.plugins.charts.reporter import trace
from forge.plugins.charts.timings import (
    PackageRun,
    at_work,
    critical_path,
    page,
    read_build,
    rows,
)
from tests.strategies import graphs


def event(word: str, time: float, package: str | None = None, **said: object) -> str:
    """Return a line as forge writes it."""
    about = {"package": package, "embedded": False} if package else {}
    return json.dumps({"event": word, "time": time, **about, **said})


def planned(package: str, *needs: str, **said: object) -> str:
    """Return the Planned event of a package."""
    return event("Planned", 0.0, package, reason="new", conditional=False, needs=needs, **said)


def built(package: str, begun: float, ended: float, code: int = 0) -> list[str]:
    """Return the lines of a package with two steps of equal length."""
    middle = (begun + ended) / 2
    return [
        event("Started", begun, package, reason="new"),
        event("StepStarted", begun, package, step="cmake", argv=["cmake"], cwd="/"),
        event("StepFinished", middle, package, step="cmake", code=0),
        event("StepStarted", middle, package, step="build", argv=["cmake"], cwd="/"),
        event("StepFinished", ended, package, step="build", code=code),
        event("Finished", ended, package, code=code, seconds=ended - begun, log=None, test_failures=False),
    ]


UNTOLD = (False, "")
"""Whether a package is embedded and why it was built, where that does not matter."""
SUMMARY = event("Summary", 10.0, code=0, seconds=10.5, log=None)
DIAMOND = [
    *(planned("a", last=1.5), planned("b", "a"), planned("c", "a", last=4.02), planned("d", "b", "c")),
    *(*built("a", 0.0, 2.0), *built("c", 2.0, 6.0), *built("b", 2.5, 3.5), *built("d", 7.0, 10.0)),
    event(
        "Usage", 10.0, processors=2, memory=4_000_000_000, samples=[[5.0, 1.0, 10**9], [10.0, 2.0, 3 * 10**9]]
    ),
    SUMMARY,
]


def test_running_packages_are_listed_in_the_order_of_their_start() -> None:
    build = read_build(DIAMOND)
    assert [(run.name, run.begun, run.seconds) for run in build.packages] == [
        *(("a", 0.0, 2.0), ("c", 2.0, 4.0), ("b", 2.5, 1.0), ("d", 7.0, 3.0)),
    ]
    assert [(step.label, step.seconds, step.code) for step in build.packages[1].steps] == [
        *(("cmake", 2.0, 0), ("build", 2.0, 0)),
    ]
    assert (build.ended, build.seconds, build.code) == (10.0, 10.5, 0)


def test_the_critical_path_continues_through_packages_that_were_up_to_date() -> None:
    lines = [planned("a"), planned("b", "a"), planned("c", "b")]
    lines += [*built("a", 0.0, 3.0), event("Fresh", 3.0, "b"), *built("c", 3.0, 4.0), SUMMARY]
    build = read_build(lines)
    assert build.fresh == ("b",)
    assert [run.name for run in critical_path(build.packages)] == ["a", "c"]


def test_unfinished_steps_end_with_the_build() -> None:
    lines = [planned("a"), planned("b"), planned("c", "b"), *built("a", 0.0, 2.0, code=1)]
    lines += [
        event("Started", 0.5, "b", reason="new"),
        event("StepStarted", 1.0, "b", step="build", argv=[], cwd=""),
    ]
    lines += [event("Skipped", 2.0, "c", because="a"), event("Aborted", 2.5, "b", seconds=2.0)]
    build = read_build([*lines, '{"event": "Summ'])
    assert [(run.name, run.outcome) for run in build.packages] == [("a", "failed"), ("b", "aborted")]
    (step,) = build.packages[1].steps
    assert (step.ended, step.code) == (2.5, None)
    assert build.skipped == ("c",)
    assert page(build)["remarks"][0] == "1 failed, 1 aborted, 1 not started."


@st.composite
def schedules(draw: st.DrawFn) -> list[PackageRun]:
    """Return runs of packages, each after its dependencies."""
    graph = draw(graphs())
    ends: dict[str, float] = {}
    runs = []
    waiting = dict(graph)
    while waiting:
        name = next(name for name, needs in waiting.items() if not needs & waiting.keys())
        needs = waiting.pop(name) & graph.keys()
        begun = max((ends[need] for need in needs), default=0.0) + draw(st.integers(0, 3))
        ends[name] = begun + draw(st.integers(1, 5))
        span = (begun, ends[name])
        runs.append(PackageRun(name, *UNTOLD, *span, "finished", (), tuple(sorted(needs)), None))
    return sorted(runs, key=lambda run: run.begun)


@settings(max_examples=50)
@given(schedules())
def test_the_critical_path_is_a_lower_bound(runs: Sequence[PackageRun]) -> None:
    table = {run.name: run for run in runs}

    def longest(name: str) -> float:
        return table[name].seconds + max(map(longest, table[name].needs), default=0.0)

    path = critical_path(runs)
    seconds = sum(run.seconds for run in path)
    assert seconds == max(map(longest, table), default=0.0)
    assert seconds <= max((run.ended for run in runs), default=0.0)
    assert all(before.name in after.needs for before, after in pairwise(path))


@settings(max_examples=50)
@given(schedules())
def test_packages_in_one_row_of_a_trace_do_not_overlap(runs: Sequence[PackageRun]) -> None:
    in_row = rows(runs)
    for row in set(in_row.values()):
        members = [run for run in runs if in_row[run.name] == row]
        assert all(before.ended <= after.begun for before, after in pairwise(members))
    assert len(set(in_row.values())) == max((count for _, count in at_work(runs)), default=0)


def test_the_page_summarizes_the_build() -> None:
    shown = page(read_build(DIAMOND))
    assert shown["headline"] == "4 packages in 10.5s"
    assert shown["remarks"] == [
        "On average 1.0 packages ran in parallel, and 1.5 of 2 processors were busy.",
        "2 of them took 6.00s in total, 0.48s more than in their previous builds.",
    ]
    assert shown["critical"] == [(0, "a", "2.00s"), (1, "c", "4.00s"), (3, "d", "3.00s")]
    assert shown["critical_took"] == "9.00s"
    assert [
        (row["name"], *(row[key][1] for key in ("took", "last", "change", "waited"))) for row in shown["rows"]
    ] == [
        ("c", "4.00s", "4.02s", "unchanged", "0.00s"),
        ("d", "3.00s", "", "", "1.00s"),
        ("a", "2.00s", "1.50s", "+0.50s", "0.00s"),
        ("b", "1.00s", "", "", "0.50s"),
    ]
    assert [(row["name"], row["step"], row["took"]) for row in shown["steps"]][:2] == [
        *(("c", "cmake", "2.00s"), ("c", "build", "2.00s")),
    ]


def test_restored_packages_are_not_counted_as_built() -> None:
    taken = event("Finished", 2.1, "e", code=0, seconds=0.1, cache="from the cache")
    lines = [planned("e", last=9.0), event("Started", 2.0, "e", reason="new"), taken]
    shown = page(read_build([*DIAMOND[:-1], *lines, SUMMARY]))
    assert shown["remarks"][0] == "4 built, 1 from the cache."
    assert [row["change"][1] for row in shown["rows"] if row["name"] == "e"] == [""]
    assert {bar["name"]: bar["outcome"] for bar in shown["bars"]}["e"] == "taken"


def test_bars_show_when_steps_ran() -> None:
    shown = page(read_build(DIAMOND))
    assert [(bar["name"], bar["left"], bar["width"], bar["critical"]) for bar in shown["bars"]] == [
        ("a", "0.000%", "20.000%", True),
        ("c", "20.000%", "40.000%", True),
        ("b", "25.000%", "10.000%", False),
        ("d", "70.000%", "30.000%", True),
    ]
    assert [tuple(piece.values()) for piece in shown["bars"][0]["pieces"]] == [
        ("configure", "0.000%", "50.000%"),
        ("build", "50.000%", "50.000%"),
    ]
    assert [(strip["name"], strip["most"], strip["mean"]) for strip in shown["strips"]] == [
        ("packages at work", "2", "1.0"),
        ("processors busy", "2.0 of 2", "1.5"),
        ("memory in use", "3.0 of 4.0 GB", "2.0 GB"),
    ]
    assert shown["strips"][1]["path"] == "M0 100V50.0H500.0V0.0H1000.0V100Z"


def test_traces_nest_steps_in_packages_with_microsecond_times() -> None:
    build = read_build(DIAMOND)
    told: Mapping[str, object] = json.loads(json.dumps(trace(build)))
    events = told["traceEvents"]
    assert isinstance(events, list)
    packages = {e["name"]: e for e in events if e["ph"] == "X" and e["pid"] == 1 and e["cat"] == "package"}
    assert {name: (e["ts"], e["dur"]) for name, e in packages.items()} == {
        "a": (0, 2_000_000),
        "b": (2_500_000, 1_000_000),
        "c": (2_000_000, 4_000_000),
        "d": (7_000_000, 3_000_000),
    }
    assert packages["b"]["tid"] != packages["c"]["tid"]
    for step in (e for e in events if e.get("cat") == "step"):
        around = [p for p in packages.values() if p["tid"] == step["tid"]]
        assert any(p["ts"] <= step["ts"] and step["ts"] + step["dur"] <= p["ts"] + p["dur"] for p in around)
    assert [e["name"] for e in events if e["ph"] == "X" and e["pid"] == 2] == ["a", "c", "d"]
    counted = [e for e in events if e["ph"] == "C" and e["name"] == "processors busy"]
    assert [(e["ts"], e["args"]) for e in counted] == [
        (5_000_000, {"processors busy": 1.0}),
        (10_000_000, {"processors busy": 2.0}),
    ]
