"""A workspace is found from any folder inside it."""

import os
from pathlib import Path

import pytest

from forge.cli.colcon_options import classified
from forge.workspace.root import find_root, rebase_paths
from tests.conftest import Forge, Tree
from tests.packages import manifest_text

MARK = "install/.colcon_install_layout"
PACKAGE = "package.xml"


@pytest.mark.parametrize(
    ("files", "start", "root"),
    [
        (["ws/src/a/package.xml"], "ws", "ws"),
        (["ws/src/a/package.xml"], "ws/src/a", "ws"),
        (["ws/src/a/package.xml", "ws/src/a/src/x"], "ws/src/a/src", "ws"),
        ([f"ws/{MARK}", "ws/src/repo/src/a/x"], "ws/src/repo", "ws"),
        ([f"ws/{MARK}", "ws/a/package.xml"], "ws/a", "ws"),
        (["ws/build/.built_by", "ws/src/x"], "ws/build", "ws"),
        (["ws/forge.toml", "ws/docs/x"], "ws/docs", "ws"),
        ([f"ws/{MARK}", f"ws/src/a/{MARK}"], "ws/src/a", "ws/src/a"),
        ([f"old/{MARK}", "old/new/src/x"], "old/new", "old/new"),
        (["ws/src/x", f"ws/src/deep/{MARK}", "ws/src/deep/src/x"], "ws/src/deep/src", "ws/src/deep"),
        (["a/package.xml"], "a", "a"),
        (["x/y"], "x", "x"),
        ([f"home/{MARK}", "home/x/y"], "home/x", "home/x"),
        ([f"shared/{MARK}", "shared/x/y"], "shared/x", "shared/x"),
        ([f"home/{MARK}"], "home", "home"),
    ],
)
def test_the_root_of_a_workspace_is_found(tree: Tree, files: list[str], start: str, root: str) -> None:
    base = tree(dict.fromkeys(files, ""))
    if (base / "shared").is_dir():
        (base / "shared").chmod(0o1777)
    assert find_root(base / start, base / "home") == base / root


def rebased(words: list[str], origin: str, root: str) -> list[str]:
    """Return a command line with its paths relative to the root."""
    return rebase_paths(classified(words[0], words), Path(origin), Path(root))


def test_rebased_paths_name_the_same_files() -> None:
    words = [
        "build",
        "--build-base",
        "b",
        "--paths",
        "x",
        "../y",
        "--install-base=/i",
        "--log-b",
        "../../../l",
    ]
    assert rebased(words, "/ws/src/a", "/ws") == [
        "build",
        *("--build-base", "src/a/b"),
        *("--paths", "src/a/x", "src/y"),
        "--install-base=/i",
        *("--log-b", "/l"),
    ]
    python = ["build", "--python", "venv/bin/python"]
    assert rebased(python, "/ws/s", "/ws")[-1] == "s/venv/bin/python"
    assert rebased(["build", "--python", "python3"], "/ws/s", "/ws")[-1] == "python3"
    assert rebased(["list", "--log-base=l", "-n"], "/ws/s", "/ws") == [*("list", "--log-base=s/l", "-n")]
    assert rebased(["graph", "-o", "g.svg"], "/ws/s", "/ws")[-1] == "s/g.svg"
    pytest_words = ["test", "--pytest-args", "-o", "addopts=", "--python", "venv/bin/python", "--output=x"]
    assert rebased(pytest_words, "/ws/s", "/ws") == pytest_words


@pytest.fixture
def workspace(tree: Tree) -> Path:
    return (
        tree(
            {
                "ws/src/a/package.xml": manifest_text("a"),
                "ws/src/b/package.xml": manifest_text("b"),
                "ws/src/b/deep/file": "",
                "ws/build/a/pytest.xml": "<testsuite tests='1' failures='1'/>",
            }
        )
        / "ws"
    )


def test_commands_in_a_subfolder_use_the_whole_workspace_and_print_relative_paths(
    forge: Forge, workspace: Path
) -> None:
    deep = workspace / "src/b/deep"
    ran = forge("list", "-p", cwd=deep)
    assert ran.out == "..\n../../a\n"
    assert forge("list", "--base-paths", "..", "-p", cwd=deep).out == "..\n"
    assert forge("test-result", cwd=deep).out.startswith("../../../build/a/pytest.xml: 1 test,")
    assert forge("test-result", "--delete-yes", cwd=deep).out.startswith("- ../../../build/a/pytest.xml\n")
    assert not (workspace / "build/a/pytest.xml").exists()


def test_option_C_changes_the_working_directory(forge: Forge, workspace: Path, tmp_path: Path) -> None:
    assert forge("-C", "ws", "list", "-p", cwd=tmp_path).out == "src/a\nsrc/b\n"
    assert forge("-Cws", "-C", "src/b", "list", "-n", cwd=tmp_path).out == "a\nb\n"
    before = Path.cwd()
    ran = forge("-C", "nowhere", "list", cwd=tmp_path)
    assert (ran.code, ran.err) == (2, "error: cannot change to 'nowhere': No such file or directory\n")
    assert Path.cwd() == before
    assert os.fspath(workspace).endswith("/ws")
