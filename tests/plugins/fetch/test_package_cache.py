"""`forge build --cache` on the packages of ROS."""

import json
import shutil
from pathlib import Path

import pytest

from tests.conftest import Forge
from tests.plugins.fetch.ros import Ros, depends
from tests.plugins.fetch.test_underlay import LIBRARY, new_workspace

pytestmark = pytest.mark.needs("cmake", "git")


def steps_of_underlay(home: Path) -> list[str]:
    """Return the steps that ran for the packages of ROS in the cache of a user."""
    logs = home.glob("forge/ros/underlays/*/log/build_*/events.jsonl")
    events = [json.loads(line) for path in logs for line in path.read_text().splitlines()]
    assert events
    return [f"{each['package']}: {each['step']}" for each in events if each["event"] == "StepStarted"]


def test_another_user_restores_the_underlay_from_the_package_cache(
    ros: Ros, forge: Forge, tmp_path: Path
) -> None:
    ros.release("rclmini", *depends("lib_vendor"), cmake=LIBRARY)
    ros.commit("rclmini-release", {"lib.c": "int f(void) { return 1; }\n"}, "release/humble/rclmini/1.0.0-1")
    env, store = ros.variables(), tmp_path / "store"

    def steps_of(user: str, name: str = "ws") -> list[str]:
        workspace = new_workspace(tmp_path / user / name)
        env["XDG_CACHE_HOME"] = str(tmp_path / user / "cache")
        assert forge("fetch", cwd=workspace, env=env).code == 0
        ran = forge("build", "--cache", str(store), cwd=workspace, env=env)
        assert (ran.code, "built 2 packages of ROS" in ran.err) == (0, True), ran.err
        return steps_of_underlay(tmp_path / user / "cache")

    assert "rclmini: build" in steps_of("ann")
    shutil.rmtree(tmp_path / "ann/cache")
    assert steps_of("ann", "ws2") == [], "at the same path, as in containers, nothing is built"
    assert "rclmini: build" in steps_of("servers/of/the/team/ci")
    # A result holds for any path once two builds at different ones agree.
    assert not [step for step in steps_of("homes/bo") if step.startswith("rclmini")]
