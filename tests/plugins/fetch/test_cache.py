"""`forge cache` on what `forge fetch` and `forge build` keep for all workspaces."""

import fcntl
import os
import re
import shutil
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from forge.plugins.fetch.underlay import lock_path
from tests.conftest import Forge, Ran
from tests.packages import write_files
from tests.plugins.fetch.ros import Ros
from tests.plugins.fetch.test_underlay import new_workspace, underlay

pytestmark = pytest.mark.needs("cmake", "git")

DAYS = 86400


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of all tests, which each test finds as the first one."""
    return tmp_path_factory.mktemp("home")


@pytest.fixture
def tmp_path(home: Path) -> Path:
    """Return the folder that the workspace is built in."""
    return home / "now"


@pytest.fixture
def env(released: Ros, home: Path, tmp_path: Path, forge: Forge) -> dict[str, str]:
    """Restore a workspace that is built on the small distribution, once; return the variables."""
    shutil.rmtree(tmp_path, ignore_errors=True)
    ros, workspace = replace(released, root=tmp_path / "ros"), tmp_path / "ws"
    if (home / "built").exists():
        shutil.copytree(home / "built", tmp_path, symlinks=True)
        return ros.variables()
    shutil.copytree(released.root, ros.root)
    variables = ros.variables()
    assert forge("fetch", cwd=new_workspace(workspace), env=variables).code == 0
    assert forge("build", cwd=workspace, env=variables).code == 0
    shutil.copytree(tmp_path, home / "built", symlinks=True)
    return variables


def age(tmp_path: Path, days: int, *kinds: str) -> None:
    """Let entries look as if they were last used some days ago."""
    cache, then = tmp_path / "ros/user cache/forge/ros", time.time() - days * DAYS
    patterns = {"sources": "sources/*/*-*", "clones": "clones/*.git", "underlays": "underlays/*/built.json"}
    for kind in kinds or patterns:
        for path in cache.glob(patterns[kind]):
            os.utime(path, (then, then))


def listed(forge: Forge, env: dict[str, str]) -> list[str]:
    ran = forge("cache", "list", env=env)
    assert (ran.code, ran.err) == (0, "")
    return [" ".join(line.split()[:2]) for line in ran.out.splitlines()]


def prune(forge: Forge, env: dict[str, str], *words: str) -> Ran:
    ran = forge("cache", "prune", *words, env=env)
    assert (ran.code, ran.err) == (0, "")
    return ran


SOURCES = ["lib_vendor", "rclmini", "rmw_cyclonedds_cpp", "rmw_implementation"]


def test_underlays_sources_and_clones_are_listed_with_size_and_last_use(
    env: dict[str, str], forge: Forge, tmp_path: Path
) -> None:
    age(tmp_path, 3)
    ran = forge("cache", "list", env=env)
    kinds = [line.split()[0] for line in ran.out.splitlines()]
    assert kinds == ["underlay", "source", "source", "source", "source", "clone"]
    line = next(line for line in ran.out.splitlines() if "rclmini" in line)
    assert "rclmini 1.0.0-1" in line
    assert "3 days ago" in line
    assert "bytes" in line
    assert "https://example.invalid/lib.git" in ran.out
    stats = forge("cache", "stats", env=env)
    assert "in 1 underlay, 4 sources, 1 clone" in stats.out


def test_unused_entries_are_pruned(env: dict[str, str], forge: Forge, tmp_path: Path) -> None:
    age(tmp_path, 10)
    ran = prune(forge, env, "--unused-for", "20")
    assert "ros: removed 0 bytes in 0 of 6" in ran.out
    ran = prune(forge, env, "--unused-for", "5")
    assert "removed source rclmini 1.0.0-1" in ran.out
    assert listed(forge, env) == []
    sources = tmp_path / "ros/user cache/forge/ros/sources"
    assert [path for path in sources.rglob("*") if not path.is_dir()] == []


def test_underlays_are_pruned_before_their_sources_and_rebuilt(
    env: dict[str, str], forge: Forge, tmp_path: Path
) -> None:
    age(tmp_path, 10, "sources", "underlays")
    ran = prune(forge, env, "--size", "30K")
    assert "removed underlay humble-" in ran.out
    assert [line.split()[1] for line in listed(forge, env) if line.startswith("source ")] == SOURCES
    ran = forge("build", cwd=tmp_path / "ws", env=env)
    assert ran.code == 0
    assert "built 4 packages of ROS humble" in ran.err


def test_sources_of_an_underlay_in_use_are_kept(env: dict[str, str], forge: Forge, tmp_path: Path) -> None:
    age(tmp_path, 10)
    with lock_path(underlay(tmp_path)).open("a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        prune(forge, env, "--size", "0")
    kept = listed(forge, env)
    assert [line.split()[1] for line in kept if line.startswith("source ")] == SOURCES
    assert [line for line in kept if line.startswith(("underlay", "clone"))] == [
        f"underlay {underlay(tmp_path).name}"
    ]


def test_entries_that_a_build_may_be_using_are_kept(env: dict[str, str], forge: Forge) -> None:
    before = listed(forge, env)
    prune(forge, env, "--size", "0")
    assert listed(forge, env) == before


def test_builds_count_as_use(env: dict[str, str], forge: Forge, tmp_path: Path) -> None:
    age(tmp_path, 10)
    assert forge("build", cwd=tmp_path / "ws", env=env).code == 0
    prune(forge, env, "--unused-for", "5")
    assert [line.split()[0] for line in listed(forge, env)] == ["underlay", *["source"] * 4]


def test_unmarked_folders_are_neither_listed_nor_removed(
    env: dict[str, str], forge: Forge, tmp_path: Path
) -> None:
    cache = tmp_path / "ros/user cache/forge/ros"
    mine = [
        "sources/mine/1.0-0123456789ab/package.xml",
        "clones/0123456789abcdef0123456789abcdef01234567.git/HEAD",
        "underlays/humble-0123456789abcdef/forge.toml",
        "notes.txt",
    ]
    write_files(cache, dict.fromkeys(mine, "mine\n"))
    for path in cache.rglob("*"):
        os.utime(path, (0, 0), follow_symlinks=False)
    prune(forge, env, "--size", "0", "--unused-for", "0")
    assert listed(forge, env) == []
    assert [name for name in mine if (cache / name).read_text() == "mine\n"] == mine


def test_the_package_cache_does_not_list_ros_sources(
    env: dict[str, str], forge: Forge, tmp_path: Path
) -> None:
    age(tmp_path, 10)
    before = listed(forge, env)
    assert "ros" not in prune(forge, env, "--size", "0", "--cache", str(tmp_path / "packages")).out
    assert listed(forge, env) == before


def test_changed_source_files_are_detected(env: dict[str, str], forge: Forge, tmp_path: Path) -> None:
    assert forge("cache", "verify", env=env).code == 0
    (folder,) = (tmp_path / "ros/user cache/forge/ros/sources/rclmini").glob("*-*/")
    lists, new = folder / "CMakeLists.txt", folder / "new.txt"
    changes: dict[Path, tuple[Callable[[], object], ...]] = {
        lists: (lambda: lists.write_text("# mine\n"), lists.unlink, lambda: lists.chmod(0o755)),
        new: (lambda: new.write_text("mine\n"),),
    }
    for file, change in ((file, change) for file, each in changes.items() for change in each):
        change()
        ran = forge("cache", "verify", env=env)
        assert ran.code == 1
        assert re.search(r"^ros: 1 of [1-9]\d* entries have faults$", ran.out, re.MULTILINE)
        message = f"{folder}: '{file.name}' changed after the download; remove the folder to get it again"
        assert message in ran.out
        assert folder.is_dir(), "it may be the work of somebody"
        shutil.rmtree(folder)
        assert forge("fetch", cwd=tmp_path / "ws", env=env).code == 0
    assert forge("cache", "verify", env=env).code == 0


def test_damaged_clones_and_missing_sources_are_detected(
    env: dict[str, str], forge: Forge, tmp_path: Path
) -> None:
    cache = tmp_path / "ros/user cache/forge/ros"
    (clone,) = cache.glob("clones/*.git")
    for packed in [path for path in clone.glob("objects/**/*") if path.is_file()]:
        packed.chmod(0o644)
        packed.write_bytes(b"damaged")
    shutil.rmtree(cache / "sources/rclmini")
    ran = forge("cache", "verify", env=env)
    assert ran.code == 1
    assert f"{clone}: " in ran.out
    assert f"{underlay(tmp_path)}: the sources of 'rclmini' no longer exist" in ran.out
