"""The worker process and its client."""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

import forge
from forge.cli.worker import INTERFACE_MODULES, worker
from forge.execution import worker_client
from forge.execution.fork_server import started_server
from tests.conftest import Tree

CLIENT = Path(worker_client.__file__)
HOME = str(Path(forge.__file__).parents[1])


def ask(root: Path, *argv: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run the client as CMake would."""
    environment = {**os.environ, "PYTHONPATH": HOME, **variables}
    words = [sys.executable, "-S", "-E", str(CLIENT), *argv]
    return subprocess.run(words, cwd=root, env=environment, capture_output=True, text=True, check=False)


@pytest.fixture
def package(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with definitions, one of them wrong."""
    monkeypatch.setenv("PYTHONPATH", HOME)
    return tree({"good/msg/A.msg": "int32 x\n", "bad/msg/B.msg": "int23 x\n"})


def generate(root: Path, name: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Generate code for one of the folders."""
    return ask(root, "interface", "generate", "--package", name, "--output", "out", name, **variables)


def test_commands_behave_the_same_with_and_without_the_worker(package: Path) -> None:
    alone = [generate(package, name) for name in ("good", "bad")]
    written = (package / "out/python/good/msg/_a.py").read_text()
    shutil.rmtree(package / "out")
    with worker(*INTERFACE_MODULES) as variables:
        asked = [generate(package, name, **variables) for name in ("good", "bad")]
    assert [done.returncode for done in asked] == [0, 2]
    assert (package / "out/python/good/msg/_a.py").read_text() == written
    assert "bad/msg/B.msg:1:1: error: unknown type 'int23'" in asked[1].stderr
    for one, other in zip(alone, asked, strict=True):
        assert (one.returncode, one.stdout, one.stderr) == (other.returncode, other.stdout, other.stderr)


DAWDLING = """import os, subprocess
def main(argv):
    with open(argv[0] + ".draft", "w") as flag:
        flag.write(str(os.getpid()))
    os.rename(flag.name, argv[0])
    return subprocess.run(["sleep", "60"]).returncode
"""


def until(question: Callable[[], bool]) -> None:
    """Wait until a condition holds, with a timeout."""
    end = time.monotonic() + 20
    while not question():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.mark.needs("pgrep")
def test_commands_end_when_their_caller_exits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An interrupt ends the callers; their commands must not continue."""
    (tmp_path / "dawdling.py").write_text(DAWDLING)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join((HOME, str(tmp_path))))
    flag = tmp_path / "flag"
    with worker("dawdling") as variables:
        until(Path(variables[worker_client.WORKER_VARIABLE]).exists)
        words = [sys.executable, "-S", "-E", str(CLIENT), "-m", "dawdling", str(flag)]
        with subprocess.Popen(words, env={**os.environ, **variables}) as caller:
            until(flag.exists)
            caller.kill()
        group = flag.read_text()
        until(
            lambda: subprocess.run(["pgrep", "-g", group], capture_output=True, check=False).returncode == 1
        )


COUNTING = """import os, resource, sys, time
from forge.execution.fork_server import serve
def run(call):
    while time.process_time() < 0.3:
        pass
    return 0
serve(int(sys.argv[1]), run)
try:
    while True:
        os.wait()
except ChildProcessError:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
with open(sys.argv[2], "w") as result:
    result.write(str(used.ru_utime + used.ru_stime))
"""


def test_cpu_time_of_commands_is_accounted_to_the_worker(tmp_path: Path) -> None:
    """Otherwise, `time forge build` would not include the generators."""
    result = tmp_path / "result"

    def command(descriptor: int) -> tuple[str, ...]:
        return sys.executable, "-c", COUNTING, str(descriptor), str(result)

    with started_server(command, {**os.environ, "PYTHONPATH": HOME}) as address:
        assert ask(tmp_path, "any", FORGE_WORKER=address).returncode == 0
    assert float(result.read_text()) >= 0.3


def test_the_worker_serves_callers_concurrently(package: Path) -> None:
    with worker(*INTERFACE_MODULES) as variables:
        environment = {**os.environ, **variables}
        words = [sys.executable, "-S", "-E", str(CLIENT), "interface", "hash", "std_msgs/msg/String"]
        calls = [
            subprocess.Popen(words, cwd=package, env=environment, stdout=subprocess.PIPE, text=True)
            for _ in range(8)
        ]
        answers = {call.communicate()[0] for call in calls}
    assert len(answers) == 1
    assert "RIHS01_" in answers.pop()


def test_commands_run_if_the_worker_has_ended(package: Path) -> None:
    assert generate(package, "good", FORGE_WORKER=str(package / "nobody")).returncode == 0


def test_argparse_exits_become_exit_codes(package: Path) -> None:
    with worker(*INTERFACE_MODULES) as variables:
        assert ask(package, "interface", "generate", "--nonsense", **variables).returncode == 2
