"""The watched folders and the lines of a watch; tests/e2e/test_watch.py has the rest."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import pytest

from forge.base.colours import Palette
from forge.cli.watch.file_watcher import FileWatcher, WatchSpec, watch_specs
from forge.cli.watch.watching import line_of
from forge.output.console import Tally
from forge.workspace.discovery import discover
from tests.packages import manifest_text

if TYPE_CHECKING:
    from tests.conftest import Forge, Tree

CMAKE = "cmake_minimum_required(VERSION 3.18)\nproject(a NONE)\ninstall(FILES said.txt DESTINATION share/a)\n"
PACKAGE = {
    "src/a/package.xml": manifest_text("a", build_type="cmake"),
    "src/a/CMakeLists.txt": CMAKE,
    "src/a/said.txt": "one",
}


@pytest.mark.parametrize(
    ("tally", "line"),
    [
        (Tally(finished=("a", "b", "c")), "c and 2 more rebuilt in 0.40s"),
        (
            Tally(failed=("b",), finished=("a",), not_processed=("c",)),
            "b failed, a rebuilt, 1 not built in 0.40s",
        ),
        (Tally(aborted=("a",)), "a stopped in 0.40s"),
        (Tally(embedded=("e",)), "embedded packages rebuilt in 0.40s"),
        (Tally(unchanged=("a",)), "nothing to do"),
    ],
)
def test_a_line_names_the_first_of_the_plan(tally: Tally, line: str) -> None:
    assert line_of(("c", "b", "a"), tally, 0.4, Palette()) == line


def test_what_is_looked_at(tree: Tree) -> None:
    root = tree(
        {
            **PACKAGE,
            "src/a/deep/er/x.py": "",
            "src/a/.git/HEAD": "",
            "src/hidden/COLCON_IGNORE": "",
            "src/hidden/b/package.xml": "",
            "build/COLCON_IGNORE": "",
            ".venv/x": "",
            "venv/pyvenv.cfg": "",
            "venv/lib/x": "",
            "src/site-packages/x": "",
            "far/said.txt": "",
        }
    )
    (root / "src/a/link.txt").symlink_to(root / "far/said.txt")
    (root / "src/loop").symlink_to(root / "src")
    found = watch_specs(discover(root, ["."], {}), ["."], ["forge.toml"], frozenset({f"{root}/build"}))
    assert {os.path.relpath(folder, root) for folder in found} == {
        *(".", "src", "src/a", "src/a/deep", "src/a/deep/er", "src/hidden", "far")
    }
    assert found[f"{root}/src/a"] == WatchSpec()
    assert not found[f"{root}/src/hidden"].folders
    assert "said.txt" in (found[f"{root}/far"].names or ())
    assert "forge.toml" in (found[str(root)].names or ())


def test_states_differ_if_a_file_changed(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of folders do not change with what is no source; native events name the files to look at."""
    root = tree({"a/x.txt": "", "a/below/y.txt": ""})
    folder, file = f"{root}/a", f"{root}/a/x.txt"
    native = FileWatcher(lambda _: None)
    assert native.states(frozenset()) == {}
    assert native.states(frozenset({file})).keys() == {file}
    monkeypatch.setenv("WATCHFILES_FORCE_POLLING", "1")
    polling = FileWatcher(lambda _: None)
    polling.watch(lambda: {folder: WatchSpec()})
    before = polling.states(frozenset())
    assert before.keys() == {folder, file}
    (root / "a/__pycache__").mkdir()
    assert polling.states(frozenset()) == before
    (root / "a/x.txt").write_text("new")
    assert polling.states(frozenset())[file] != before[file]
    (root / "a/x.txt").unlink()
    assert polling.states(frozenset({file}))[file] == ""


def test_what_cannot_be_watched(forge: Forge, tree: Tree) -> None:
    ran = forge("build", "--watch", "--dry-run", cwd=tree(PACKAGE))
    assert (ran.code, ran.err.splitlines()[0]) == (2, "error: '--watch' cannot be combined with '--dry-run'")
