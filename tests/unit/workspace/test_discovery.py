"""Folders to packages."""

import os
from pathlib import Path

from forge.workspace.discovery import discover, discover_embedded
from forge.workspace.model import RUN_KINDS
from tests.conftest import Tree
from tests.packages import manifest_text


def found(root: Path, *base_paths: str) -> dict[str, str]:
    """Return name -> path."""
    workspace = discover(root, base_paths or ["."], {})
    return {name: str(package.path) for name, package in workspace.packages.items()}


def test_packages_are_found_in_folders_but_not_in_packages(tree: Tree) -> None:
    root = tree(
        {
            "src/a/package.xml": manifest_text("a"),
            "src/a/inner/package.xml": manifest_text("inner"),
            "src/deep/er/b/package.xml": manifest_text("b"),
            "src/.hidden/package.xml": manifest_text("hidden"),
        }
    )
    assert found(root) == {"a": "src/a", "b": "src/deep/er/b"}
    assert found(root, "src/deep", "src/a") == {"b": "src/deep/er/b", "a": "src/a"}


def test_ignore_marks_hide_a_folder_and_all_below(tree: Tree) -> None:
    root = tree(
        {
            "a/package.xml": manifest_text("a"),
            "b/COLCON_IGNORE": "",
            "b/package.xml": manifest_text("b"),
            "c/AMENT_IGNORE": "",
            "c/d/package.xml": manifest_text("d"),
            "e/_setup_util.py": "",
            "e/f/package.xml": manifest_text("f"),
        }
    )
    assert found(root) == {"a": "a"}


def test_a_loop_of_links_ends_and_a_folder_counts_once(tree: Tree) -> None:
    root = tree({"src/a/package.xml": manifest_text("a")})
    (root / "src" / "loop").symlink_to(root)
    (root / "src" / "again").symlink_to(root / "src" / "a")
    (root / "src" / "broken").symlink_to(root / "nowhere")
    assert found(root) == {"a": "src/a"}


def test_a_folder_that_is_not_there_holds_nothing(tree: Tree) -> None:
    assert found(tree({}), "nowhere") == {}


def test_errors_and_duplicate_names_are_reported_and_the_rest_is_found(tree: Tree) -> None:
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


def test_a_group_dependency_is_one_on_its_members(tree: Tree) -> None:
    root = tree(
        {
            "a/package.xml": manifest_text("a", "<group_depend>g</group_depend>"),
            "b/package.xml": manifest_text("b", "<member_of_group>g</member_of_group>"),
        }
    )
    assert discover(root, ["."], {}).packages["a"].manifest.names(RUN_KINDS) == ("b",)


def test_actions_are_noticed(tree: Tree) -> None:
    root = tree({"a/package.xml": manifest_text("a"), "a/action/Go.action": "---\n---\n"})
    assert discover(root, ["."], {}).packages["a"].has_actions


def test_the_embedded_packages_are_sound() -> None:
    embedded = discover_embedded()
    assert {"ament_cmake", "std_msgs", "rosidl_default_generators"} <= embedded.keys()
    assert all(package.embedded for package in embedded.values())
    assert embedded["action_msgs"].path.is_absolute()
