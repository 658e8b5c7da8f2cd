"""Downloads of `forge fetch` from a git server that fails, stalls, or is gone; kills and full disks."""

import os
import re
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from forge.toolchain.interpreter import own_command
from tests.conftest import Forge
from tests.e2e.test_faults import grown, small_disk
from tests.plugins.fetch.ros import Ros, depends
from tests.plugins.fetch.server import GitServer, git_server
from tests.plugins.fetch.test_fetch import NEEDED, locked, new_workspace

pytestmark = pytest.mark.needs("git")


@pytest.fixture
def server(ros: Ros) -> Iterator[GitServer]:
    with git_server(ros.root / "repositories") as server:
        yield server


def sources(ros: Ros, *, drafts: bool = False) -> list[str]:
    """Return the names of the downloaded packages; fails if there is anything else but `drafts`."""
    found = [path for path in (ros.root / "user cache/forge/ros/sources").glob("*/*") if path.is_dir()]
    complete = [path for path in found if not path.name.startswith(".")]
    assert drafts or found == complete
    return sorted(path.parent.name for path in complete)


def start(*argv: str, cwd: Path, env: dict[str, str]) -> subprocess.Popen[str]:
    command = own_command(*argv)
    pipe = subprocess.PIPE
    return subprocess.Popen(
        command,
        cwd=cwd,
        env={**os.environ, **env},
        stdout=pipe,
        stderr=pipe,
        text=True,
        start_new_session=True,
    )


def test_network_errors_are_retried(ros: Ros, server: GitServer, forge: Forge, tmp_path: Path) -> None:
    server.failures = 2
    workspace = new_workspace(tmp_path / "ws")
    ran = forge("fetch", cwd=workspace, env=ros.variables(server.url))
    assert (ran.code, ran.err) == (0, "")
    assert "4 to download\ndownloaded 0.0 MB\n" in ran.out
    assert sources(ros) == NEEDED


def test_requests_for_missing_tags_and_repositories_are_not_retried(
    ros: Ros, server: GitServer, forge: Forge, tmp_path: Path
) -> None:
    ros.release("turtle", version="2.0.0")
    subprocess.run(
        (
            "git",
            "-C",
            ros.root / "repositories/turtle-release.git",
            "tag",
            "-d",
            "release/humble/turtle/2.0.0-1",
        ),
        check=True,
        capture_output=True,
    )
    ran = forge("fetch", "turtle", cwd=new_workspace(tmp_path / "ws"), env=ros.variables(server.url))
    assert ran.code == 2
    assert "has no tag 'release/humble/turtle/2.0.0-1' for 'turtle'" in ran.err
    assert len([path for path in server.requests if path.startswith("/turtle-release.git/info")]) == 1


def test_a_killed_fetch_leaves_no_partial_files(
    ros: Ros, server: GitServer, forge: Forge, tmp_path: Path
) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables(server.url)
    server.stalled = "rclmini-release"
    process = start("fetch", cwd=workspace, env=env)
    assert server.reached.wait(60)
    others = [name for name in NEEDED if name != "rclmini"]
    deadline = time.monotonic() + 30
    while sources(ros, drafts=True) != others:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    assert not (workspace / "forge.lock").exists()
    server.stalled = ""
    server.sent.clear()
    own = ros.root / "user cache/forge/ros/sources"
    left = own / ".import.forge-draft/tree"  # by a killed 'forge fetch --import'
    left.mkdir(parents=True)
    (own / ".git").mkdir()  # by somebody else
    ran = forge("fetch", cwd=workspace, env=env)
    assert ran.code == 0, ran.err
    assert sources(ros) == NEEDED
    assert sorted(server.sent) == ["lib.git", "rclmini-release.git"]
    assert not left.parent.exists()
    assert (own / ".git").is_dir()
    assert [each["name"] for each in locked(workspace)["package"]] == NEEDED


def test_an_interrupted_fetch_keeps_complete_downloads(ros: Ros, server: GitServer, tmp_path: Path) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables(server.url)
    server.stalled = "rclmini-release"
    process = start("fetch", cwd=workspace, env=env)
    assert server.reached.wait(60)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal sends it
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130, err
    assert "Traceback" not in err
    assert "rclmini" not in sources(ros)
    assert not (workspace / "forge.lock").exists()


def test_a_second_fetch_waits_for_the_first(ros: Ros, server: GitServer, tmp_path: Path) -> None:
    env = ros.variables(server.url)
    server.stalled = "rclmini-release"
    first = start("fetch", cwd=new_workspace(tmp_path / "one"), env=env)
    assert server.reached.wait(60)
    server.stalled = ""
    second = start("fetch", cwd=new_workspace(tmp_path / "two"), env=env)
    assert second.stderr is not None
    assert second.stderr.readline() == "waiting for another process that is downloading packages\n"
    threading.Timer(0.5, os.killpg, (first.pid, signal.SIGKILL)).start()
    _, err = second.communicate(timeout=60)
    first.communicate()
    assert (second.returncode, err) == (0, "")
    assert sources(ros) == NEEDED


def test_an_unreachable_server_gives_one_error(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    with git_server(tmp_path) as gone:
        url = gone.url
    workspace = new_workspace(tmp_path / "ws")
    ran = forge("fetch", cwd=workspace, env=ros.variables(url))
    assert ran.code == 2
    assert ran.err.count("error: ") == 1
    assert "check the network" in ran.err


def test_a_full_disk_gives_one_error(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    ros.commit("rclmini-release", {"big.txt": os.urandom(60_000).hex()}, "release/humble/rclmini/1.0.0-1")
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    argv = ("sh", "-c", 'ulimit -f 64; trap "" XFSZ; exec "$@"', "sh", *own_command("fetch"))
    done = subprocess.run(
        argv, cwd=workspace, env={**os.environ, **env}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "cannot download 'rclmini': " in done.stderr
    assert "Traceback" not in done.stderr
    assert sources(ros) == [name for name in NEEDED if name != "rclmini"]
    assert forge("fetch", cwd=workspace, env=env).code == 0


@pytest.mark.parametrize("kilobytes", [900, 1800])
def test_a_full_disk_gives_one_error_and_keeps_complete_downloads(
    kilobytes: int, ros: Ros, forge: Forge, tmp_path: Path
) -> None:
    ros.commit("big-release", {"zeros": "0" * 1_000_000}, "big")
    ros.release("big")
    workspace, disk = new_workspace(tmp_path / "ws", *depends("rclmini", "big")), tmp_path / "disk/cache"
    env = {**ros.variables(), "XDG_CACHE_HOME": str(disk)}
    with small_disk(disk, kilobytes) as mounted:
        if not mounted:
            return
        ran = forge("fetch", cwd=workspace, env=env)
        assert (ran.code, ran.err.count("error: ")) == (2, 1), ran.err
        assert "error: no space left on the disk of forge's cache\nhint: free some space" in ran.err
        assert not (workspace / "forge.lock").exists()
        grown(disk, "size=60m")
        assert forge("fetch", cwd=workspace, env=env).code == 0
        assert sorted(path.name for path in (disk / "forge/ros/sources").iterdir()) == ["big", *NEEDED]


def test_an_unreachable_index_gives_the_plain_reason(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    url = "https://example.invalid/index-v4.yaml"
    ran = forge("fetch", "--index", url, cwd=new_workspace(tmp_path / "ws"), env=ros.variables())
    assert ran.code == 2
    assert re.match(rf"error: cannot read the index of ROS distributions '{url}': [\w -]+\nhint: ", ran.err)
