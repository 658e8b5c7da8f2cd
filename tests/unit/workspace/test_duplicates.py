"""Packages with the same name are one message per copy, with the likely cause."""

from pathlib import Path

from forge.workspace.discovery import discover
from forge.workspace.load import clashes
from tests.conftest import Tree
from tests.packages import manifests


def reported(root: Path) -> list[tuple[str, str]]:
    workspace = discover(root, ["."], {})
    found = clashes(workspace, workspace.packages.keys())
    return [(problem.message, problem.hint or "") for problem in found]


def test_duplicates_in_a_worktree_give_one_error_that_suggests_ignoring_it(tree: Tree) -> None:
    root = tree(
        {**manifests("src/a", "src/b", "build_copy/src/a", "build_copy/src/b"), "build_copy/.git": ""}
    )
    ((message, hint),) = reported(root)
    assert message == "2 packages are in '.' and again in 'build_copy': 'a', 'b'"
    assert hint.startswith("'build_copy' is another checkout of a repository: ")
    assert hint.endswith("creating an empty file 'build_copy/COLCON_IGNORE'")


def test_the_copy_in_a_generated_folder_should_be_ignored(tree: Tree) -> None:
    ((message, hint),) = reported(tree(manifests("docs_build/a", "src/a")))
    assert message == "two packages are named 'a': 'src/a' and 'docs_build/a'"
    assert hint.endswith("'docs_build/COLCON_IGNORE'")


def test_the_hint_never_suggests_ignoring_a_folder_with_other_packages(tree: Tree) -> None:
    ((_, hint),) = reported(tree(manifests("src/a", "old/a", "old/b")))
    assert hint.endswith("'old/a/COLCON_IGNORE'")


def test_a_folder_of_workspaces_is_recognized(tree: Tree) -> None:
    root = tree(manifests("one/src/a", "two/src/a", "two/src/b", "x/src/b", "x/src/a"))
    assert reported(root) == [
        (
            "this folder contains 3 workspaces with packages of the same names: 'a', 'b'",
            "change to one of them: cd one",
        )
    ]
