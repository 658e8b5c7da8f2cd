from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from forge.base.errors import WorkspaceError
from forge.base.layout import Layout
from forge.build.installation import finish_workspace, install_package, uninstall_markers
from forge.build.markers import create_output_folders
from forge.environment.install_state import recorded_underlays
from tests.installs import PYTHON, Made, dsv_package, make_install
from tests.packages import manifest_text, package

if TYPE_CHECKING:
    from tests.conftest import Tree

LIBRARY = Made("library", ("base",), files={"lib/liblibrary.so": "", "bin/tool": ""})
INDEX = "share/ament_index/resource_index/packages"


def layout_in(base: Path, *, merged: bool = False, symlink: bool = False) -> Layout:
    """Return the usual folders below `base`."""
    return Layout(base / "build", base / "install", None, merged, symlink)


def files_below(root: Path) -> set[str]:
    """Return all files below a folder, relative to it."""
    return {path.relative_to(root).as_posix() for path in root.rglob("*") if not path.is_dir()}


# --- begin_workspace


@pytest.mark.parametrize("merged", [False, True])
def test_folders_begin_with_their_markers(merged: bool, tmp_path: Path) -> None:
    """Those that colcon looks for, and says so a second time without touching anything."""
    layout = layout_in(tmp_path, merged=merged)
    create_output_folders(layout)
    create_output_folders(layout)
    assert files_below(tmp_path) == {
        "build/.built_by",
        "build/COLCON_IGNORE",
        "install/.colcon_install_layout",
        "install/COLCON_IGNORE",
    }
    assert (layout.build / ".built_by").read_text() == "colcon\n"
    assert (layout.install / ".colcon_install_layout").read_text() == f"{layout.word}\n"


@pytest.mark.parametrize(
    ("before", "asked", "message"),
    [
        (
            {"install/.colcon_install_layout": "merged\n"},
            "isolated",
            (
                "error: the install folder 'W/install' has the merged layout, not the isolated one\n"
                "hint: add '--merge-install', remove the folder, or choose another with '--install-base'"
            ),
        ),
        (
            {"install/.colcon_install_layout": "isolated"},
            "merged",
            (
                "error: the install folder 'W/install' has the isolated layout, not the merged one\n"
                "hint: remove '--merge-install', remove the folder, or choose another with '--install-base'"
            ),
        ),
        (
            {"install": "a file"},
            "isolated",
            (
                "error: the install folder 'W/install' is a file\n"
                "hint: remove it, or choose another with '--install-base'"
            ),
        ),
        (
            {"build/.built_by": "catkin\n"},
            "isolated",
            (
                "error: the build folder 'W/build' was created by 'catkin'\n"
                "hint: choose another folder with '--build-base'"
            ),
        ),
        (
            {"build": "a file"},
            "isolated",
            (
                "error: cannot create 'W/build': File exists\n"
                "hint: choose other folders with '--build-base' and '--install-base', or make them writable"
            ),
        ),
    ],
)
def test_what_does_not_fit_is_one_message(
    before: dict[str, str], asked: str, message: str, tree: Tree
) -> None:
    """With the folder, what is wrong and how to mend it."""
    root = tree(before)
    with pytest.raises(WorkspaceError) as caught:
        create_output_folders(layout_in(root, merged=asked == "merged"))
    assert str(caught.value) == message.replace("W", str(root), 1)


def test_all_problems_are_reported_together(tree: Tree) -> None:
    """Not the first alone."""
    root = tree({"build": "a file", "install": "a file"})
    with pytest.raises(WorkspaceError) as caught:
        create_output_folders(layout_in(root))
    assert len(caught.value.problems) == 2


def test_a_folder_that_cannot_be_made_is_a_message() -> None:
    """Not even root makes folders in /proc."""
    with pytest.raises(WorkspaceError) as caught:
        create_output_folders(layout_in(Path("/proc/forge")))
    assert [problem.message for problem in caught.value.problems] == [
        "cannot create '/proc/forge': No such file or directory"
    ]


def test_a_folder_that_forge_began_goes_on(tree: Tree) -> None:
    """Some marker of forge's own is as good as colcon's."""
    root = tree({"build/.built_by": "forge"})
    create_output_folders(layout_in(root))
    assert (root / "build/.built_by").read_text() == "colcon\n"


# --- install_package


def test_a_package_gets_hooks_scripts_and_index(tmp_path: Path) -> None:
    """Everything that colcon's readers look for, and nothing else."""
    layout = make_install(tmp_path, [LIBRARY])
    prefix = layout.prefix("library")
    assert files_below(prefix) == {
        "bin/tool",
        "lib/liblibrary.so",
        "share/colcon-core/packages/library",
        "share/library/hook/ld_library_path_lib.dsv",
        "share/library/hook/path.dsv",
        "share/library/package.bash",
        "share/library/package.dsv",
        "share/library/package.fish",
        "share/library/package.sh",
        "share/library/package.xml",
        "share/library/package.zsh",
    }
    assert (prefix / "share/library/package.dsv").read_text() == (
        "source;share/library/hook/ld_library_path_lib.dsv\nsource;share/library/hook/path.dsv\n"
    )
    assert (prefix / "share/library/hook/path.dsv").read_text() == "prepend-non-duplicate;PATH;bin\n"
    assert (prefix / "share/colcon-core/packages/library").read_text() == "base"


def test_needs_are_sorted_and_joined(tmp_path: Path) -> None:
    """As colcon's index has them, without a newline."""
    layout = make_install(tmp_path, [Made("top", ("b", "a", "b"))])
    assert (layout.prefix("top") / "share/colcon-core/packages/top").read_text() == "a:b"


def test_a_package_s_own_setup_is_listed_after_the_hooks(tmp_path: Path) -> None:
    """All its languages, so that readers take the dsv file and shells find theirs."""
    own = {f"share/p/local_setup.{extension}": "" for extension in ("sh", "bash", "zsh")}
    layout = make_install(
        tmp_path, [dsv_package("p", "prepend-non-duplicate;PATH;bin", files={**own, "bin/x": ""})]
    )
    assert (layout.prefix("p") / "share/p/package.dsv").read_text().splitlines() == [
        "source;share/p/hook/path.dsv",
        "source;share/p/local_setup.bash",
        "source;share/p/local_setup.dsv",
        "source;share/p/local_setup.sh",
        "source;share/p/local_setup.zsh",
    ]


def test_hooks_that_nothing_calls_for_go(tmp_path: Path) -> None:
    """A library that a package no longer has is off the path with the next build."""
    layout = make_install(tmp_path, [LIBRARY])
    (layout.prefix("library") / "lib/liblibrary.so").unlink()
    install_package(package("library"), layout, (), PYTHON)
    assert files_below(layout.prefix("library") / "share/library/hook") == {"path.dsv"}


def test_hooks_that_the_package_installs_itself_stay(tmp_path: Path) -> None:
    """They are in the package's install manifest; only those listed in colcon.pkg take effect."""
    layout = make_install(tmp_path, [LIBRARY])
    prefix = layout.prefix("library")
    hook = prefix / "share/library/hook/own.dsv"
    hook.write_text("set;LIBRARY_HOME;share\n")
    build = layout.build_dir("library")
    build.mkdir(parents=True, exist_ok=True)
    (build / "install_manifest.txt").write_text(f"{prefix}/lib/liblibrary.so\n{hook}\n")
    install_package(replace(package("library"), hooks=("share/library/hook/own.dsv",)), layout, (), PYTHON)
    assert hook.is_file()
    assert "source;share/library/hook/own.dsv" in (prefix / "share/library/package.dsv").read_text()
    (build / "install_manifest.txt").unlink()
    install_package(package("library"), layout, (), PYTHON)
    assert not hook.exists()


def test_in_a_merged_tree_a_package_has_the_hooks_of_its_own_files(tmp_path: Path) -> None:
    """What others installed into the shared prefix is theirs."""
    plain = Made("plain", files={"include/plain.h": ""})
    layout = make_install(tmp_path, [LIBRARY, plain], merged=True)
    assert (layout.install / "share/plain/package.dsv").read_text() == ""
    assert "ld_library_path_lib" in (layout.install / "share/library/package.dsv").read_text()


def test_a_caller_may_say_what_was_installed(tmp_path: Path) -> None:
    """The prefix is not searched then."""
    layout = layout_in(tmp_path)
    install_package(package("p"), layout, (), PYTHON, [str(layout.prefix("p") / "bin/tool")])
    assert files_below(layout.prefix("p") / "share/p/hook") == {"path.dsv"}


@pytest.mark.parametrize("symlink", [False, True])
def test_python_packages_get_what_their_setup_forgot(symlink: bool, tmp_path: Path) -> None:
    """The index marker and the manifest, unless they are there."""
    layout = layout_in(tmp_path, symlink=symlink)
    made = package("p", build_type="ament_python")
    source = tmp_path / "src/p/package.xml"
    source.parent.mkdir(parents=True)
    source.write_text(manifest_text("p"))
    made = replace(made, manifest=replace(made.manifest, path=source))
    for _ in range(2):
        install_package(made, layout, (), PYTHON)
    prefix = layout.prefix("p")
    assert (prefix / INDEX / "p").read_bytes() == b""
    assert (prefix / "share/p/package.xml").read_text() == manifest_text("p")
    assert (prefix / "share/p/package.xml").is_symlink() == symlink
    assert (prefix / "share/p/hook/ament_prefix_path.dsv").is_file()


def test_what_makes_a_package_look_installed_goes_before_a_build(tmp_path: Path) -> None:
    """After a failure the package does not count as installed; a second call removes nothing."""
    layout = make_install(tmp_path, [replace(LIBRARY, files={**LIBRARY.files, f"{INDEX}/library": ""})])
    prefix = layout.prefix("library")
    (prefix / INDEX).mkdir(parents=True, exist_ok=True)
    (prefix / INDEX / "library").touch()
    uninstall_markers("library", layout)
    uninstall_markers("library", layout)
    left = files_below(prefix)
    assert not [path for path in left if "package." in path and not path.endswith(".xml")]
    assert not [path for path in left if path.endswith("packages/library")]


# --- finish_workspace


def test_a_workspace_has_scripts_for_every_shell(tmp_path: Path) -> None:
    """And a second build that changes nothing writes nothing."""
    layout = make_install(tmp_path, [LIBRARY])
    scripts = [
        layout.install / f"{name}.{shell}"
        for name in ("setup", "local_setup")
        for shell in ("sh", "bash", "zsh")
    ]
    stamps = [path.stat().st_mtime_ns for path in scripts]
    finish_workspace(layout, (), PYTHON.path)
    assert [path.stat().st_mtime_ns for path in scripts] == stamps
    assert json.loads((layout.install / ".forge.json").read_text()) == {
        "version": 1,
        "python": str(PYTHON.path),
        "underlays": [],
        "rosdistro": None,
    }


def test_underlays_are_kept_when_they_are_not_sourced(tmp_path: Path) -> None:
    """What a workspace was built on does not depend on the terminal of the day."""
    low, high, other = (tmp_path / name for name in ("low", "high", "other"))
    layout = make_install(tmp_path, [], underlays=(low, high))
    assert finish_workspace(layout, (), PYTHON.path) == (low, high)
    assert finish_workspace(layout, (high,), PYTHON.path) == (low, high)
    assert finish_workspace(layout, (other,), PYTHON.path) == (low, high, other)
    assert finish_workspace(layout, (other, high, low), PYTHON.path) == (other, high, low)
    assert recorded_underlays(layout.install) == (other, high, low)


def test_without_a_state_there_are_no_underlays(tmp_path: Path) -> None:
    """A folder that forge has not finished yet."""
    assert recorded_underlays(tmp_path) == ()


@pytest.mark.parametrize("text", ["", "{", "[]", "{}"])
def test_a_damaged_state_is_written_anew_with_the_underlays_of_the_script(tmp_path: Path, text: str) -> None:
    low, high = tmp_path / "l o$w", tmp_path / "high"
    layout = make_install(tmp_path, [], underlays=(low, high))
    state = layout.install / ".forge.json"
    whole = state.read_text()
    state.write_text(text)
    assert recorded_underlays(layout.install) == (low, high)
    assert finish_workspace(layout, (), PYTHON.path) == (low, high)
    assert state.read_text() == whole
