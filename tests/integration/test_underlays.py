"""Missing underlays, and packages that are also in an underlay."""

import shutil
from pathlib import Path

import pytest

from forge.base.distributions import EMBEDDED
from forge.environment.install_state import recorded_underlays
from tests.conftest import Forge, Tree
from tests.installs import Made, make_install
from tests.packages import manifest_text, write_files
from tests.testable import cmake_package

LOST = (
    "warning: the underlay '{}' no longer exists: packages built on it may not run\n"
    "hint: restore it, or pass '--reset-underlays' to forget it\n"
)


@pytest.mark.parametrize("ours", [True, False])
def test_embedded_interfaces_use_embedded_generators_of_an_underlay(
    ours: bool,
    forge: Forge,
    tree: Tree,
    tmp_path: Path,
) -> None:
    """An underlay that was built without ROS has only the interfaces that its packages need."""
    name = "rosidl_default_generators"
    text = (EMBEDDED / name / "package.xml").read_text() if ours else manifest_text(name)
    core = "rosidl_core_generators"
    files = {f"share/{name}/package.xml": text, f"share/{core}/cmake/{core}Config.cmake": ""}
    made = [Made(name, files=files), Made("builtin_interfaces")]
    below = make_install(tmp_path / "below", made).install
    depends = f"<depend>{name}</depend><depend>std_msgs</depend>"
    root = tree({"ws/src/a/package.xml": manifest_text("a", depends)}) / "ws"
    listed = forge("list", "--embedded", "-n", cwd=root, env={"COLCON_PREFIX_PATH": str(below)}).out.split()
    assert ("std_msgs" in listed) == ours
    assert not {name, "builtin_interfaces"} & set(listed)


@pytest.mark.needs("cmake")
def test_a_different_spelling_of_prefixes_causes_no_rebuild(forge: Forge, tree: Tree) -> None:
    root = tree(
        {
            "ws/src/a/package.xml": manifest_text("a", build_type="cmake"),
            "ws/src/a/CMakeLists.txt": "cmake_minimum_required(VERSION 3.18)\nproject(a NONE)\n",
            "below/share/x": "",
            "other/share/x": "",
        }
    )
    below, other = f"{root}/below", f"{root}/other"

    def build(path: str) -> str:
        env = {"AMENT_PREFIX_PATH": path, "CMAKE_PREFIX_PATH": path}
        return forge("build", cwd=root / "ws", env=env).out

    assert "Finished <<< a" in build(f"{below}:{other}")
    for path in (f"{below}/:{other}//", f":{below}::{other}:", f"{root}/./below:{other}:{below}"):
        assert "0 packages finished, 1 package unchanged" in build(path)
    assert "Finished <<< a" in build(f"{other}:{below}")


def test_missing_underlays_are_reported_and_can_be_reset(forge: Forge, tmp_path: Path) -> None:
    below = make_install(tmp_path / "below", [Made("base"), Made("user", ("base",))]).install
    root = write_files(tmp_path / "ws", cmake_package("base"))
    sourced = {"COLCON_PREFIX_PATH": str(below)}
    told = forge("build", cwd=root, env=sourced).err
    assert told.startswith(
        f"warning: 'base' overrides the package in '{below}', on which 'user' there depend\n"
    )
    assert forge("build", cwd=root, env=sourced).err == ""
    assert recorded_underlays(root / "install") == (below,)
    shutil.rmtree(below)
    lost = LOST.replace("{}", str(below))
    rebuilt = "packages were added to or removed from an underlay; 1 package is rebuilt\n"
    assert forge("build", cwd=root).err == lost + rebuilt
    assert forge("build", cwd=root, env=sourced).err == lost
    assert forge("build", "--dry-run", "--reset-underlays", cwd=root).err == lost
    assert forge("build", "--reset-underlays", cwd=root).err == ""
    assert recorded_underlays(root / "install") == ()
    assert str(below) not in (root / "install/setup.bash").read_text()
    assert forge("build", cwd=root).err == ""


def test_installed_files_of_removed_packages_are_reported(forge: Forge, built: Tree) -> None:
    root = built({**cmake_package("a"), **cmake_package("b")})
    (root / "src/a/new").write_text("")
    assert "no longer" not in forge("build", "--base-paths", "src/a", cwd=root).err
    (root / "src/b/COLCON_IGNORE").touch()
    (root / "src/a/newer").write_text("")
    said = forge("build", cwd=root).err
    assert f"warning: 'b' is no longer in the workspace, but its files are still in '{root}/install'" in said
    assert "hint: remove them: forge clean stale" in said
    assert "no longer" in forge("build", cwd=root).err, "also if nothing is built"
    assert forge("clean", "stale", "--yes", cwd=root).code == 0
    (root / "src/a/newest").write_text("")
    assert "no longer" not in forge("build", cwd=root).err
