"""Writing: the same bytes are not written twice, and nothing stays that nobody makes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from forge.errors import EnvironmentFault
from forge.interfaces.model import File, TypeName
from forge.interfaces.writing import Record, read_records, write, write_depfile, write_stamp

if TYPE_CHECKING:
    from pathlib import Path

A, B = File("x/a.txt", "a"), File("x/b.txt", "b")


def test_only_what_changed_is_written(tmp_path: Path) -> None:
    assert write([A, B], tmp_path, "p") == (tmp_path / "x/a.txt", tmp_path / "x/b.txt")
    before = (tmp_path / "x/b.txt").stat().st_mtime_ns
    assert write([File("x/a.txt", "new"), B], tmp_path, "p") == (tmp_path / "x/a.txt",)
    assert (tmp_path / "x/b.txt").stat().st_mtime_ns == before


def test_what_is_no_longer_made_is_removed_unless_another_package_makes_it(tmp_path: Path) -> None:
    write([A, B], tmp_path, "p")
    write([B], tmp_path, "q")
    write([File("x/c.txt", "c")], tmp_path, "p")
    assert sorted(path.name for path in (tmp_path / "x").iterdir()) == ["b.txt", "c.txt"]


def test_a_language_that_is_not_of_the_run_is_left_alone(tmp_path: Path) -> None:
    write([A], tmp_path, "p")
    write([File("y/c.txt", "c")], tmp_path, "p")
    assert (tmp_path / "x/a.txt").exists()
    write([B], tmp_path, "p")
    assert not (tmp_path / "x/a.txt").exists()
    assert (tmp_path / "y/c.txt").exists()


def test_a_file_of_the_users_is_never_removed(tmp_path: Path) -> None:
    write([A], tmp_path, "p")
    (tmp_path / "x/mine.txt").write_text("mine")
    write([B], tmp_path, "p")
    assert sorted(path.name for path in (tmp_path / "x").iterdir()) == ["b.txt", "mine.txt"]


def test_a_record_says_what_was_made_and_needed(tmp_path: Path) -> None:
    header = TypeName("std_msgs", "msg", "Header")
    write([A], tmp_path, "p", [header])
    assert read_records(tmp_path) == {"p": Record(("x/a.txt",), (header,))}


@pytest.mark.parametrize(
    "text", ["", "[]", '{"version": 99}', '{"version": 1}', '{"version": 1, "files": 3}']
)
def test_a_broken_record_counts_as_none(tmp_path: Path, text: str) -> None:
    write([A], tmp_path, "p")
    (tmp_path / ".forge/p.json").write_text(text)
    assert read_records(tmp_path) == {"p": Record()}


def test_a_folder_that_cannot_be_written_is_the_machines_fault(tmp_path: Path) -> None:
    (tmp_path / "x").write_text("a file")
    with pytest.raises(EnvironmentFault, match="cannot write"):
        write([A], tmp_path, "p")


def test_a_depfile_is_a_rule_for_make(tmp_path: Path) -> None:
    depfile = tmp_path / "p.d"
    write_depfile(depfile, tmp_path / "stamp", [tmp_path / "a b.msg", tmp_path / "$c#.msg"])
    text = depfile.read_text().replace(str(tmp_path), "T")
    assert text == "T/stamp: T/a\\ b.msg \\\n  T/$$c\\#.msg\n"
    write_depfile(depfile, tmp_path / "stamp", [])
    assert depfile.read_text() == f"{tmp_path / 'stamp'}:\n"


def test_a_stamp_grows_young(tmp_path: Path) -> None:
    stamp = tmp_path / "deep/stamp"
    write_stamp(stamp)
    first = stamp.stat().st_mtime_ns
    write_stamp(stamp)
    assert stamp.stat().st_mtime_ns >= first
