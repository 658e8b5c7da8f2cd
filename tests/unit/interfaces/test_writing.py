"""Writing: unchanged files are not touched, and stale files are removed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from forge.base.errors import HostError
from forge.interfaces.model import File, TypeName
from forge.interfaces.output_state import OutputState, read_states
from forge.interfaces.rendering import Part
from forge.interfaces.writing import write, write_depfile, write_stamp

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


def part(language: str, digest: str | None = None, **texts: str) -> Part:
    """Return a part of these files: a='text' is LANGUAGE/a.txt."""
    files = [File(f"{name}.txt", text) for name, text in texts.items()]
    return Part(language, " ".join(texts), digest, lambda: files)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_only_what_changed_is_written(tmp_path: Path) -> None:
    assert write([part("x", a="a", b="b")], tmp_path, "p").changed == (
        tmp_path / "x/a.txt",
        tmp_path / "x/b.txt",
    )
    before = (tmp_path / "x/b.txt").stat().st_mtime_ns
    again = write([part("x", a="new", b="b")], tmp_path, "p")
    assert (again.changed, again.total) == ((tmp_path / "x/a.txt",), 2)
    assert (tmp_path / "x/b.txt").stat().st_mtime_ns == before


def test_a_part_made_from_the_same_is_not_rendered_again(tmp_path: Path) -> None:
    rendered = []

    def make() -> Iterator[File]:
        rendered.append(1)
        yield File("a.txt", "a")

    def run(digest: str | None) -> int:
        rendered.clear()
        write([Part("x", "a", digest, make)], tmp_path, "p")
        assert (tmp_path / "x/a.txt").read_text() == "a"
        return len(rendered)

    assert [run("1"), run("1"), run("2"), run("2"), run(None), run(None)] == [1, 0, 1, 0, 1, 1]
    run("3")
    (tmp_path / "x/a.txt").unlink()
    assert run("3") == 1, "what was deleted is made again"
    (tmp_path / "x/a.txt").write_text("b")
    assert run("3") == 1, "what was edited as well"
    (tmp_path / ".forge/p.json").unlink()
    assert run("3") == 1


def test_what_is_no_longer_made_is_removed_unless_another_package_makes_it(tmp_path: Path) -> None:
    write([part("x", a="a", b="b")], tmp_path, "p")
    write([part("x", b="b")], tmp_path, "q")
    write([part("x", c="c")], tmp_path, "p")
    assert names(tmp_path / "x") == ["b.txt", "c.txt"]


def test_a_language_that_is_not_of_the_run_is_left_alone(tmp_path: Path) -> None:
    write([part("x", a="a")], tmp_path, "p")
    write([part("y", c="c")], tmp_path, "p")
    assert (tmp_path / "x/a.txt").exists()
    write([part("x", b="b")], tmp_path, "p")
    assert not (tmp_path / "x/a.txt").exists()
    assert (tmp_path / "y/c.txt").exists()


def test_a_file_of_the_users_is_never_removed(tmp_path: Path) -> None:
    write([part("x", a="a")], tmp_path, "p")
    (tmp_path / "x/mine.txt").write_text("mine")
    write([part("x", b="b")], tmp_path, "p")
    assert names(tmp_path / "x") == ["b.txt", "mine.txt"]


def test_a_record_says_what_was_made_and_needed(tmp_path: Path) -> None:
    header = TypeName("std_msgs", "msg", "Header")
    folders = {"std_msgs": tmp_path / "std_msgs"}
    write([part("x", "1", a="a")], tmp_path, "p", OutputState(needs=(header,), folders=folders))
    record = read_states(tmp_path)["p"]
    assert (list(record.files), record.needs, record.folders) == (["x/a.txt"], (header,), folders)
    assert record.parts["x a"].digest == "1"


@pytest.mark.parametrize(
    "text", ["", "[]", '{"version": 99}', '{"version": 3}', '{"version": 3, "parts": {"a": 3}}']
)
def test_a_broken_record_counts_as_none(tmp_path: Path, text: str) -> None:
    write([part("x", a="a")], tmp_path, "p")
    (tmp_path / ".forge/p.json").write_text(text)
    assert read_states(tmp_path) == {"p": OutputState()}


def test_a_folder_that_cannot_be_written_is_the_machines_fault(tmp_path: Path) -> None:
    (tmp_path / "x").write_text("a file")
    with pytest.raises(HostError, match="cannot write"):
        write([part("x", a="a")], tmp_path, "p")


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
