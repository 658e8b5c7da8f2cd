"""What was built from what."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.journal import FILE, Journal, open_journal
from forge.model import Aborted, BuildPlan, Finished, Output, Started, Task
from tests.packages import package

if TYPE_CHECKING:
    from pathlib import Path


def plan_of(build: Path, **digests: str) -> BuildPlan:
    """Return a plan with a task of each digest."""
    for name in digests:
        (build / name).mkdir(exist_ok=True)
    return BuildPlan(
        {n: Task(n, package(n), build, build / n, (), (), digest, "") for n, digest in digests.items()}
    )


def build(journal: Journal, plan: BuildPlan, name: str, code: int = 0) -> None:
    """Note a build of one package."""
    for event in (Started(name), Output(name, b"", stderr=False), Finished(name, code, 1.0)):
        journal.record(event, plan)


def test_what_was_built_is_remembered(tmp_path: Path) -> None:
    journal = open_journal(tmp_path)
    plan = plan_of(tmp_path, a="1", b="2", c="3")
    build(journal, plan, "a")
    build(journal, plan, "b", code=1)
    journal.record(Started("c"), plan)
    journal.record(Aborted("c", 0.1), plan)
    journal.close()
    assert open_journal(tmp_path).digests == {"a": "1"}
    assert (tmp_path / "a" / "colcon_build.rc").read_text() == "0\n"
    assert (tmp_path / "b" / "colcon_build.rc").read_text() == "1\n"
    assert (tmp_path / "c" / "colcon_build.rc").read_text() == "SIGINT\n"


def test_a_build_that_began_and_did_not_end_is_forgotten(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, a="1")
    journal = open_journal(tmp_path)
    build(journal, plan, "a")
    journal.record(Started("a"), plan)
    assert open_journal(tmp_path).digests == {}  # as if the power had failed before close()
    journal.close()


def test_torn_and_foreign_lines_count_as_nothing(tmp_path: Path) -> None:
    journal = open_journal(tmp_path)
    build(journal, plan_of(tmp_path, a="1", b="2"), "a")
    journal.close()
    path = tmp_path / FILE
    path.write_bytes(path.read_bytes() + b'\xff\n[]\n{"package": 1}\n{"package": "b", "dig')
    assert open_journal(tmp_path).digests == {"a": "1"}


def test_another_version_counts_as_nothing_and_is_replaced(tmp_path: Path) -> None:
    (tmp_path / FILE).write_text('{"forge_journal": 999}\n{"package": "a", "digest": "1"}\n')
    journal = open_journal(tmp_path)
    assert journal.digests == {}
    build(journal, plan_of(tmp_path, b="2"), "b")
    journal.close()
    assert open_journal(tmp_path).digests == {"b": "2"}


def test_a_long_journal_is_written_short(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, a="1")
    journal = open_journal(tmp_path)
    for _ in range(60):
        build(journal, plan, "a")
    journal.close()
    assert len((tmp_path / FILE).read_text().splitlines()) == 2
    assert open_journal(tmp_path).digests == {"a": "1"}
