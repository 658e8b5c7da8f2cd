"""Stamps and digests of files."""

from __future__ import annotations

import os
import time
from typing import TYPE_CHECKING

import pytest

from forge.build.inputs.fingerprints import FileTable, fingerprint_files, fingerprint_tree, source_files
from forge.build.model import Fingerprint

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from tests.conftest import Tree


def settle(root: Path) -> None:
    """Wait until what was just written is old enough for its stat to be trusted."""
    del root
    time.sleep(0.03)


@pytest.fixture
def package(tree: Tree) -> Path:
    """Return a folder of sources with litter in it."""
    root = tree(
        {
            "a/src/x.cpp": "int x;",
            "a/package.xml": "<package/>",
            "a/.git/HEAD": "x",
            "a/__pycache__/x.pyc": "x",
            "a/a.egg-info/PKG-INFO": "x",
            "a/src/x.cpp~": "x",
            "a/src/.x.cpp.swp": "x",
        }
    )
    settle(root)
    return root / "a"


def test_litter_is_no_source(package: Path) -> None:
    assert [path[len(str(package)) + 1 :] for path in source_files(str(package))] == [
        "package.xml",
        "src/x.cpp",
    ]


BESIDE_PROJECT_FILES = (
    *(
        ".vscode/settings.json",
        ".idea/x",
        ".cache/clangd/index/x.idx",
        ".clangd",
        ".coverage",
        ".coverage.host.1.x",
    ),
    *(".venv/x", "node_modules/x", "site-packages/x", "compile_commands.json", "a.egg-info/PKG-INFO"),
)
"""What is litter beside a package's main files, and may be data elsewhere."""

BESIDE_THE_ORIGINAL = (
    *("x.cpp~", "x.cpp.~1~", ".x.cpp.swp", ".x.cpp.swo", "#x.cpp#", ".#x.cpp", ".x.cpp.kate-swp"),
    *(".x.cpp.un~", "x.cpp.orig", "x.cpp.rej", "m.pyc", "d.egg-info"),
)
"""What is litter beside the file that it was made for, and may be data where that is not."""

ANYWHERE = (
    *(".tox/x", ".eggs/x", ".hypothesis/x", ".direnv/x", ".ipynb_checkpoints/x", ".ccls-cache/x", ".git/x"),
    *("__pycache__/x.pyc", ".nfs000000000012ab3400000001", ".fuse_hidden0001a", "4913", ".DS_Store"),
    *(
        "any/pyvenv.cfg",
        "any/lib/x.py",
        "conda/conda-meta/history",
        "conda/x.py",
        "cmake-build-debug/CMakeCache.txt",
        "cmake-build-debug/x.o",
    ),
)

DATA = (
    *("#map.txt", ".#l", "conf~", "x.swp", ".x.swp", "k.pyc", "pkg.egg-info/PKG-INFO", "x.orig", ".vscode/x"),
    *(".idea/x", ".coverage", "compile_commands.json", "node_modules/x", ".cache/x", ".clangd", ".nfsshare"),
    *("tags", ".clang-format", "cmake-build-docs/x", "x.bak", ".venv/x", "sdk/lib/python3/site-packages/x"),
)
"""What a folder of data may hold, and a package install with it."""


def lying(root: Path, files: Iterable[str]) -> set[str]:
    """Write the files, all with the same text, and return which of them count as sources."""
    for name in files:
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("x")
    return {path[len(str(root)) + 1 :] for path in source_files(str(root))} & set(files)


def test_what_tools_leave_is_no_source(tmp_path: Path) -> None:
    lying(tmp_path, ("package.xml", "x.cpp", "m.py", "d/x"))
    assert lying(tmp_path, BESIDE_PROJECT_FILES) == set()
    assert lying(tmp_path, BESIDE_THE_ORIGINAL) == set()
    assert lying(tmp_path, ANYWHERE) == set()
    assert lying(tmp_path, [f"deep/below/{name}" for name in ANYWHERE]) == set()
    assert lying(tmp_path, [f"part/{name}" for name in ("x.cpp", *BESIDE_THE_ORIGINAL[:10])]) == {
        "part/x.cpp"
    }


def test_what_only_looks_like_litter_counts(tmp_path: Path) -> None:
    lying(tmp_path, ("package.xml", "CMakeLists.txt"))
    data = [f"data/{name}" for name in (*DATA, *BESIDE_THE_ORIGINAL, *BESIDE_PROJECT_FILES)]
    assert lying(tmp_path, data) == set(data)


def test_a_package_in_an_environment_of_python_keeps_its_sources(tmp_path: Path) -> None:
    files = {"package.xml", "CMakeCache.txt", "pyvenv.cfg", "x.cpp"}
    assert lying(tmp_path, files) == files


def mark(package: Path, known: Fingerprint | None = None) -> Fingerprint:
    """Mark with a table that knows nothing."""
    return fingerprint_tree(str(package), FileTable(package.parent / "table"), known)


@pytest.mark.parametrize(
    "edit",
    [
        lambda p: (p / "src/x.cpp").write_text("int y;"),
        lambda p: (p / "src/new.cpp").write_text(""),
        lambda p: (p / "src/x.cpp").unlink(),
        lambda p: (p / "src/x.cpp").rename(p / "src/z.cpp"),
        lambda p: (p / "src/x.cpp").chmod(0o755),
        lambda p: ((p / "src/x.cpp").unlink(), (p / "src/x.cpp").symlink_to("../package.xml")),
    ],
)
def test_every_edit_shows(package: Path, edit: object) -> None:
    before = mark(package)
    edit(package)  # type: ignore[operator]
    assert mark(package, before).digest != before.digest


def test_a_touch_changes_the_stamp_but_not_the_digest(package: Path) -> None:
    before = mark(package)
    os.utime(package / "src/x.cpp", (1, 1))
    settle(package)
    after = mark(package, before)
    assert after.stamp != before.stamp
    assert after.digest == before.digest


def test_an_older_file_with_other_words_shows(package: Path) -> None:
    before = mark(package)
    (package / "src/x.cpp").write_text("int z;")
    os.utime(package / "src/x.cpp", (1, 1))
    assert mark(package, before).digest != before.digest


def test_equal_stamps_read_nothing(package: Path) -> None:
    before = mark(package)
    assert mark(package, Fingerprint(before.stamp, "as remembered")).digest == "as remembered"


def test_a_file_that_just_changed_is_not_trusted(package: Path) -> None:
    (package / "src/x.cpp").write_text("int q;")
    assert mark(package).stamp == ""


def test_what_a_link_points_at_counts(package: Path) -> None:
    target = package.parent / "target"
    target.write_text("one")
    (package / "link").symlink_to(target)
    (package / "broken").symlink_to("nowhere")
    before = mark(package)
    target.write_text("two")
    assert mark(package).digest != before.digest


def test_files_anywhere_are_marked_and_a_missing_one_shows(tree: Tree) -> None:
    root = tree({"one": "1", "two": "2"})
    paths = [str(root / "one"), str(root / "two")]
    table = FileTable(root / "table")
    before = fingerprint_files(paths, table)
    assert fingerprint_files(paths, table, before) is before
    (root / "two").unlink()
    assert fingerprint_files(paths, table, before).digest != before.digest


def test_the_stat_table_avoids_reading_and_may_be_lost(package: Path) -> None:
    path = package.parent / "table"
    table = FileTable(path)
    before = fingerprint_tree(str(package), table)
    table.save()
    assert fingerprint_tree(str(package), FileTable(path)).digest == before.digest
    for broken in (
        "",
        "[]",
        '{"version": 1}',
        '{"version": 1, "files": {"x": 3}}',
        '{"version": 2, "files": {}}',
    ):
        path.write_text(broken)
        assert fingerprint_tree(str(package), FileTable(path)).digest == before.digest


def test_what_forge_has_just_written_is_known_but_not_for_long(tmp_path: Path) -> None:
    """Somebody may write there within the same tick of the clock: the next process looks again."""
    file, path = tmp_path / "file", str(tmp_path / "file")
    file.write_text("one")
    table = FileTable(tmp_path / "table")
    table.learn(path, file.lstat(), "as written")
    assert table.digest(path, file.lstat()) == "as written"
    table.save()
    read = FileTable(tmp_path / "table").digest(path, file.lstat())
    assert read == FileTable(tmp_path / "none").digest(path, file.lstat()) != "as written"
    settle(tmp_path)
    file.write_text("other")
    assert table.digest(path, file.lstat()) != "as written"


def test_a_table_of_many_builds_forgets_what_is_not_asked_for(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / name).write_text(name)
    settle(tmp_path)
    table = FileTable(tmp_path / "table")
    fingerprint_files([str(tmp_path / "one"), str(tmp_path / "two")], table)
    table.forget_others({str(tmp_path / "one")})
    table.save()
    said = (tmp_path / "table").read_text()
    assert str(tmp_path / "one") in said
    assert str(tmp_path / "two") not in said


def test_an_unreadable_file_is_something_too(package: Path) -> None:
    fifo = package / "fifo"
    (package / "folder-link").symlink_to(package / "src")
    before = mark(package)
    os.mkfifo(fifo)
    assert mark(package).digest != before.digest


def test_what_a_link_points_at_counts_though_the_link_stays(package: Path) -> None:
    target = package.parent / "target"
    target.write_text("one")
    (package / "link").symlink_to(target)
    settle(package)
    before = mark(package)
    target.write_text("two")
    settle(package)
    assert mark(package, before).digest != before.digest


def test_a_linked_folder_is_entered_once(package: Path) -> None:
    away = package.parent / "away"
    away.mkdir()
    (away / "y.hpp").write_text("1")
    (package / "src/away").symlink_to(away)
    (package / "src/round").symlink_to(package)
    (away / "back").symlink_to(package / "src")
    assert [path[len(str(package)) + 1 :] for path in source_files(str(package))] == [
        "package.xml",
        "src/away",
        "src/away/back",
        "src/away/back/away",
        "src/away/back/round",
        "src/away/back/x.cpp",
        "src/away/y.hpp",
        "src/round",
        "src/x.cpp",
    ]
    settle(package)
    before = mark(package)
    (away / "y.hpp").write_text("2")
    assert mark(package, before).digest != before.digest


def test_results_within_a_lone_package_are_no_sources(package: Path) -> None:
    for folder, marker in (
        ("build", ".built_by"),
        ("install", ".colcon_install_layout"),
        ("log", "latest_build"),
    ):
        (package / folder).mkdir()
        for name in (marker, "COLCON_IGNORE", "result"):
            (package / folder / name).touch()
    assert [path for path in source_files(str(package)) if path.endswith("/result")] == []
