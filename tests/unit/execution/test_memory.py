"""Packages that do not fit into memory, and the words of compilers that were killed."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.build.events import Finished, Started
from forge.execution.loop import Scheduler
from forge.execution.memory import killed_program
from tests.strategies import graphs
from tests.unit.execution.test_scheduler import plan_of


@pytest.mark.parametrize(
    ("output", "program"),
    [
        ("c++: fatal error: Killed signal terminated program cc1plus\ncompilation terminated.\n", "cc1plus"),
        ("collect2: fatal error: ld terminated with signal 9 [Killed]\n", "ld"),
        ("clang++: error: unable to execute command: Killed\n", "clang++"),
        ("/usr/lib/cc1plus: out of memory allocating 65536 bytes after a total of 9 bytes\n", "cc1plus"),
        ("virtual memory exhausted: Cannot allocate memory\n", "a program"),
        ("[3/4] Generating x\nKilled\n", "a program"),
        ("/bin/sh: line 1: 4711 Killed                  python3 gen.py\n", "a program"),
        ("a.cpp:3: error: 'Killed' was not declared\n", None),
        ("Killed 3 birds\n", None),
        (
            "error: could not compile `x`\n  process didn't exit successfully (signal: 9, SIGKILL: kill)\n",
            "a program",
        ),
        ("Killed 3 birds\nKilled", "a program"),
        ("", None),
    ],
)
def test_killed_programs_are_recognized(output: str, program: str | None) -> None:
    assert killed_program(output.encode()) == program


@pytest.mark.parametrize(
    "text", [b"x", b"Killed ", b"a signal 9 ", b"(signal: 9", b"\n", b"line 1: 1 Killed"]
)
def test_endless_output_is_read_in_linear_time(text: bytes) -> None:
    """Quadratic time would be minutes."""
    killed_program(text * (1 << 20))


@given(graphs(), st.dictionaries(st.sampled_from("abcdefgh"), st.integers(1, 10)))
def test_tasks_start_alongside_others_only_if_they_fit(
    graph: dict[str, frozenset[str]], sizes: dict[str, int]
) -> None:
    """All of them end, also those that never fit: they run alone."""
    plan = plan_of(graph)

    def fits(name: str, running: frozenset[str]) -> bool:
        return sum(sizes.get(other, 1) for other in (name, *running)) <= 8

    scheduler = Scheduler(plan, 0, fits=fits)
    done = []
    while True:
        for event in scheduler.advance():
            assert isinstance(event, Started)
        if not scheduler.running:
            break
        assert len(scheduler.running) == 1 or sum(sizes.get(name, 1) for name in scheduler.running) <= 8
        name = min(scheduler.running)
        scheduler.note(Finished(name, 0, 0.0))
        done.append(name)
    assert sorted(done) == sorted(plan.tasks)
    assert scheduler.held == ()
