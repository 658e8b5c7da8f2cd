"""System packages that `forge fetch` names, and those that come from PyPI."""

import hashlib
import pickle
from pathlib import Path

import pytest

from tests.conftest import Forge
from tests.packages import write_files
from tests.plugins.fetch import test_fetch, test_python
from tests.plugins.fetch.ros import Ros, depends
from tests.plugins.fetch.wheels import Index

pytestmark = pytest.mark.needs("cmake", "git")


def test_the_plan_names_system_packages_and_downloads(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    archive = "https://example.invalid/archive.tar.gz"
    cmake = f"if(FALSE)\nfile(DOWNLOAD {archive} here)\nendif()"
    ros.release("rclmini", *depends("rmw_implementation", "lib_vendor"), cmake=cmake, version="1.2.0")
    ran = forge("fetch", cwd=test_fetch.new_workspace(tmp_path / "ws"), env=ros.variables())
    assert ran.code == 0
    assert ran.err == f"warning: 'rclmini' downloads {archive} while it is built\n"
    assert "libacl1-dev" in ran.out


def test_rosdep_keys_are_found_on_pypi(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    ros.release("rclmini", *depends("rmw_implementation", "lib_vendor", "python3-dev", "python3-lark-parser"))
    uv = test_python.filled(Index(tmp_path / "index", "uv"))
    rules = {"python3-tiny-pip": {"*": {"pip": {"packages": ["tiny"]}}}, "python3-gi": {"*": ["python3-gi"]}}
    cache, url = tmp_path / "home/rosdep/sources.cache", "file:///rules.yaml"
    name = hashlib.sha1(url.encode()).hexdigest()
    write_files(cache, {"index": f"yaml {url} \n"})
    (cache / f"{name}.pickle").write_bytes(pickle.dumps(rules, 2))
    workspace = test_python.new_workspace(tmp_path / "ws", "", *depends("python3-tiny-pip", "python3-gi"))
    env = {**ros.variables(), **uv.variables(), "ROS_HOME": str(tmp_path / "home")}
    ran = forge("fetch", cwd=workspace, env=env)
    assert ran.code == 0, ran.err
    assert test_fetch.locked(workspace)["pip"] == {"python3-tiny-pip": "tiny"}
    assert test_python.modules(workspace) == {"below": "1.0", "lark": "1.1", "tiny": "1.0"}
    settings = (workspace / ".venv/pyvenv.cfg").read_text()
    assert "include-system-site-packages = true" in settings  # for python3-gi
    # Elsewhere, rosdep's data are missing.
    assert forge("fetch", "--locked", cwd=workspace, env={**env, "ROS_HOME": "/nowhere"}).code == 0
