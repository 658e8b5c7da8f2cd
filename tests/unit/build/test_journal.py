"""The journal of builds."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.base.layout import JOURNAL_FILE
from forge.build.events import Aborted, Finished, Output, Started
from forge.build.journal import Journal, open_journal
from forge.build.model import BuildInputs, BuildRecord, Fingerprint
from forge.build.tasks import BuildPlan, Task
from tests.packages import package

if TYPE_CHECKING:
    from pathlib import Path

TEXTS = st.text(max_size=8)
PAIRS = st.lists(st.tuples(TEXTS, TEXTS), max_size=3).map(tuple)
MARKS = st.builds(Fingerprint, TEXTS, TEXTS, TEXTS)
RECORDS = st.builds(
    BuildRecord,
    inputs=st.builds(BuildInputs, TEXTS, st.lists(TEXTS, max_size=3).map(tuple), PAIRS, PAIRS, TEXTS, PAIRS),
    complete=st.booleans(),
    sources=MARKS,
    installed=MARKS,
    files=st.lists(TEXTS, max_size=3).map(tuple),
    externals=st.lists(TEXTS, max_size=3).map(tuple),
    external=TEXTS,
    seconds=st.floats(0, 100),
    began=st.floats(0, 100),
)
ONE = BuildRecord(BuildInputs(sources="1"), complete=True, externals=("/usr/include/x.h",))


def plan_of(build: Path, *names: str) -> BuildPlan:
    """Return a plan of tasks without steps."""
    for name in names:
        (build / name).mkdir(exist_ok=True)
    return BuildPlan({n: Task(n, package(n), build, build / n, (), (), "") for n in names})


def build(journal: Journal, plan: BuildPlan, name: str, code: int = 0) -> None:
    """Note a build of one package."""
    record = ONE if code == 0 else None
    started = Started(name, ONE.inputs)
    for event in (started, Output(name, b"", stderr=False), Finished(name, code, 1.0, record=record)):
        journal.record(event, plan)


def test_how_each_package_ended_is_remembered(tmp_path: Path) -> None:
    journal = open_journal(tmp_path)
    plan = plan_of(tmp_path, "a", "b", "c")
    build(journal, plan, "a")
    build(journal, plan, "b", code=1)
    journal.record(Started("c"), plan)
    journal.record(Aborted("c", 0.1), plan)
    journal.close()
    again = open_journal(tmp_path)
    assert again.records == journal.records
    assert {name: record.complete for name, record in again.records.items()} == {
        "a": True,
        "b": False,
        "c": False,
    }
    assert again.externals == ["/usr/include/x.h"]
    assert (tmp_path / "a" / "colcon_build.rc").read_text() == "0\n"
    assert (tmp_path / "b" / "colcon_build.rc").read_text() == "1\n"
    assert (tmp_path / "c" / "colcon_build.rc").read_text() == "SIGINT\n"


def test_a_build_that_began_and_did_not_end_is_incomplete(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, "a")
    journal = open_journal(tmp_path)
    build(journal, plan, "a")
    journal.record(Started("a"), plan)
    # As if the power had failed before close().
    assert not open_journal(tmp_path).records["a"].complete
    journal.close()


@given(st.dictionaries(TEXTS, RECORDS, max_size=4))
def test_what_is_remembered_is_read_again(
    tmp_path_factory: pytest.TempPathFactory, records: dict[str, BuildRecord]
) -> None:
    folder = tmp_path_factory.mktemp("journal")
    journal = open_journal(folder)
    for name, record in records.items():
        journal.set_record(name, replace(record, complete=False))
        journal.set_record(name, record)
    journal.close()
    assert open_journal(folder).records == records


@pytest.mark.parametrize(
    "line", ["[]", "3", '{"package": "b"', '{"package": "b", "inputs": 3}', '{"externals": 3}']
)
def test_torn_and_foreign_lines_count_as_nothing(tmp_path: Path, line: str) -> None:
    journal = open_journal(tmp_path)
    journal.set_record("a", ONE)
    journal.close()
    path = tmp_path / JOURNAL_FILE
    path.write_bytes(path.read_bytes() + b"\xff\n" + line.encode())
    again = open_journal(tmp_path)
    assert again.records == {"a": ONE}
    again.set_record("b", ONE)
    again.close()
    assert open_journal(tmp_path).records == {"a": ONE, "b": ONE}


def test_another_version_counts_as_nothing_and_is_replaced(tmp_path: Path) -> None:
    (tmp_path / JOURNAL_FILE).write_text('{"forge_journal": 999}\n{"package": "a"}\n')
    journal = open_journal(tmp_path)
    assert journal.records == {}
    journal.set_record("b", ONE)
    journal.close()
    assert open_journal(tmp_path).records == {"b": ONE}


def test_a_long_journal_is_written_short(tmp_path: Path) -> None:
    journal = open_journal(tmp_path)
    for number in range(120):
        journal.set_record("a", replace(ONE, externals=(f"/usr/include/{number}.h",)))
    journal.set_stamp("stamp")
    last = journal.records["a"]
    journal.close()
    assert len((tmp_path / JOURNAL_FILE).read_text().splitlines()) == 3
    again = open_journal(tmp_path)
    assert again.records == {"a": last}
    assert again.externals == ["/usr/include/119.h"]
    assert again.stamp == ""


def test_the_stamp_of_all_externals_is_kept(tmp_path: Path) -> None:
    journal = open_journal(tmp_path)
    journal.set_stamp("stamp")
    journal.set_stamp("stamp")
    journal.close()
    assert open_journal(tmp_path).stamp == "stamp"
    assert len((tmp_path / JOURNAL_FILE).read_text().splitlines()) == 2
