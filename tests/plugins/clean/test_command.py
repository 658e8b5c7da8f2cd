"""`forge clean` removes what was built, asks first, and leaves everything else alone."""

import io
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.packages import write_files
from tests.testable import built_once, cmake_package, restored

pytestmark = pytest.mark.needs("cmake", "ninja")


@pytest.fixture(scope="module")
def layouts(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Build a workspace with a and b, which needs a, in both layouts."""
    files = {**cmake_package("a"), **cmake_package("b", needs="<depend>a</depend>")}
    folder = tmp_path_factory.mktemp("built")
    options = {"isolated": (), "merged": ("--merge-install",)}
    return {layout: built_once(folder / layout, files, *words) for layout, words in options.items()}


@pytest.fixture(params=["isolated", "merged"])
def workspace(request: pytest.FixtureRequest, layouts: dict[str, Path]) -> Path:
    """Return the workspace as it was built, in both layouts."""
    return restored(layouts[request.param])


@pytest.fixture
def isolated(layouts: dict[str, Path]) -> Path:
    """Return the workspace as it was built, for tests in which the layout makes no difference."""
    return restored(layouts["isolated"])


def left(root: Path) -> set[str]:
    """Return all files that are not sources or logs."""
    folders = [root / "build", root / "install"]
    return {
        path.relative_to(root).as_posix()
        for folder in folders
        for path in folder.rglob("*")
        if not path.is_dir()
    }


def test_clean_restores_the_unbuilt_workspace(forge: Forge, workspace: Path) -> None:
    ran = forge("clean", "workspace", "-y", cwd=workspace)
    assert (ran.code, ran.err) == (0, "")
    assert sorted(path.name for path in workspace.iterdir()) == ["src"]
    assert forge("clean", "workspace", "-y", cwd=workspace).out == "nothing to remove\n"


def test_foreign_files_are_kept(forge: Forge, workspace: Path) -> None:
    mine = ("build/mine/notes", "install/mine/notes", "log/mine/notes", "install/share/mine", "build/file")
    write_files(workspace, dict.fromkeys(mine, ""))
    ran = forge("clean", "workspace", "--yes", cwd=workspace)
    assert all((workspace / name).is_file() for name in mine)
    assert "not removed, because forge did not create it: build/mine\n" in ran.err
    assert not (workspace / "install/setup.sh").exists()
    assert left(workspace) == {name for name in mine if not name.startswith("log")}


def test_only_the_selected_folders_are_removed(forge: Forge, isolated: Path) -> None:
    forge("clean", "workspace", "-y", "--base-select", "log", cwd=isolated)
    assert not (isolated / "log").exists()
    assert (isolated / "install/setup.sh").is_file()
    forge("clean", "workspace", "-y", "--base-select", "build", "install", cwd=isolated)
    assert sorted(path.name for path in isolated.iterdir()) == ["src"]


def test_a_package_is_removed_completely_and_can_be_rebuilt(forge: Forge, workspace: Path) -> None:
    before = left(workspace)
    scripts = (workspace / "install/local_setup.sh").read_text()
    ran = forge("clean", "packages", "b", "-y", cwd=workspace)
    assert ran.code == 0
    rest = left(workspace)
    assert not [name for name in rest if "/b/" in name or name.endswith("/b")]
    assert {name for name in before - rest if "/a/" in name} == set()
    if re.search(r"'b'|/b\b", scripts):
        assert (workspace / "install/local_setup.sh").read_text() != scripts
    merged = ["--merge-install"] if (workspace / "install/share/a").is_dir() else []
    ran = forge("build", *merged, cwd=workspace)
    assert "Finished <<< b" in ran.out
    assert "Finished <<< a" not in ran.out
    assert left(workspace) == before


def test_packages_can_be_selected(forge: Forge, isolated: Path) -> None:
    ran = forge("clean", "packages", "--packages-above", "a", "--yes", cwd=isolated)
    assert ran.code == 0
    assert not (isolated / "build/a").exists()
    assert not (isolated / "build/b").exists()


def test_results_of_removed_packages_are_stale(forge: Forge, workspace: Path) -> None:
    assert forge("clean", "stale", cwd=workspace).out == "nothing to remove\n"
    shutil.rmtree(workspace / "src/b")
    ran = forge("clean", "stale", "-y", cwd=workspace)
    assert "- build/b (build folder of 'b')\n" in ran.out
    assert "'a'" not in ran.out
    assert not [name for name in left(workspace) if "/b/" in name or name.endswith("/b")]
    assert (workspace / "build/a").is_dir()
    assert forge("clean", "stale", "-y", cwd=workspace).out == "nothing to remove\n"


def test_results_with_a_broken_manifest_are_not_stale(forge: Forge, isolated: Path) -> None:
    (isolated / "src/b/package.xml").write_text("<package/>")
    assert forge("clean", "stale", "-y", cwd=isolated).code == 2
    assert (isolated / "build/b").is_dir()


@pytest.mark.parametrize(("answer", "gone"), [("", False), ("\n", False), ("n\n", False), ("Y\n", True)])
def test_clean_asks_for_confirmation(
    forge: Forge, tree: Tree, monkeypatch: pytest.MonkeyPatch, answer: str, gone: object
) -> None:
    root = tree({"src/x": "", "build/.built_by": "colcon", "build/a/colcon_build.rc": "0"})
    monkeypatch.setattr(sys, "stdin", io.StringIO(answer))
    ran = forge("clean", "workspace", cwd=root)
    assert ran.code == 0
    assert ran.out.startswith("- build/a (build folder of 'a')\n- forge's own files in 'build' in build\n")
    assert "\nRemove these 2 items? [y/N] " in ran.out
    assert (root / "build").exists() is not gone


def test_clean_without_arguments_lists_what_it_would_remove(forge: Forge, tree: Tree) -> None:
    names = ("build/gone/cmake_args.last", "install/.colcon_install_layout", "src/x")
    root = tree({**dict.fromkeys(names, ""), "build/.built_by": "colcon"})
    ran = forge("clean", cwd=root)
    assert (ran.code, ran.err) == (0, "")
    assert ran.out == (
        "- 2 items in build\n- 1 item in install\n"
        "Nothing was removed. These commands list what they remove and ask first:\n"
        "  forge clean workspace         all of the above\n"
        "  forge clean packages PKG ...  the results of these packages\n"
        "  forge clean stale             the results of packages that left the workspace: 'gone'\n"
    )
    assert (root / "build/gone/cmake_args.last").exists()
    assert forge("clean", "-y", "workspace", cwd=root).code == 0
    assert forge("clean", cwd=root).out == "nothing to remove\n"
    assert "argument what: invalid choice: 'all'" in forge("clean", "-y", "all", cwd=root).err
    assert "'clean' does not accept" in forge("clean", "--packages-select", "gone", cwd=root).err


def test_contradictory_arguments_are_rejected(forge: Forge, tree: Tree) -> None:
    root = tree({"build/.built_by": "colcon", "build/a/colcon_build.rc": "0"})
    assert forge("clean", "packages", cwd=root).code == 2
    assert forge("clean", "workspace", "a", cwd=root).code == 2
    ran = forge("clean", "packages", "aa", cwd=root)
    assert (ran.code, ran.err) == (
        2,
        "error: package 'aa' was never built here\nhint: did you mean 'a'?\n",
    )


def test_links_are_removed_and_not_followed(forge: Forge, tree: Tree) -> None:
    root = tree({"src/x": "", "elsewhere/kept": "", "build/.built_by": "colcon", "elsewhere/.forge/x": ""})
    (root / "build/a").symlink_to(root / "elsewhere")
    assert forge("clean", "workspace", "-y", cwd=root).code == 0
    assert (root / "elsewhere/kept").is_file()
    assert not (root / "build").exists()


@pytest.mark.parametrize("words", [("-y", "a", "b"), ("a", "-y", "b"), ("a", "b", "-y")])
def test_names_are_accepted_before_and_after_options(
    forge: Forge, isolated: Path, words: tuple[str, ...]
) -> None:
    ran = forge("clean", "packages", *words, cwd=isolated)
    assert ran.code == 0, ran.err
    assert not (isolated / "build/a").exists()
    assert not (isolated / "build/b").exists()
    assert forge("clean", "packages", "-y", "a", "--nonsense", cwd=isolated).code == 2


def test_files_not_installed_by_builds_are_kept_and_reported(forge: Forge, workspace: Path) -> None:
    merged = (workspace / "install/share/a").is_dir()
    prefix = "install" if merged else "install/a"
    mine = (f"{prefix}/share/a/mine.yaml", f"{prefix}/mine/deep/x", f"{prefix}/share/a/package.notes")
    write_files(workspace, dict.fromkeys(mine, ""))
    (workspace / prefix / "empty").mkdir()
    ran = forge("clean", "packages", "a", "-y", cwd=workspace)
    assert ran.code == 0
    assert all((workspace / name).is_file() for name in mine)
    assert (workspace / prefix / "empty").is_dir()
    if not merged:
        assert f"not removed, because forge did not create it: {mine[0]}\n" in ran.err
        assert not (workspace / "install/a/share/a/package.dsv").exists()
    options = ["--merge-install"] if merged else []
    assert forge("build", *options, cwd=workspace).code == 0
    assert all((workspace / name).is_file() for name in mine)
    ran = forge("clean", "workspace", "-y", cwd=workspace)
    assert ran.code == 0
    assert all((workspace / name).is_file() for name in mine)
    assert left(workspace) - {"install/.forge_files/a.json"} == set(mine)
    assert forge("build", *options, cwd=workspace).code == 0
    assert all((workspace / name).is_file() for name in mine)


def test_without_records_files_newer_than_the_package_are_kept(forge: Forge, isolated: Path) -> None:
    shutil.rmtree(isolated / "build")
    write_files(isolated, {"install/a/mine": ""})
    assert forge("clean", "workspace", "-y", cwd=isolated).code == 0
    assert left(isolated) == {"install/a/mine", "install/.forge_files/a.json"}


def test_files_behind_links_are_kept(forge: Forge, workspace: Path) -> None:
    merged = (workspace / "install/share/a").is_dir()
    share = workspace / ("install" if merged else "install/a") / "share"
    write_files(workspace, {"precious/keep": ""})
    shutil.copytree(share / "a", workspace / "precious/a")
    shutil.rmtree(share / "a")
    (share / "a").symlink_to(workspace / "precious/a")
    before = sorted((workspace / "precious").rglob("*"))
    assert forge("clean", "workspace", "-y", cwd=workspace).code == 0
    assert sorted((workspace / "precious").rglob("*")) == before
    assert (share / "a").is_symlink()


def test_a_log_folder_without_runs_is_kept(forge: Forge, isolated: Path) -> None:
    mine = ("log/run_2024-01-01_00-00-00/x.log", "log/latest_notes")
    write_files(isolated, dict.fromkeys(mine, ""))
    assert forge("clean", "workspace", "-y", cwd=isolated).code == 0
    assert all((isolated / name).is_file() for name in mine)


def test_only_exact_file_names_are_recognized_as_forge_files(forge: Forge, isolated: Path) -> None:
    mine = ("install/setup.py", "install/local_setup.md", "build/forge_notes.txt", "build/.forge_x/y")
    write_files(isolated, dict.fromkeys(mine, ""))
    assert forge("clean", "workspace", "-y", cwd=isolated).code == 0
    assert left(isolated) == set(mine)


@pytest.mark.needs("cmake", "ninja")
@pytest.mark.parametrize(
    ("shared", "merged", "earlier"),
    [
        (("install",), (), False),
        (("build", "install"), ("--merge-install",), False),
        (("build", "install"), (), True),
        (("install",), ("--merge-install",), True),
    ],
    ids=["install", "merged", "earlier version", "merged, earlier version"],
)
def test_packages_of_another_workspace_in_shared_folders_are_not_stale(
    forge: Forge, tree: Tree, shared: tuple[str, ...], merged: tuple[str, ...], *, earlier: bool
) -> None:
    root = tree(
        {f"{ws}/{name}": text for ws in ("one", "two") for name, text in cmake_package(f"p_{ws}").items()}
        | {f"two/{name}": text for name, text in cmake_package("gone").items()}
    )
    words = [word for base in shared for word in (f"--{base}-base", str(root / f"shared/{base}"))]
    for ws in ("one", "two"):
        assert forge("build", *words, *merged, cwd=root / ws).code == 0
    for path in (root / "shared/install/.forge_files").iterdir() if earlier else ():
        path.write_text(json.dumps({**json.loads(path.read_text()), "workspace": ""}))
    shutil.rmtree(root / "two/src/gone")
    prefixes = [root / "shared/install" / ("" if merged else name) for name in ("p_one", "p_two", "gone")]
    marks = [
        p / "share" / n / "package.dsv" for p, n in zip(prefixes, ("p_one", "p_two", "gone"), strict=True)
    ]
    for ws in ("one", "two"):
        ran = forge("clean", "stale", "-y", *words, cwd=root / ws)
        assert ran.code == 0
        others = "'gone', 'p_two'" if ws == "one" else "'p_one'"
        assert f"another workspace built it: {others}\n" in ran.err
        assert [path.is_file() for path in marks] == [True, True, ws == "one"]
    ran = forge("clean", "workspace", "-y", *words, cwd=root / "one")
    assert (ran.code, "another workspace built it: 'p_two'\n" in ran.err) == (0, True)
    assert [path.is_file() for path in marks] == [False, True, False]
    assert "1 package unchanged" in forge("build", *words, *merged, cwd=root / "two").out
    assert forge("clean", "workspace", "-y", *words, cwd=root / "two").code == 0
    assert [path for path in (root / "shared").rglob("*") if not path.is_dir()] == []


@pytest.mark.needs("cmake", "ninja")
def test_packages_excluded_by_options_are_not_stale(forge: Forge, built: Tree) -> None:
    root = built({**cmake_package("a"), **cmake_package("b")})
    assert forge("clean", "stale", "-y", "--base-paths", "src/a", cwd=root).code == 0
    assert (root / "install/b/share/b/package.dsv").is_file()


@pytest.mark.needs("cmake", "ninja")
def test_a_file_next_to_package_marks_is_not_a_package(forge: Forge, tree: Tree) -> None:
    mine = "install/share/colcon-core/packages/notes"
    root = tree(cmake_package("a"))
    assert forge("build", "--merge-install", cwd=root).code == 0
    tree({mine: "mine"})
    assert forge("clean", "workspace", "-y", cwd=root).code == 0
    assert left(root) == {mine}


@pytest.mark.needs("cmake", "ninja")
def test_stale_packages_are_recognized_after_a_move(forge: Forge, tree: Tree) -> None:
    root = tree({f"one/{name}": text for name, text in cmake_package("a").items()} | {"one/src/x": ""})
    assert forge("build", cwd=root / "one").code == 0
    shutil.copytree(root / "one", root / "two")
    shutil.rmtree(root / "two/src/a")
    assert forge("clean", "stale", "-y", cwd=root / "two").code == 0
    assert not (root / "two/install/a").exists()


MOUNT = ("unshare", "--user", "--map-root-user", "--mount")


@pytest.mark.needs("cmake", "ninja")
@pytest.mark.parametrize("base", ["build", "install", "log", "build/a", "install/a"])
def test_a_mounted_folder_is_emptied(tree: Tree, base: str) -> None:
    """As a container has volumes; what is mounted in a package's folder is not touched."""
    if shutil.which("unshare") is None or subprocess.run((*MOUNT, "true"), check=False).returncode:
        pytest.skip("no mounts in a namespace on this machine")
    root = tree({**cmake_package("a"), "volume/lost+found/x": ""})
    script = f"""set -e
mkdir -p {base}
rm -r volume/lost+found
test {base} = build/a -o {base} = install/a && {sys.executable} -m forge build
mount --bind volume {base}
test {base} = build/a -o {base} = install/a && echo mine > {base}/mine || {sys.executable} -m forge build
{sys.executable} -m forge clean workspace -y
{sys.executable} -m forge clean workspace -y
"""
    ran = subprocess.run((*MOUNT, "sh", "-c", script), cwd=root, check=False, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert f": {base}{'/mine' if base == 'install/a' else ''}\n" in ran.stderr
    assert [path.name for path in (root / "volume").iterdir()] == (["mine"] if "/" in base else [])
