"""Work of a build by kind and file, the least possible time, and the difference between builds."""

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forge.plugins.charts.reporter import read_log
from forge.plugins.charts.timings import Build, read_build
from forge.plugins.charts.work import bounds, comparison, lines, phases, work
from tests.plugins.charts.test_timings import event, planned

SUMMARY = event("Summary", 10.0, code=0, seconds=10.0, log=None)
USAGE = event("Usage", 10.0, processors=8, jobs=2, memory=10**9, samples=[])


def steps(package: str, *moments: float) -> list[str]:
    """Return the lines of a package whose three steps begin and end at these times."""
    begun, ended = moments[0], moments[-1] + 0.5
    found = [event("Started", begun, package, reason="new")]
    for step, (start, end) in zip(("cmake", "build", "install"), pairwise(moments), strict=True):
        found.append(event("StepStarted", start, package, step=step, argv=[], cwd="/"))
        found.append(event("StepFinished", end, package, step=step, code=0))
    found.append(event("Finished", ended, package, code=0, seconds=ended - begun))
    return found


def commands(package: str, *told: tuple[str, str, float, float], chain: tuple[int, ...] = (0,)) -> str:
    return event("Commands", 10.0, package, commands=told, chain=chain)


BUILD = read_build(
    [
        *(planned("a"), planned("b", "a")),
        *steps("a", 0.0, 1.0, 5.0, 5.5),
        *steps("b", 6.0, 6.5, 9.0, 9.25),
        commands(
            "a",
            *(("compile", "x.cpp", 1.0, 4.0), ("compile", "y.cpp", 1.0, 3.0), ("generate", "g", 3.0, 4.0)),
            ("link", "liba.so", 4.0, 4.75),
            chain=(0, 3),
        ),
        *(USAGE, SUMMARY),
    ]
)


def test_commands_that_ran_in_parallel_are_added_up() -> None:
    first, second = BUILD.packages
    expected = {"configure": 1.0, "compile": 5.0, "generate": 1.0, "link": 0.75, "build": 0.25}
    assert {kind: took for kind, took in phases(first).items() if took} == {
        **expected,
        "install": 0.5,
        "waiting": 0.5,
    }
    # Without Ninja, the build step is known as a whole.
    assert phases(second)["build"] == 2.5
    assert phases(second)["compile"] == 0.0


def test_no_schedule_is_faster_than_work_divided_by_jobs_or_the_longest_chain() -> None:
    found = bounds(BUILD)
    assert found is not None
    assert found.work == 9.0 + 3.75
    assert found.chain == 6.0 + 3.75  # of the first package, the commands beside its chain do not count
    assert found.least == found.chain
    assert replace(found, jobs=1).least == found.work
    assert bounds(replace(BUILD, code=1)) is None


@settings(max_examples=50)
@given(st.lists(st.floats(0.1, 5.0), min_size=1, max_size=6), st.integers(1, 4))
def test_the_minimum_time_does_not_exceed_that_of_a_build_without_pauses(
    durations: list[float], jobs: int
) -> None:
    told, now = [], 0.0
    for number, seconds in enumerate(durations):
        name, before = f"p{number}", [f"p{number - 1}"] if number else []
        told += [planned(name, *before), *steps(name, now, now + seconds, now + seconds, now + seconds)]
        now += seconds + 0.5
    use = event("Usage", now, processors=jobs, memory=1, samples=[])
    found = bounds(read_build([*told, use, SUMMARY]))
    assert found is not None
    assert found.least <= now + 1e-6


def test_the_slowest_files_come_first_and_bars_have_one_scale() -> None:
    shown = work(BUILD)
    assert [(row["name"], row["file"], row["took"], row["width"]) for row in shown["files"]] == [
        ("a", "x.cpp", "3.00s", "100.00%"),
        ("a", "y.cpp", "2.00s", "66.67%"),
        ("a", "g", "1.00s", "33.33%"),
        ("a", "liba.so", "0.75s", "25.00%"),
    ]
    assert [(row["name"], row["took"]) for row in shown["packages"]] == [("a", "9.00s"), ("b", "3.75s")]
    (pieces,) = (row["pieces"] for row in shown["packages"] if row["name"] == "b")
    assert sum(float(piece["width"][:-1]) for piece in pieces) == pytest.approx(41.67, abs=0.05)
    assert [*lines(BUILD)] == [
        "slowest: x.cpp of a 3.00s, y.cpp of a 2.00s, g of a 1.00s",
        "with 2 jobs, at best about 9.75s: 12.8s of work, and 9.75s for the longest chain of it",
    ]


def test_header_times_are_excluded_from_the_build_time() -> None:
    times: dict[str, Any] = {"files": 1, "failed": 0, "total": 2.0, "in_headers": 1.0, "in_templates": 0.5}
    headers = event("Headers", 99.0, **times, compiler="c", headers=[["/inc/x.hpp", 1.0, 3]])
    build = read_build([planned("a"), *steps("a", 0.0, 1.0, 2.0, 3.0), headers, SUMMARY])
    assert build.ended == 3.5
    (row,) = work(build)["headers"]["rows"]
    assert (row["path"], row["took"], row["files"]) == ("/inc/x.hpp", "1.00s", 3)


@given(st.lists(st.sampled_from(["Started", "Finished", "Commands", "Headers", "Usage", "Planned", "x"])))
def test_logs_of_other_versions_are_ignored(words: list[str]) -> None:
    with TemporaryDirectory() as folder:
        lines = [json.dumps({"event": word, "time": 0.0, "package": "a"}) for word in words]
        Path(folder, "events.jsonl").write_text("\n".join(lines))
        assert {run.name for run in read_log(Path(folder)).packages} <= {"a"}


def test_builds_are_compared_by_package_and_by_file() -> None:
    def build_of(seconds: float, *names: str) -> Build:
        told = []
        for name in names:
            told += [planned(name), *steps(name, 0.0, 0.5, 0.5 + seconds, 0.5 + seconds)]
            told.append(commands(name, ("compile", "x.cpp", 0.5, 0.5 + seconds)))
        return read_build([*told, event("Summary", 9.0, code=0, seconds=seconds, log=None)])

    shown = comparison(build_of(3.0, "a", "new"), build_of(1.0, "a", "gone"), "build_1")
    assert shown["sentence"] == "This build took 3.00s, 2.00s more than that one (1.00s)."
    assert [(row["name"], row["then"], row["now"], row["change"]) for row in shown["packages"]] == [
        ("a", "2.00s", "4.00s", "+2.00s"),
        ("new", "", "4.00s", "only now"),
        ("gone", "2.00s", "", "only then"),
    ]
    first = shown["files"][0]
    assert (first["name"], first["file"], first["change"]) == ("a", "x.cpp", "+2.00s")
    assert json.dumps(shown)
