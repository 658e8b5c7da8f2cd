from dataclasses import replace
from pathlib import Path

import pytest

from forge.base.errors import WorkspaceError
from forge.base.layout import Layout
from forge.build.folder_marks import create_output_folders
from forge.build.installation import finish_workspace, install_package
from forge.environment.install_state import recorded_underlays
from tests.conftest import Tree
from tests.installs import PYTHON, Made, make_install
from tests.packages import manifest_text, package

LIBRARY = Made("library", ("base",), files={"lib/liblibrary.so": "", "bin/tool": ""})
INDEX = "share/ament_index/resource_index/packages"


def layout_in(base: Path, *, merged: bool = False, symlink: bool = False) -> Layout:
    return Layout(base / "build", base / "install", None, merged, symlink)


# --- begin_workspace


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
def test_an_unsuitable_install_folder_gives_one_error(
    before: dict[str, str], asked: str, message: str, tree: Tree
) -> None:
    """With the folder, what is wrong and how to mend it."""
    root = tree(before)
    with pytest.raises(WorkspaceError) as caught:
        create_output_folders(layout_in(root, merged=asked == "merged"))
    assert str(caught.value) == message.replace("W", str(root), 1)


def test_a_folder_that_cannot_be_created_gives_one_error() -> None:
    """Not even root makes folders in /proc."""
    with pytest.raises(WorkspaceError) as caught:
        create_output_folders(layout_in(Path("/proc/forge")))
    assert [problem.message for problem in caught.value.problems] == [
        "cannot create '/proc/forge': No such file or directory"
    ]


# --- install_package


def test_hooks_installed_by_the_package_are_kept(tmp_path: Path) -> None:
    """Only those listed in colcon.pkg take effect."""
    layout = make_install(tmp_path, [LIBRARY])
    prefix = layout.prefix("library")
    hook = prefix / "share/library/hook/own.dsv"
    hook.write_text("set;LIBRARY_HOME;share\n")
    install_package(replace(package("library"), hooks=("share/library/hook/own.dsv",)), layout, (), PYTHON)
    assert hook.is_file()
    assert "source;share/library/hook/own.dsv" in (prefix / "share/library/package.dsv").read_text()
    install_package(package("library"), layout, (), PYTHON)
    assert hook.is_file()
    assert "hook/own.dsv" not in (prefix / "share/library/package.dsv").read_text()


@pytest.mark.parametrize("symlink", [False, True])
def test_python_packages_get_files_that_setup_py_does_not_install(symlink: bool, tmp_path: Path) -> None:
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


# --- finish_workspace


def test_recorded_underlays_are_kept_if_not_sourced(tmp_path: Path) -> None:
    """What a workspace was built on does not depend on the terminal of the day."""
    low, high, other = (tmp_path / name for name in ("low", "high", "other"))
    layout = make_install(tmp_path, [], underlays=(low, high))
    assert finish_workspace(layout, (), PYTHON.path) == (low, high)
    assert finish_workspace(layout, (high,), PYTHON.path) == (low, high)
    assert finish_workspace(layout, (other,), PYTHON.path) == (low, high, other)
    assert finish_workspace(layout, (other, high, low), PYTHON.path) == (other, high, low)
    assert recorded_underlays(layout.install) == (other, high, low)


@pytest.mark.parametrize("text", ["", "{", "[]", "{}"])
def test_a_damaged_state_is_rebuilt_from_the_setup_script(tmp_path: Path, text: str) -> None:
    low, high = tmp_path / "l o$w", tmp_path / "high"
    layout = make_install(tmp_path, [], underlays=(low, high))
    state = layout.install / ".forge.json"
    whole = state.read_text()
    state.write_text(text)
    assert recorded_underlays(layout.install) == (low, high)
    assert finish_workspace(layout, (), PYTHON.path) == (low, high)
    assert state.read_text() == whole
