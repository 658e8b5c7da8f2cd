"""Writing of generated files: obsolete files are removed, and others are kept."""

from pathlib import Path

import pytest

from forge.base.errors import HostError
from forge.interfaces.model import File
from forge.interfaces.writing import Part, write, write_depfile


def part(language: str, digest: str | None = None, **texts: str) -> Part:
    """Return a part of these files: a='text' is LANGUAGE/a.txt."""
    files = [File(f"{name}.txt", text) for name, text in texts.items()]
    return Part(language, " ".join(texts), digest, lambda: files)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_other_files_are_never_removed(tmp_path: Path) -> None:
    write([part("x", a="a")], tmp_path, "p")
    (tmp_path / "x/mine.txt").write_text("mine")
    write([part("x", b="b")], tmp_path, "p")
    assert names(tmp_path / "x") == ["b.txt", "mine.txt"]


def test_unwritable_folders_are_host_errors(tmp_path: Path) -> None:
    (tmp_path / "x").write_text("a file")
    with pytest.raises(HostError, match="cannot write"):
        write([part("x", a="a")], tmp_path, "p")


def test_depfiles_are_make_rules(tmp_path: Path) -> None:
    depfile = tmp_path / "p.d"
    write_depfile(depfile, tmp_path / "stamp", [tmp_path / "a b.msg", tmp_path / "$c#.msg"])
    text = depfile.read_text().replace(str(tmp_path), "T")
    assert text == "T/stamp: T/a\\ b.msg \\\n  T/$$c\\#.msg\n"
    write_depfile(depfile, tmp_path / "stamp", [])
    assert depfile.read_text() == f"{tmp_path / 'stamp'}:\n"
