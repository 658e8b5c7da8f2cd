"""The page of a running build, asked over HTTP as a browser does."""

import http.client
import json
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlsplit

import pytest

from forge.base.errors import WarningReporter
from forge.base.layout import Layout
from forge.build.events import Finished, Skipped, Started, StepStarted
from forge.build.tasks import BuildPlan, Step, StepKind, Task
from forge.output.reporters import Run
from forge.plugins.charts.live import LiveBuild, LiveServer
from tests.browser import Browser
from tests.packages import manifest_text, package

NEEDS = {"base": (), "map": ("base",), "planner": ("base", "map"), "lone": ()}
STEP = Step(StepKind.BUILD, (), Path())
MEMORY: Any = SimpleNamespace(
    now=lambda _: 0, peak=lambda name: (name == "lone") << 60, fits=lambda name, _: name != "lone"
)
"""The memory of packages, of which one has needed more than there is."""


def live_build(tmp_path: Path) -> LiveBuild:
    """Return a build of four packages, one of which needs more memory than there is."""
    tasks = {
        name: Task(name, package(name), tmp_path, tmp_path, needs, (STEP,), "new")
        for name, needs in NEEDS.items()
    }
    run = Run(
        command="build",
        plan=BuildPlan(tasks),
        layout=Layout(tmp_path / "build", tmp_path / "install", None),
        root=tmp_path,
        variables=os.environ,
        python=Path(sys.executable),
        jobs=2,
        warn=WarningReporter(),
        log_folder=None,
        clock=0.0,
        displayed=str,
        seconds={"base": 9.0},
        memory=MEMORY,
    )
    return LiveBuild(run, lambda: {"busy": "1.0", "processors": 2, "used": "3.0", "memory": "8.0 GB"})


@pytest.fixture
def live(tmp_path: Path) -> LiveBuild:
    return live_build(tmp_path)


@pytest.fixture
def server(live: LiveBuild) -> Iterator[LiveServer]:
    server = LiveServer(live, "ws: build")
    try:
        yield server
    finally:
        server.close()


def ask(address: str, path: str = "", method: str = "GET", **headers: str) -> tuple[int, bytes]:
    parts = urlsplit(address)
    connection = http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=10)
    connection.request(method, path if path.startswith("/") else parts.path + path, headers=headers)
    answer = connection.getresponse()
    return answer.status, answer.read()


def state_of(live: LiveBuild) -> dict[str, Any]:
    return json.loads(json.dumps(live.state()))  # type: ignore[no-any-return]


def test_waiting_packages_name_the_packages_they_wait_for(live: LiveBuild) -> None:
    live.show(Started("base"))
    live.show(StepStarted("base", STEP))
    state = state_of(live)
    (running,) = state["running"]
    assert (running["name"], running["step"], running["last"]) == ("base", "build", "9.00s")
    assert running["users"] == 1  # the planner waits for the map
    assert {each["name"]: each["needs"] for each in state["waiting"]} == {
        "map": [{"name": "base", "running": True}],
        "planner": [{"name": "map", "running": False}],
        "lone": [],
    }
    (lone,) = (each for each in state["waiting"] if each["name"] == "lone")
    assert lone["reason"].startswith("memory: it used ")
    live.show(Finished("base", 0, 1.0))
    assert {each["name"]: each["reason"] for each in state_of(live)["waiting"]} == {
        **{"map": "a free job", "planner": "", "lone": "a free job"},
    }
    live.show(Finished("map", 1, 1.0))
    live.show(Skipped("planner", "map"))
    state = state_of(live)
    assert (state["done"], state["total"]) == (3, 4)
    assert [(each["name"], each["outcome"], each["words"]) for each in state["ended_packages"]] == [
        *(("planner", "skipped", "map"), ("map", "failed", "1.00s"), ("base", "finished", "1.00s")),
    ]


def test_requests_without_the_token_are_rejected(server: LiveServer) -> None:
    token = urlsplit(server.address).path.strip("/")
    assert len(token) >= 32
    status, page = ask(server.address)
    assert (status, b"<!doctype html>" in page) == (200, True)
    assert token.encode() not in page
    assert b"http" not in page.replace(b"http-equiv", b"")  # nothing from elsewhere
    status, state = ask(server.address, "state")
    assert (status, json.loads(state)["total"]) == (200, 4)
    for path in ("/", "/state", f"/{token}", f"/{token}x/", f"/{token[:-1]}/", f"/{token}/../", "/%00"):
        assert ask(server.address, path) == (404, b"")
    assert ask(server.address, Host="attacker.example:80") == (404, b"")
    assert ask(server.address, method="POST")[0] == 501


def test_the_server_listens_on_this_machine_only(server: LiveServer) -> None:
    assert urlsplit(server.address).hostname == "127.0.0.1"
    assert server._server.socket.getsockname()[0] == "127.0.0.1"


def test_every_build_has_its_own_address(server: LiveServer, tmp_path: Path) -> None:
    other = LiveServer(live_build(tmp_path), "x")
    other.close()
    assert urlsplit(other.address).path != urlsplit(server.address).path


def test_requests_are_answered_at_the_next_event_and_at_the_end(live: LiveBuild, server: LiveServer) -> None:
    version = json.loads(ask(server.address, "state")[1])["version"]
    answers: list[dict[str, Any]] = []
    seen = threading.Event()

    def follow() -> None:
        at = version
        while not answers or not answers[-1]["ended"]:
            answers.append(json.loads(ask(server.address, f"state?{at}")[1]))
            at = answers[-1]["version"]
            if answers[-1]["running"]:
                seen.set()

    thread = threading.Thread(target=follow)
    thread.start()
    live.show(Started("lone"))
    assert seen.wait(10)
    server.close()
    thread.join(10)
    assert not thread.is_alive()
    assert [each["name"] for each in answers[-1]["running"]] == ["lone"]
    with pytest.raises(OSError, match=r"refused|reset"):
        ask(server.address)


@pytest.mark.needs("chromium", "chromedriver")
def test_the_page_follows_the_build_until_its_end(
    browser: Browser, live: LiveBuild, server: LiveServer
) -> None:
    live.show(Started("base"))
    live.show(StepStarted("base", STEP))
    browser.open(server.address, size=(400, 900))
    browser.wait(lambda: browser.texts("#running .name") == ["base"])
    assert sorted(browser.texts("#waiting .name")) == ["lone", "map", "planner"]
    assert browser.texts("#waiting .running") == ["base"]
    assert browser.run("return document.documentElement.scrollWidth") == 400
    live.show(Finished("base", 1, 1.0))
    browser.wait(lambda: browser.texts("#failures .name") == ["base"])
    assert browser.texts("#running") == []
    server.close()
    browser.wait(lambda: browser.texts("h1") == ["The build has failed"])


@pytest.mark.needs("cmake")
def test_a_build_serves_its_page_until_it_ends(tmp_path: Path) -> None:
    root = tmp_path / "my ws"
    (root / "src/napping").mkdir(parents=True)
    (root / "src/napping/package.xml").write_text(manifest_text("napping", build_type="cmake"))
    (root / "src/napping/CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.18)\nproject(napping NONE)\n"
        "add_custom_target(nap ALL sh -c [[while [ ! -e awake ]; do sleep 0.05; done]] VERBATIM)\n"
    )
    forge = shutil.which("forge", path=Path(sys.executable).parent) or "forge"
    with subprocess.Popen(
        [forge, "build", "--timings=live"],
        cwd=root,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout
        address = process.stdout.readline().removeprefix("live: ").strip()
        state: dict[str, Any] = {"running": []}
        while [each["step"] for each in state["running"]] != ["build"]:
            state = json.loads(ask(address, f"state?{state.get('version', '')}")[1])
        (root / "build/napping/awake").touch()
        while not state["ended"]:
            state = json.loads(ask(address, f"state?{state['version']}")[1])
        rest, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) == (0, "")
    assert rest.endswith("timings: log/latest_build/timings.html\n")
    assert [(each["name"], each["outcome"]) for each in state["ended_packages"]] == [("napping", "finished")]
    with pytest.raises(OSError, match="refused"):
        ask(address)
