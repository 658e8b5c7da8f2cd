"""The watched folders and the lines of a watch; tests/e2e/test_watch.py has the rest."""

import os

from forge.plugins.watch.watch import WatchSpec, watch_specs
from forge.workspace.discovery import discover
from tests.conftest import Forge, Tree
from tests.packages import manifest_text

CMAKE = "cmake_minimum_required(VERSION 3.18)\nproject(a NONE)\ninstall(FILES said.txt DESTINATION share/a)\n"
PACKAGE = {
    "src/a/package.xml": manifest_text("a", build_type="cmake"),
    "src/a/CMakeLists.txt": CMAKE,
    "src/a/said.txt": "one",
}


def test_the_watched_folders_follow_the_selection(tree: Tree) -> None:
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


def test_incompatible_options_are_rejected_with_watch(forge: Forge, tree: Tree) -> None:
    ran = forge("build", "--watch", "--dry-run", cwd=tree(PACKAGE))
    assert (ran.code, ran.err.splitlines()[0]) == (2, "error: '--watch' cannot be combined with '--dry-run'")
