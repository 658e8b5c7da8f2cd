"""Packages are selected by changes in git."""

import os
import subprocess
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text, manifests, write_files
from tests.selection import CHAIN, names


@pytest.fixture
def root(tree: Tree) -> Path:
    return tree(CHAIN)


def git(root: Path, *argv: str) -> str:
    who = ("-c", "user.name=t", "-c", "user.email=t@example.com", "-c", "init.defaultBranch=main")
    words = ("git", *who, "-c", "protocol.file.allow=always", *argv)
    return subprocess.run(words, cwd=root, check=True, capture_output=True, text=True).stdout.strip()


def commit(root: Path, files: dict[str, str] | None = None) -> str:
    """Write files, commit everything, and return the commit."""
    write_files(root, files or {})
    if not (root / ".git").exists():
        git(root, "init")
    git(root, "add", ".")
    git(root, "commit", "--allow-empty", "-m", "change")
    return git(root, "rev-parse", "HEAD")


def changed(forge: Forge, root: Path, *argv: str) -> str:
    return names(forge, root, "--packages-select-changed", *argv)


@pytest.mark.needs("git")
def test_packages_with_changed_files_are_selected(forge: Forge, root: Path) -> None:
    commit(root, {"src/b/old.txt": "x", ".gitignore": "ignored\n"})
    assert changed(forge, root) == ""
    write_files(root, {"src/a/new.txt": "x", "src/d/ignored": "x"})
    assert changed(forge, root) == "a"
    assert names(forge, root, "--packages-above-changed") == "a b c"
    commit(root)
    (root / "src/b/old.txt").unlink()
    assert changed(forge, root) == "b"
    assert changed(forge, root, "--since", "HEAD~1") == "a b"


@pytest.mark.needs("git")
def test_nested_repositories_are_compared_separately(forge: Forge, root: Path) -> None:
    for name in ("a", "b"):
        commit(root / "src" / name)
    write_files(root, {"src/b/new.txt": "x"})
    assert changed(forge, root, "--packages-skip", "c", "d") == "b"
    ran = forge("list", "--packages-select-changed", "--since", "nowhere", cwd=root)
    assert ran.code == 2
    assert "git cannot determine changes since 'nowhere'" in ran.err


@pytest.mark.needs("git")
def test_packages_outside_any_repository_are_reported(forge: Forge, root: Path) -> None:
    commit(root / "src/a")
    ran = forge("list", "-n", "--packages-select-changed", cwd=root)
    assert (ran.code, ran.out) == (0, "b\nc\nd\n")
    warning = "'b', 'c', 'd' are in no git repository and always count as changed"
    assert ran.err == f"warning: {warning}\n"


@pytest.mark.parametrize("option", ["--packages-select-changed", "--packages-above-changed"])
def test_no_packages_are_selected_without_a_repository(forge: Forge, root: Path, option: str) -> None:
    ran = forge("build", option, cwd=root)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.startswith("error: cannot determine changed packages: none of them is in a git repository")
    assert "\nhint: " in ran.err
    assert not (root / "build").exists()


def test_changed_packages_need_git(forge: Forge, root: Path) -> None:
    write_files(root, {".git/HEAD": "ref: refs/heads/main\n"})
    ran = forge("list", "--packages-select-changed", cwd=root, env={"PATH": ""})
    assert (ran.code, ran.err) == (2, "error: cannot determine changed files: git is not installed\n")


@pytest.fixture
def project(tree: Tree) -> Path:
    """Return a superproject with package own, and pa, pb, pc in the submodule src/up, three commits each."""
    up = tree(manifests("up/pa", "up/pb", "up/pc")) / "up"
    commit(up)
    root = up.with_name("ws")
    commit(root, manifests("src/own"))
    git(root, "submodule", "add", str(up), "src/up")
    commit(root)
    for name in ("pa", "pb"):
        commit(root / "src/up", {f"{name}/new.txt": "x"})
    return root


@pytest.mark.needs("git")
def test_submodules_are_compared_with_the_commit_in_the_superproject(forge: Forge, project: Path) -> None:
    assert changed(forge, project) == "pa pb"
    commit(project)
    assert changed(forge, project) == ""
    assert changed(forge, project, "--since", "HEAD~1") == "pa pb"
    write_files(project, {"src/up/pc/untracked.txt": "x"})
    assert changed(forge, project) == "pc"
    # Names that exist in the submodule too.
    git(project / "src/up", "tag", "v1")
    git(project, "tag", "v1", "HEAD~1")
    assert changed(forge, project, "--since", "v1") == "pa pb pc"
    # A name that exists only in the submodule.
    git(project / "src/up", "tag", "v2")
    ran = forge("list", "--packages-select-changed", "--since", "v2", cwd=project)
    assert (ran.code, ran.err.count("since 'v2': unknown revision")) == (2, 1)


@pytest.mark.needs("git")
def test_nested_submodules_are_compared_with_the_commits_in_their_superprojects(
    forge: Forge, project: Path
) -> None:
    outer = project.with_name("outer")
    commit(outer, {"package.xml": manifest_text("outer")})
    commit(project)
    git(outer, "submodule", "add", str(project), "ws")
    git(outer / "ws", "config", "submodule.src/up.url", str(project / "src/up"))
    git(outer / "ws", "submodule", "update", "--init")
    commit(outer)
    assert changed(forge, outer) == ""
    write_files(outer, {"ws/src/up/pc/new.txt": "x"})
    assert changed(forge, outer, "--base-paths", ".", "ws/src") == "outer pc"


@pytest.mark.needs("git")
@pytest.mark.parametrize("change", ["added", "moved", "removed from the index"])
def test_a_submodule_at_a_new_path_counts_as_changed(forge: Forge, project: Path, change: str) -> None:
    up = project / "src/up"
    git(up, "checkout", git(project, "rev-parse", "HEAD:src/up"))
    assert changed(forge, project) == ""
    if change == "added":
        assert changed(forge, project, "--since", "HEAD~1") == "pa pb pc"
    elif change == "moved":
        git(project, "mv", "src/up", "src/moved")
        assert changed(forge, project) == "pa pb pc"
    else:
        git(project, "rm", "--cached", "src/up")
        commit(up, {"pb/new.txt": "y"})
        assert changed(forge, project) == "pb"


@pytest.mark.needs("git")
def test_a_package_that_contains_a_submodule_changes_with_it(forge: Forge, tree: Tree) -> None:
    library = tree({"library/x.c": "int x;\n"}) / "library"
    commit(library)
    root = library.with_name("ws")
    commit(root, manifests("src/a", "src/b"))
    git(root, "submodule", "add", str(library), "src/a/library")
    commit(root)
    assert changed(forge, root) == ""
    write_files(root, {"src/a/library/x.c": "int y;\n"})
    assert changed(forge, root) == "a"
    commit(root / "src/a/library")
    assert changed(forge, root) == "a"
    commit(root)
    git(root, "submodule", "deinit", "-f", "src/a/library")
    assert (changed(forge, root), changed(forge, root, "--since", "HEAD~1")) == ("", "a")


@pytest.mark.needs("git")
def test_all_submodule_packages_count_as_changed_without_the_recorded_commit(
    forge: Forge, project: Path
) -> None:
    commit(project)
    shallow = project.with_name("shallow")
    git(project, "clone", "-q", f"file://{project}", str(shallow))
    git(shallow, "config", "submodule.src/up.url", f"file://{project}/src/up")
    git(shallow, "submodule", "update", "--init", "--depth", "1")
    assert changed(forge, shallow) == ""
    ran = forge("list", "-n", "--packages-select-changed", "--since", "HEAD~1", cwd=shallow)
    assert (ran.code, ran.out.split()) == (0, ["pa", "pb", "pc"])
    assert "src/up: warning: commit " in ran.err
    assert "git fetch --unshallow" in ran.err


@pytest.mark.needs("git")
def test_an_unknown_revision_of_a_shallow_clone_names_the_remedy(forge: Forge, project: Path) -> None:
    shallow = project.with_name("shallow")
    git(project, "clone", "-q", "--depth", "1", f"file://{project}", str(shallow))
    ran = forge("list", "--packages-select-changed", "--since", "HEAD~1", cwd=shallow)
    assert ran.code == 2
    assert "git fetch --unshallow" in ran.err


@pytest.mark.needs("git")
def test_three_dots_mean_the_merge_base(forge: Forge, root: Path) -> None:
    commit(root)
    git(root, "checkout", "-b", "work")
    commit(root, {"src/a/new.txt": "x"})
    git(root, "checkout", "main")
    commit(root, {"src/b/new.txt": "x"})
    git(root, "checkout", "work")
    assert changed(forge, root, "--since", "main") == "a b"
    assert changed(forge, root, "--since", "main...") == "a"
    assert forge("list", "--packages-select-changed", "--since", "none...", cwd=root).code == 2


@pytest.mark.needs("git")
def test_a_revision_in_several_independent_repositories_is_reported(forge: Forge, root: Path) -> None:
    for name in "abcd":
        commit(root / "src" / name)
        git(root / "src" / name, "tag", "v1")
    assert forge("list", "--packages-select-changed", cwd=root).err == ""
    ran = forge("list", "--packages-select-changed", "--since", "v1", cwd=root)
    assert (ran.code, ran.out) == (0, "")
    assert "warning: 'v1' is resolved separately in 4 repositories: " in ran.err


@pytest.mark.needs("git")
def test_packages_that_git_ignores_are_in_no_repository(forge: Forge, root: Path) -> None:
    commit(root, {".gitignore": "/src/b\n"})
    ran = forge("list", "-n", "--packages-select-changed", cwd=root)
    assert (ran.code, ran.out) == (0, "b\n")
    assert ran.err == "warning: 'b' is in no git repository and always counts as changed\n"


@pytest.mark.needs("git")
def test_git_variables_of_a_hook_are_ignored(
    forge: Forge, root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    commit(root)
    write_files(root, {"src/a/new.txt": "x"})
    commit(root.with_name("other"), {"x": ""})
    monkeypatch.setenv("GIT_DIR", str(root.with_name("other") / ".git"))
    monkeypatch.setenv("GIT_INDEX_FILE", "index.lock")
    monkeypatch.setenv("GIT_WORK_TREE", str(root))
    assert changed(forge, root) == "a"


@pytest.mark.needs("git")
def test_a_repository_of_another_user_is_reported_with_the_remedy(
    forge: Forge, root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    commit(root)
    monkeypatch.setenv("GIT_TEST_ASSUME_DIFFERENT_OWNER", "1")
    bin_ = root.with_name("bin")
    real = subprocess.run(["which", "git"], check=True, capture_output=True, text=True).stdout.strip()
    write_files(bin_, {"git": f'#!/bin/sh\nGIT_TEST_ASSUME_DIFFERENT_OWNER=1 exec {real} "$@"\n'})
    ran = forge("list", "--packages-select-changed", cwd=root, env={"PATH": str(bin_)})
    assert ran.code == 2
    assert "another user owns the repository" in ran.err
    assert f"git config --global --add safe.directory {root}" in ran.err


@pytest.mark.needs("git")
def test_converted_files_are_unchanged_if_the_index_says_so(forge: Forge, root: Path) -> None:
    commit(root, {".gitattributes": "*.dat text eol=crlf\n", "src/a/x.dat": "1\n", "src/b/y.dat": "1\n"})
    for path in ("src/a/x.dat", "src/b/y.dat"):
        (root / path).unlink()
    git(root, "checkout", ".")
    assert (root / "src/a/x.dat").read_bytes() == b"1\r\n"
    age(root)
    assert changed(forge, root) == ""
    (root / "src/a/x.dat").write_bytes(b"2\r\n")
    assert changed(forge, root) == "a"


@pytest.mark.needs("git")
@pytest.mark.parametrize("seconds", [0, 3])
def test_contents_changed_with_equal_size_and_time_are_detected(
    forge: Forge, root: Path, seconds: int
) -> None:
    commit(root, {"src/a/x.txt": "1"})
    if seconds:
        age(root)
    before = (root / "src/a/x.txt").stat()
    (root / "src/a/x.txt").write_text("2")
    os.utime(root / "src/a/x.txt", ns=(before.st_atime_ns, before.st_mtime_ns))
    assert changed(forge, root) == "a"


@pytest.mark.needs("git")
def test_modes_links_and_deleted_files_are_changes(forge: Forge, root: Path) -> None:
    write_files(root, {"src/a/run": "x", "src/c/gone": "x"})
    (root / "src/b/link").symlink_to("one")
    commit(root)
    assert changed(forge, root) == ""
    (root / "src/a/run").chmod(0o755)
    (root / "src/b/link").unlink()
    (root / "src/b/link").symlink_to("two")
    (root / "src/c/gone").unlink()
    assert changed(forge, root) == "a b c"
    git(root, "config", "core.fileMode", "false")
    assert changed(forge, root) == "b c"


@pytest.mark.needs("git")
def test_files_excluded_by_a_sparse_checkout_are_unchanged(forge: Forge, root: Path) -> None:
    commit(root, {"src/a/big/x": "x"})
    git(root, "sparse-checkout", "set", "--no-cone", "/*", "!big")
    assert not (root / "src/a/big").exists()
    assert changed(forge, root) == ""
    commit(root, {"src/b/new": "x"})
    assert changed(forge, root, "--since", "HEAD~1") == "b"


@pytest.mark.needs("git")
def test_a_changed_package_behind_a_link_is_selected(forge: Forge, tree: Tree) -> None:
    root = tree({f"v{n}/x/package.xml": manifest_text("x") for n in (1, 2)})
    (root / "src").mkdir()
    (root / "src/x").symlink_to("../v1/x")
    commit(root)
    assert changed(forge, root, "--base-paths", "src") == ""
    (root / "src/x").unlink()
    (root / "src/x").symlink_to("../v2/x")
    assert changed(forge, root, "--base-paths", "src") == "x"


@pytest.mark.needs("git")
def test_worktrees_are_repositories(forge: Forge, root: Path) -> None:
    commit(root)
    git(root, "worktree", "add", "-q", str(root.with_name("tree")), "-b", "other")
    write_files(root.with_name("tree"), {"src/c/new": "x"})
    assert changed(forge, root.with_name("tree")) == "c"
    assert changed(forge, root) == ""


def age(root: Path) -> None:
    """Give the index a time at which its entries no longer count as racy, and the status of today's files."""
    git(root, "status")
    index = root / ".git/index"
    os.utime(index, (index.stat().st_atime, index.stat().st_mtime + 2))
