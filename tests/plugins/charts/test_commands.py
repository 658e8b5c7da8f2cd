"""From ninja's log to the commands of a step and their longest chain."""

import shutil
import subprocess
import time
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from forge.build.events import StepFinished, StepStarted
from forge.build.inputs.native_graph import Edge, NativeGraph
from forge.build.tasks import BuildPlan, Step, StepKind, Task
from forge.plugins.charts.commands import Command, NinjaLogs, commands_of, longest_chain
from tests.packages import package

BUILD, SOURCE = Path("/ws/build/a"), Path("/ws/src/a")
GRAPH = NativeGraph(
    (
        Edge("CUSTOM_COMMAND", ("/ws/build/a/gen.cpp", "/ws/build/a/gen.hpp"), ("/ws/src/a/gen.py",)),
        Edge("CXX_COMPILER__a_", ("/ws/build/a/gen.cpp.o",), ("/ws/build/a/gen.cpp",)),
        Edge("CXX_COMPILER__a_", ("/ws/build/a/src/x.cpp.o",), ("/ws/src/a/src/x.cpp",)),
        Edge(
            "CXX_SHARED_LIBRARY_LINKER__a_",
            ("/ws/build/a/liba.so",),
            ("/ws/build/a/gen.cpp.o", "/ws/build/a/objects"),
        ),
    ),
    aliases={"/ws/build/a/objects": ("/ws/build/a/src/x.cpp.o",)},
)
LOG = [
    "0\t300\t1\tgen.cpp\taa",
    "0\t300\t1\tgen.hpp\taa",
    "300\t500\t1\tgen.cpp.o\tbb",
    "0\t900\t1\tsrc/x.cpp.o\tcc",
    "900\t1000\t1\tliba.so\tdd",
    "0\t50\t1\tbuild.ninja\tee",
]


def test_commands_are_named_after_their_source_and_counted_once() -> None:
    found = [*commands_of(LOG, GRAPH, BUILD, SOURCE, 10.0)]
    assert [(each.kind, each.name, each.begun, each.ended) for each in found] == [
        ("configure", "build.ninja", 10.0, 10.05),
        ("generate", "gen.cpp", 10.0, 10.3),
        ("compile", "src/x.cpp", 10.0, 10.9),
        ("compile", "gen.cpp", 10.3, 10.5),
        ("link", "liba.so", 10.9, 11.0),
    ]


def test_the_longest_chain_follows_files_and_targets_without_a_command() -> None:
    found = [*commands_of(LOG, GRAPH, BUILD, SOURCE, 0.0)]
    assert [found[number].name for number in longest_chain(found, GRAPH)] == ["src/x.cpp", "liba.so"]
    assert longest_chain([Command("compile", "x", 0.0, 1.0, "/elsewhere.o")], GRAPH) == (0,)


@pytest.mark.needs("ninja")
def test_only_commands_of_this_run_are_read(tmp_path: Path) -> None:
    """ninja keeps the entries of earlier runs in its log, and may write them in another order."""
    ninja = shutil.which("ninja")
    assert ninja
    rule = "rule copy\n  command = cp $in $out\n"
    rule += "build one: copy in\nbuild two: copy one\n"
    (tmp_path / "build.ninja").write_text(rule)
    (tmp_path / "in").write_text("1")
    subprocess.run([ninja, "one"], cwd=tmp_path, check=True, stdout=subprocess.DEVNULL)
    step = Step(StepKind.BUILD, (ninja,), tmp_path)
    task = Task("a", package("a"), tmp_path, tmp_path, (), (step,), "new")
    logs = NinjaLogs(BuildPlan({"a": task}), tmp_path, time.monotonic())
    logs.show(StepStarted("a", step))
    subprocess.run(step.argv, cwd=tmp_path, check=True, stdout=subprocess.DEVNULL)
    logs.show(StepFinished("a", step, 0))
    logs.show(StepFinished("a", step, 0))
    assert [[command.name for command in run.commands] for run in logs.runs] == [["two"]]


@given(st.lists(st.one_of(st.text("0123456789\t-ab/.", max_size=40), st.text(max_size=20))))
@example(["0\t1\t2\tx\ty", "1\t0\t2\tx\tz", "a\tb\tc\td\te", "9" * 99 + "\t1\t1\tx\ty"])
def test_any_line_of_a_log_is_a_command_or_ignored(lines: list[str]) -> None:
    found = [*commands_of(lines, GRAPH, BUILD, SOURCE, 0.0)]
    assert len(found) <= len(lines)
    assert {*longest_chain(found, GRAPH)} <= {*range(len(found))}


@pytest.mark.parametrize("text", ["", "# ninja log v4\n0\t1\t2\tx\ty\n", "# ninja log v7\nodd\n0\t1\n", "\0"])
def test_unknown_logs_have_no_commands(text: str, tmp_path: Path) -> None:
    (tmp_path / ".ninja_log").write_text("# ninja log v7\n")
    step = Step(StepKind.BUILD, (), tmp_path)
    task = Task("a", package("a"), tmp_path, tmp_path, (), (step,), "new")
    logs = NinjaLogs(BuildPlan({"a": task}), tmp_path, time.monotonic())
    logs.show(StepStarted("a", step))
    (tmp_path / ".ninja_log").write_text(text)
    logs.show(StepFinished("a", step, 0))
    assert logs.runs == []
