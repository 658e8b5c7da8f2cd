"""Inconsistent underlays: cyclic chains, two paths of one tree, two ROS distributions."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from forge.environment.install_state import recorded_underlays
from forge.environment.prefixes import find_underlays
from tests.conftest import Forge, Ran
from tests.installs import Made, make_install
from tests.packages import manifest_text
from tests.peers import Colcon

pytestmark = pytest.mark.needs("cmake", "bash", "sh")

CMAKE = """cmake_minimum_required(VERSION 3.18)
project({0} NONE)
install(PROGRAMS package.xml DESTINATION bin RENAME {0}_tool)
install(FILES package.xml DESTINATION share/{0})
"""
SHELLS = {"bash": ["bash", "-c"], "sh": ["sh", "-c"], "zsh": ["zsh", "-fc"]}


def workspace(root: Path, name: str, *depends: str) -> Path:
    """Make a workspace with one CMake package."""
    (root / "src").mkdir(parents=True)
    (root / "src/package.xml").write_text(manifest_text(name, *depends, build_type="cmake"))
    (root / "src/CMakeLists.txt").write_text(CMAKE.format(name))
    return root


def sourced(*scripts: Path | str, shell: str = "bash", cwd: Path = Path("/")) -> dict[str, str]:
    """Return the variables of a shell that has sourced the scripts."""
    lines = "".join(f". '{script}' && " for script in scripts)
    bare = {"PATH": os.environ["PATH"], "HOME": os.environ.get("HOME", "/")}
    done = subprocess.run(
        [*SHELLS[shell], f"{lines}env -0"], env=bare, capture_output=True, text=True, check=True, cwd=cwd
    )
    assert done.stderr == ""
    pairs = dict(item.split("=", 1) for item in done.stdout.split("\0") if "=" in item)
    return {name: value for name, value in pairs.items() if name not in {"_", "PWD", "OLDPWD", "SHLVL"}}


def warning(overlay: Path) -> str:
    return f"warning: '{overlay}' was built on this workspace and is not used as its underlay\n"


@pytest.mark.parametrize("shell", ["bash", "sh", pytest.param("zsh", marks=pytest.mark.needs("zsh"))])
@pytest.mark.parametrize("tool", ["forge", pytest.param("colcon", marks=pytest.mark.needs("colcon"))])
def test_an_overlay_never_becomes_an_underlay(shell: str, tool: str, forge: Forge, tmp_path: Path) -> None:
    low, top = workspace(tmp_path / "low", "pa"), workspace(tmp_path / "top", "pb", "<depend>pa</depend>")
    assert forge("build", cwd=low).code == 0
    below = sourced(low / "install/setup.sh")
    if tool == "forge":
        assert forge("build", cwd=top, env=below).code == 0
    else:
        colcon = Colcon({**below, "COLCON_LOG_PATH": "/dev/null"})
        assert colcon("build", cwd=top).code == 0
        colcon.end()
    script = {"bash": "setup.bash", "sh": "setup.sh", "zsh": "setup.zsh"}[shell]
    ran = forge("build", "--explain", cwd=low, env=sourced(top / "install" / script, shell=shell, cwd=top))
    assert ran.err.startswith(warning(top / "install"))
    assert "pa: build" not in ran.out, "nothing that the build reads has changed"
    assert recorded_underlays(low / "install") == ()
    (low / "src/new").touch()
    assert forge("build", cwd=low, env=sourced(top / "install/setup.sh", cwd=top)).code == 0
    assert str(top) not in (low / "install/setup.sh").read_text()
    after = sourced(low / "install" / script, shell=shell)
    assert after["COLCON_PREFIX_PATH"] == str(low / "install")


def test_a_recorded_overlay_is_removed_from_the_underlays(forge: Forge, tmp_path: Path) -> None:
    """An earlier version recorded it; the next build corrects it, even if all packages are up to date."""
    low, top = workspace(tmp_path / "low", "pa"), workspace(tmp_path / "top", "pb", "<depend>pa</depend>")
    assert forge("build", cwd=low).code == 0
    assert forge("build", cwd=top, env=sourced(low / "install/setup.sh")).code == 0
    state = low / "install/.forge.json"
    state.write_text(json.dumps(json.loads(state.read_text()) | {"underlays": [str(top / "install")]}))
    assert forge("build", cwd=low).err == warning(top / "install")
    assert json.loads(state.read_text())["underlays"] == []
    assert forge("build", cwd=low).err == ""


def test_a_cyclic_chain_is_not_an_underlay(forge: Forge, tmp_path: Path) -> None:
    a, b, c = (workspace(tmp_path / name, f"p{name}") for name in "abc")
    other = make_install(tmp_path / "other", [Made("other")]).install
    assert forge("build", cwd=a).code == 0
    assert forge("build", cwd=b, env=sourced(a / "install/setup.sh")).code == 0
    assert forge("build", cwd=c, env=sourced(b / "install/setup.sh", other / "setup.sh")).code == 0
    ran = forge("build", "--force", cwd=a, env=sourced(c / "install/setup.sh"))
    expected = {warning(b / "install").strip(), warning(c / "install").strip()}
    assert {line for line in ran.err.splitlines() if line.startswith("warning")} == expected
    assert recorded_underlays(a / "install") == (other,)


def test_a_copied_workspace_is_not_its_own_underlay(forge: Forge, tmp_path: Path) -> None:
    low, top = workspace(tmp_path / "low", "pa"), workspace(tmp_path / "top", "pb")
    assert forge("build", cwd=low).code == 0
    assert forge("build", cwd=top, env=sourced(low / "install/setup.sh")).code == 0
    shutil.rmtree(low)
    subprocess.run(["cp", "-a", top, low], check=True)
    ran = forge("build", cwd=low)
    assert ran.code == 0
    assert "underlay" not in ran.err
    assert recorded_underlays(low / "install") == ()
    assert forge("build", "--explain", cwd=low).err == ""


@pytest.mark.parametrize("spelling", ["{link}/install", "{root}/src/../install", "{root}//install/"])
def test_the_workspace_is_recognized_through_any_path(spelling: str, forge: Forge, tmp_path: Path) -> None:
    root = workspace(tmp_path / "ws", "pa")
    (tmp_path / "link").symlink_to(root)
    assert forge("build", cwd=root).code == 0
    folder = spelling.format(root=root, link=tmp_path / "link")
    before = sourced(root / "install/setup.sh")
    variables = {name: value.replace(str(root / "install"), folder) for name, value in before.items()}
    variables |= {"PYTHONPATH": f"{folder}/pa/lib/python"}
    ran = forge("build", "--explain", cwd=root, env=variables)
    assert (ran.code, ran.err) == (0, "")
    assert "pa: build" not in ran.out
    assert recorded_underlays(root / "install") == ()


def test_an_underlay_with_two_paths_counts_once(forge: Forge, tmp_path: Path) -> None:
    below = make_install(tmp_path / "below", [Made("base")]).install
    (tmp_path / "link").symlink_to(below)
    variables = {"COLCON_PREFIX_PATH": f"{below}:{tmp_path / 'link'}:{below}/:{below.parent}/x/../install"}
    (below.parent / "x").mkdir()
    assert find_underlays(variables, tmp_path / "install").chain == (below,)
    root = workspace(tmp_path / "ws", "pa")
    assert forge("build", cwd=root, env=variables).code == 0
    assert forge("build", "--force", cwd=root, env={"COLCON_PREFIX_PATH": str(tmp_path / "link")}).code == 0
    assert len(recorded_underlays(root / "install")) == 1


def build_on(
    forge: Forge, tmp_path: Path, recorded: str | None, files: dict[str, str], **env: str
) -> tuple[Path, Ran]:
    below = make_install(tmp_path / "below", [Made("ros_environment", files=files)], merged=True).install
    state = below / ".forge.json"
    state.write_text(json.dumps(json.loads(state.read_text()) | {"rosdistro": recorded}))
    root = workspace(tmp_path / "ws", "pa")
    return below, forge("build", cwd=root, env={"COLCON_PREFIX_PATH": str(below), **env})


@pytest.mark.parametrize("where", ["record", "dsv", "sh"])
def test_mixing_distributions_in_a_chain_gives_a_warning(where: str, forge: Forge, tmp_path: Path) -> None:
    """The distribution of an underlay is the one that its build recorded, or that it sets when sourced."""
    hook = "share/ros_environment/environment/1.ros_distro"
    files = {
        "record": {},
        "dsv": {f"{hook}.dsv": "set;ROS_DISTRO;humble\n"},
        "sh": {f"{hook}.sh": "# generated\n\nexport ROS_DISTRO=humble\n"},
    }[where]
    recorded = "humble" if where == "record" else None
    below, ran = build_on(forge, tmp_path, recorded, files, ROS_DISTRO="jazzy")
    assert ran.code == 0
    assert ran.err == (
        f"warning: the underlay '{below}' is for ROS 'humble', but this build is for 'jazzy'\n"
        "hint: in a new terminal, source only underlays of one distribution, or pass '--rosdistro humble'\n"
    )
    same = {"COLCON_PREFIX_PATH": str(below), "ROS_DISTRO": "humble"}
    assert "warning" not in forge("build", cwd=tmp_path / "ws", env=same).err


def test_doctor_reports_overlays_and_other_distributions(forge: Forge, tmp_path: Path) -> None:
    low, top = workspace(tmp_path / "low", "pa"), workspace(tmp_path / "top", "pb", "<depend>pa</depend>")
    other = make_install(tmp_path / "other", [Made("other")]).install
    assert forge("build", cwd=low).code == 0
    assert forge("build", cwd=top, env=sourced(low / "install/setup.sh")).code == 0
    state = other / ".forge.json"
    state.write_text(json.dumps(json.loads(state.read_text()) | {"rosdistro": "humble"}))
    variables = sourced(other / "setup.sh", top / "install/setup.sh") | {"ROS_DISTRO": "jazzy"}
    said = forge("doctor", cwd=low, env=variables).out
    assert f"'{top / 'install'}' was built on this workspace and is not used as its underlay" in said
    assert f"the underlay '{other}' is for ROS 'humble', but this build is for 'jazzy'" in said
    assert str(top) not in forge("info", cwd=low, env=variables).out
