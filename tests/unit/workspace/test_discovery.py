"""Folders to packages."""

import os
from pathlib import Path

from forge.workspace.discovery import discover, special_files
from forge.workspace.model import RUN_KINDS
from tests.conftest import Tree
from tests.packages import manifest_text, manifests


def found(root: Path, *base_paths: str) -> dict[str, str]:
    workspace = discover(root, base_paths or ["."], {})
    return {name: str(package.path) for name, package in workspace.packages.items()}


def test_packages_are_found_in_folders_but_not_inside_other_packages(tree: Tree) -> None:
    root = tree(manifests("src/a", "src/a/inner", "src/deep/er/b", "src/.hidden"))
    assert found(root) == {"a": "src/a", "b": "src/deep/er/b"}
    assert found(root, "src/deep", "src/a") == {"b": "src/deep/er/b", "a": "src/a"}


def test_ignore_files_hide_a_folder_and_its_subfolders(tree: Tree) -> None:
    marks = dict.fromkeys(("b/COLCON_IGNORE", "c/AMENT_IGNORE", "e/_setup_util.py"), "")
    root = tree({**manifests("a", "b", "c/d", "e/f"), **marks})
    assert found(root) == {"a": "a"}


INSTALLED = (
    *("venv/pyvenv.cfg", "venv/lib/python3.11/dist/package.xml", "conda/conda-meta/history"),
    *("conda/share/x/package.xml", "web/node_modules/x/package.xml"),
    *("prefix/lib/python3.11/site-packages/x/package.xml", "usr/lib/python3/dist-packages/x/package.xml"),
)
"""Files of a workspace in environments, and where package managers install."""


def test_installed_packages_are_not_discovered(tree: Tree) -> None:
    installed = {f"src/{name}": manifest_text("a") for name in INSTALLED}
    root = tree({**manifests("src/a"), **installed})
    workspace = discover(root, ["."], {})
    assert (workspace.problems, workspace.duplicates) == ((), ())
    assert found(root) == {"a": "src/a"}
    assert found(root, "src/venv/lib") == {"a": "src/venv/lib/python3.11/dist"}
    assert found(root, "src/web/node_modules") == {"a": "src/web/node_modules/x"}


def test_virtual_environments_at_the_root_hide_no_packages(tree: Tree) -> None:
    root = tree({"pyvenv.cfg": "", **manifests("src/a", "lib/python3.11/site-packages/a")})
    assert found(root) == {"a": "src/a"}


def test_named_pipes_in_virtual_environments_are_not_opened(tree: Tree) -> None:
    root = tree({"a/package.xml": "", "a/env/pyvenv.cfg": "", "a/node_modules/x": ""})
    for folder in ("env", "node_modules"):
        os.mkfifo(root / "a" / folder / "setup.py")
    assert list(special_files(root, Path("a"))) == []
    os.mkfifo(root / "a" / "setup.py")
    assert len(list(special_files(root, Path("a")))) == 1


def test_symlink_loops_are_detected_and_each_folder_is_visited_once(tree: Tree) -> None:
    root = tree(manifests("src/a"))
    (root / "src" / "loop").symlink_to(root)
    (root / "src" / "again").symlink_to(root / "src" / "a")
    (root / "src" / "broken").symlink_to(root / "nowhere")
    assert found(root) == {"a": "src/a"}


def test_errors_and_duplicates_do_not_hide_other_packages(tree: Tree) -> None:
    root = tree(
        {
            "a/package.xml": manifest_text("same"),
            "b/package.xml": manifest_text("same"),
            "c/package.xml": "<package",
            "d/package.xml": manifest_text("d"),
        }
    )
    (root / "e" / "package.xml").mkdir(parents=True)
    workspace = discover(root, ["."], os.environ)
    assert sorted(workspace.packages) == ["d", "same"]
    assert [str(other.path) for other in workspace.duplicates] == ["b"]
    assert [problem.message for problem in workspace.problems] == [
        "not well-formed XML: unclosed token",
        "cannot read the manifest: Is a directory",
    ]


def test_a_group_dependency_is_a_dependency_on_its_members(tree: Tree) -> None:
    root = tree(
        {
            "a/package.xml": manifest_text("a", "<group_depend>g</group_depend>"),
            "b/package.xml": manifest_text("b", "<member_of_group>g</member_of_group>"),
        }
    )
    assert discover(root, ["."], {}).packages["a"].manifest.names(RUN_KINDS) == ("b",)


def test_actions_and_services_are_detected(tree: Tree) -> None:
    files = ["a/action/Go.action", "b/srv/Go.srv", "b/action/README.md"]
    files += ("c/msg/Go.idl", "c/action/Go.idl", "c/srv/Go.idl")
    root = tree({**manifests("a", "b", "c"), **dict.fromkeys(files, "")})
    found = discover(root, ["."], {}).packages
    assert (found["a"].has_actions, found["a"].has_services) == (True, False)
    assert (found["b"].has_actions, found["b"].has_services) == (False, True)
    assert (found["c"].has_actions, found["c"].has_services) == (True, True)
