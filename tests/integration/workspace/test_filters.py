"""Packages with changes according to git."""

from __future__ import annotations

import subprocess
from typing import TYPE_CHECKING

import pytest

from tests.packages import manifest_text

if TYPE_CHECKING:
    from pathlib import Path

    from tests.conftest import Forge, Tree


@pytest.fixture
def root(tree: Tree) -> Path:
    """Return a workspace in which c needs b needs a, and d stands alone."""
    return tree(
        {
            "src/a/package.xml": manifest_text("a"),
            "src/b/package.xml": manifest_text("b", "<depend>a</depend>"),
            "src/c/package.xml": manifest_text("c", "<depend>b</depend>"),
            "src/d/package.xml": manifest_text("d"),
        }
    )


def names(forge: Forge, root: Path, *argv: str) -> str:
    ran = forge("list", "-n", *argv, cwd=root)
    assert ran.code == 0, ran.err
    return " ".join(ran.out.split())


def git(root: Path, *argv: str) -> None:
    who = ("-c", "user.name=t", "-c", "user.email=t@example.com", "-c", "init.defaultBranch=main")
    subprocess.run(("git", *who, *argv), cwd=root, check=True, capture_output=True)


@pytest.mark.needs("git")
def test_changed_packages_are_those_with_files_that_differ(forge: Forge, root: Path) -> None:
    (root / "src/b/old.txt").write_text("x")
    (root / ".gitignore").write_text("ignored\n")
    git(root, "init")
    git(root, "add", ".")
    git(root, "commit", "-m", "one")
    assert names(forge, root, "--packages-select-changed") == ""
    (root / "src/a/new.txt").write_text("x")
    (root / "src/d/ignored").write_text("x")
    assert names(forge, root, "--packages-select-changed") == "a"
    assert names(forge, root, "--packages-above-changed") == "a b c"
    git(root, "add", ".")
    git(root, "commit", "-m", "two")
    (root / "src/b/old.txt").unlink()
    assert names(forge, root, "--packages-select-changed") == "b"
    assert names(forge, root, "--packages-select-changed", "--since", "HEAD~1") == "a b"


@pytest.mark.needs("git")
def test_repositories_within_are_asked_for_themselves(forge: Forge, root: Path) -> None:
    for name in ("a", "b"):
        git(root / "src" / name, "init")
        git(root / "src" / name, "add", ".")
        git(root / "src" / name, "commit", "-m", "one")
    (root / "src/b/new.txt").write_text("x")
    assert names(forge, root, "--packages-select-changed", "--packages-skip", "c", "d") == "b"
    ran = forge("list", "--packages-select-changed", "--since", "nowhere", cwd=root)
    assert ran.code == 2
    assert "git cannot determine changes since 'nowhere'" in ran.err


@pytest.mark.needs("git")
def test_packages_outside_of_any_repository_are_named(forge: Forge, root: Path) -> None:
    git(root / "src/a", "init")
    git(root / "src/a", "add", ".")
    git(root / "src/a", "commit", "-m", "one")
    ran = forge("list", "-n", "--packages-select-changed", cwd=root)
    assert (ran.code, ran.out) == (0, "b\nc\nd\n")
    warning = "'b', 'c', 'd' are in no git repository and always counted as changed"
    assert ran.err == f"warning: {warning}\n"


@pytest.mark.parametrize("option", ["--packages-select-changed", "--packages-above-changed"])
def test_without_any_repository_nothing_is_selected(forge: Forge, root: Path, option: str) -> None:
    ran = forge("build", option, cwd=root)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.startswith("error: cannot determine changed packages: none of them is in a git repository")
    assert "\nhint: " in ran.err
    assert not (root / "build").exists()


def test_changed_packages_need_git(forge: Forge, root: Path) -> None:
    (root / ".git").mkdir()
    ran = forge("list", "--packages-select-changed", cwd=root, env={"PATH": ""})
    assert (ran.code, ran.err) == (2, "error: cannot determine changed files: git is not installed\n")
