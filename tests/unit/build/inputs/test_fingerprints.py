"""Stamps and digests of files."""

import time
from collections.abc import Iterable
from pathlib import Path

import pytest

from forge.build.inputs.fingerprints import (
    FileTable,
    fingerprint_again,
    fingerprint_files,
    fingerprint_tree,
    source_files,
)
from forge.build.model import Fingerprint
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


def test_temporary_files_are_not_sources(package: Path) -> None:
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


def test_files_left_by_tools_are_not_sources(tmp_path: Path) -> None:
    lying(tmp_path, ("package.xml", "x.cpp", "m.py", "d/x"))
    assert lying(tmp_path, BESIDE_PROJECT_FILES) == set()
    assert lying(tmp_path, BESIDE_THE_ORIGINAL) == set()
    assert lying(tmp_path, ANYWHERE) == set()
    assert lying(tmp_path, [f"deep/below/{name}" for name in ANYWHERE]) == set()
    assert lying(tmp_path, [f"part/{name}" for name in ("x.cpp", *BESIDE_THE_ORIGINAL[:10])]) == {
        "part/x.cpp"
    }


def test_files_that_resemble_temporary_files_are_sources(tmp_path: Path) -> None:
    lying(tmp_path, ("package.xml", "CMakeLists.txt"))
    data = [f"data/{name}" for name in (*DATA, *BESIDE_THE_ORIGINAL, *BESIDE_PROJECT_FILES)]
    assert lying(tmp_path, data) == set(data)


def test_a_package_inside_a_virtual_environment_keeps_its_sources(tmp_path: Path) -> None:
    files = {"package.xml", "CMakeCache.txt", "pyvenv.cfg", "x.cpp"}
    assert lying(tmp_path, files) == files


def mark(package: Path, known: Fingerprint | None = None) -> Fingerprint:
    return fingerprint_tree(str(package), FileTable(package.parent / "table"), known)[0]


def test_a_folder_reachable_through_several_links_is_read_once(package: Path) -> None:
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


def test_build_results_inside_a_single_package_workspace_are_not_sources(package: Path) -> None:
    for folder, marker in (
        ("build", ".built_by"),
        ("install", ".colcon_install_layout"),
        ("log", "latest_build"),
    ):
        (package / folder).mkdir()
        for name in (marker, "COLCON_IGNORE", "result"):
            (package / folder / name).touch()
    assert [path for path in source_files(str(package)) if path.endswith("/result")] == []


def test_a_tree_that_has_not_changed_is_not_read_again(package: Path) -> None:
    table = FileTable(package / "table")
    first = fingerprint_tree(str(package), table)
    assert fingerprint_tree(str(package), table)[1] is first[1]
    (package / "src/x.cpp").write_text("int y;")
    settle(package)
    changed = fingerprint_tree(str(package), table)
    assert changed[0].digest != first[0].digest
    assert changed == fingerprint_tree(str(package), FileTable(package / "other"))


@pytest.mark.parametrize("change", ["content", "mode", "removal", "link"])
def test_a_fingerprint_of_written_files_equals_one_of_all_files(package: Path, change: str) -> None:
    paths = (str(package / "package.xml"), str(package / "src/x.cpp"), f"{package}/src/")
    table = FileTable(package / "table")
    known, contents = fingerprint_files(paths, table)
    assert fingerprint_again(paths, table, contents, ()) is None  # not confirmed
    assert fingerprint_files(paths, table, known) == (known, {})
    source = package / "src/x.cpp"
    match change:
        case "content":
            source.write_text("int y;")
        case "mode":
            source.chmod(0o600)
        case "removal":
            source.unlink()
        case _:
            source.unlink()
            source.symlink_to("../package.xml")
    again = fingerprint_again(paths, table, contents, {str(source), "/elsewhere"})
    assert again == fingerprint_files(paths, FileTable(package / "other"))
    assert again is not None
    assert again[0].digest != known.digest


def test_files_that_others_write_meanwhile_differ_from_the_fingerprint(package: Path) -> None:
    paths = (str(package / "package.xml"), str(package / "src/x.cpp"))
    table = FileTable(package / "table")
    known, contents = fingerprint_files(paths, table)
    fingerprint_files(paths, table, known)
    (package / "package.xml").write_text("<other/>")
    again = fingerprint_again(paths, table, contents, ())
    assert again is not None
    assert fingerprint_files(paths, table, again[0])[0].digest != again[0].digest
