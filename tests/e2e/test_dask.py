"""Builds on a cluster: a real scheduler of Dask and real workers on loopback."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import ClassVar

import pytest

from forge.base.own_environment import extra_command
from tests.clusters import Loopback, alone, loopback, programs_of
from tests.conftest import Forge, Tree
from tests.evolving import differences, look
from tests.packages import manifest_text, write_files
from tests.snippets import ROOT, surroundings

pytestmark = pytest.mark.needs("cmake", "ninja", "g++")

CMAKE = "cmake_minimum_required(VERSION 3.18)\nproject({name} {languages})\n{body}"
# The flag is not named as a whole: a file elsewhere that a command names and writes is no clean input.
SLOW = """add_custom_command(OUTPUT made.txt
  COMMAND : at{flag} && printf half > made.txt && cd {flag.parent} && touch {flag.name} && cd -
          && sleep {seconds}
          && echo whole > made.txt)
add_custom_target(all_of_it ALL DEPENDS made.txt)
install(FILES ${{CMAKE_CURRENT_BINARY_DIR}}/made.txt DESTINATION share/{name})
"""
LISTS = """add_library({name} SHARED one.c two.c)
install(TARGETS {name})
install(FILES here.h DESTINATION include/{name})
"""


def cmake(name: str, body: str, *needs: str, languages: str = "NONE") -> dict[str, str]:
    depends = "".join(f"<depend>{need}</depend>" for need in needs)
    return {
        f"src/{name}/package.xml": manifest_text(name, depends, build_type="cmake"),
        f"src/{name}/CMakeLists.txt": CMAKE.format(name=name, languages=languages, body=body),
    }


def slow(name: str, flag: Path, seconds: float = 1.5) -> dict[str, str]:
    """Return a package that says by a file when it is half-way, and takes its time then."""
    return cmake(name, SLOW.format(name=name, flag=flag, seconds=seconds))


def library(name: str, *needs: str) -> dict[str, str]:
    """Return a package with a library of two sources."""
    return {
        **cmake(name, LISTS.format(name=name), *needs, languages="C"),
        f"src/{name}/one.c": f"int {name}_one() {{ return 1; }}\n",
        f"src/{name}/two.c": f"int {name}_two() {{ return 2; }}\n",
        f"src/{name}/here.h": "#pragma once\n",
    }


def plain(name: str, *needs: str) -> dict[str, str]:
    """Return a package of one file that no compiler sees."""
    body = f"install(FILES here.txt DESTINATION share/{name})\n"
    return {**cmake(name, body, *needs), f"src/{name}/here.txt": f"{name}\n"}


def python(name: str, *needs: str) -> dict[str, str]:
    depends = "".join(f"<depend>{need}</depend>" for need in needs)
    return {
        f"src/{name}/package.xml": manifest_text(name, depends, build_type="ament_python"),
        f"src/{name}/setup.py": f"from setuptools import setup\nsetup(name='{name}', packages=['{name}'])\n",
        f"src/{name}/{name}/__init__.py": "",
    }


class Workspace:
    """A workspace that is built here and there."""

    forge: ClassVar[Forge | None] = None

    def __init__(self, home: Path, cluster: Loopback, *options: str) -> None:
        """Remember where it is and how it is built on the cluster."""
        self.home = home
        self.options = ("--executor", "dask", "--scheduler", cluster.address, *options)

    def start(self, *words: str, env: Mapping[str, str] | None = None) -> subprocess.Popen[str]:
        return subprocess.Popen(
            (sys.executable, "-m", "forge", "build", *words),
            cwd=self.home,
            env={**surroundings(self.home.parent), "PYTHONPATH": str(ROOT), **(env or {})},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def build(self, *words: str, code: int = 0, env: Mapping[str, str] | None = None) -> str:
        """Build on the cluster to the end, in this process; return what was said."""
        assert Workspace.forge is not None
        variables = {"PYTHONPATH": str(ROOT), **(env or {})}
        ran = Workspace.forge("build", *self.options, *words, cwd=self.home, env=variables)
        assert ran.code == code, ran.out + ran.err
        return ran.out + ran.err

    def clean(self) -> Mapping[str, tuple[str, ...]]:
        """Return what a build here, of the same sources in the same folder, installs."""
        parked = self.home.with_name("parked")
        self.home.rename(parked)
        shutil.copytree(parked / "src", self.home / "src", symlinks=True)
        process = self.start("--log-base", os.devnull)
        said, _ = process.communicate(timeout=120)
        assert process.returncode == 0, said
        found = look(self.home / "install")
        shutil.rmtree(self.home)
        parked.rename(self.home)
        return found


@pytest.fixture(autouse=True)
def _this_process(forge: Forge) -> None:
    """Run builds that are not interrupted in this process, which loads Dask once."""
    Workspace.forge = forge


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Loopback]:
    """Two workers that see everything this machine has."""
    with loopback(tmp_path_factory.mktemp("cluster")) as running:
        running.add("one")
        running.add("two")
        yield running


def until(holds: Callable[[], object], seconds: float = 30.0) -> None:
    last = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < last
        time.sleep(0.02)


def test_workers_build_the_same_as_a_local_build(cluster: Loopback, tmp_path: Path) -> None:
    files = {**library("a"), **library("b"), **library("c", "a", "b"), **python("d", "c")}
    workspace = Workspace(write_files(tmp_path / "ws", files), cluster)
    said = workspace.build()
    assert "Summary: 4 packages finished" in said
    assert "stderr" not in said
    assert differences(look(workspace.home / "install"), workspace.clean()) == []
    assert "Summary: 0 packages finished" in workspace.build()


def test_the_package_cache_works_as_in_a_local_build(cluster: Loopback, tmp_path: Path) -> None:
    workspace = Workspace(
        write_files(tmp_path / "ws", plain("a")), cluster, "--cache", str(tmp_path / "cache")
    )
    workspace.build()
    shutil.rmtree(workspace.home / "build")
    shutil.rmtree(workspace.home / "install")
    assert "1 package came from the cache" in workspace.build()


def test_output_is_live_complete_and_ordered(cluster: Loopback, tmp_path: Path) -> None:
    shell = "for i in $(seq 20000); do echo line $i of many; done; touch {0}; sleep 1; echo last"
    flag = tmp_path / "flag"
    write_files(tmp_path, {"talk.sh": shell.format(flag)})
    body = f"add_custom_target(talk ALL COMMAND sh {tmp_path}/talk.sh VERBATIM USES_TERMINAL)\n"
    workspace = Workspace(write_files(tmp_path / "ws", cmake("talker", body)), cluster)
    process = workspace.start(*workspace.options, "--event-handlers", "console_direct+")
    assert process.stdout is not None
    lines = []
    live = False
    with process:
        for line in process.stdout:
            lines.append(line)
            if line == "line 20000 of many\n":
                live = process.poll() is None
    assert process.returncode == 0
    assert live
    talk = [line for line in lines if line.startswith("line ") or line == "last\n"]
    assert talk == [*(f"line {i} of many\n" for i in range(1, 20001)), "last\n"]


def test_failures_are_reported_as_in_a_local_build(cluster: Loopback, tmp_path: Path) -> None:
    broken = {**library("bad"), "src/bad/two.c": "int bad_two() { return nothing; }\n"}
    files = {**broken, **plain("above", "bad"), **plain("other")}
    workspace = Workspace(write_files(tmp_path / "ws", files), cluster)
    there = workspace.build("--continue-on-error", code=1)
    shutil.rmtree(workspace.home / "build")
    shutil.rmtree(workspace.home / "install")
    process = workspace.start("--continue-on-error")
    here, _ = process.communicate(timeout=120)
    assert process.returncode == 1
    assert _failure(there) == _failure(here)
    assert "first error in step 'build'" in there
    assert "two.c:1" in there
    assert "Finished <<< other" in there


def _failure(said: str) -> list[str]:
    """Return what is said of a failure, without times and folders of a run."""
    lines = said[said.index("Failed   <<< ") :].splitlines()
    return [line for line in lines[1:5] if "log:" not in line]


def test_ctrl_c_ends_all_remote_processes(cluster: Loopback, tmp_path: Path) -> None:
    flags = [tmp_path / "flag-a", tmp_path / "flag-b"]
    files = {**slow("a", flags[0], 60), **slow("b", flags[1], 60)}
    workspace = Workspace(write_files(tmp_path / "ws", files), cluster)
    process = workspace.start(*workspace.options)
    until(lambda: all(flag.exists() for flag in flags))
    assert programs_of(workspace.home / "build")
    process.send_signal(signal.SIGINT)
    said, _ = process.communicate(timeout=20)
    assert process.returncode == 130, said
    assert "2 packages aborted: a b" in said
    assert programs_of(workspace.home / "build") == []


def test_remote_processes_end_soon_after_a_killed_client(cluster: Loopback, tmp_path: Path) -> None:
    flag = tmp_path / "flag"
    workspace = Workspace(write_files(tmp_path / "ws", slow("a", flag, 60)), cluster)
    process = workspace.start(*workspace.options)
    until(flag.exists)
    process.kill()
    process.communicate()
    until(lambda: not programs_of(workspace.home / "build"))


def test_a_killed_worker_is_replaced(cluster: Loopback, tmp_path: Path) -> None:
    flag = tmp_path / "flag"
    files = {**slow("a", flag), **plain("b", "a"), **plain("c")}
    workspace = Workspace(write_files(tmp_path / "ws", files), cluster)
    process = workspace.start(*workspace.options)
    until(flag.exists)
    victim = cluster.holder(flag)
    cluster.kill(victim)
    said, _ = process.communicate(timeout=60)
    cluster.add(f"{victim}-again")  # no blank: what is made in such a folder has more quotes
    assert process.returncode == 0, said
    assert "was lost; 'a' is restarted on" in said
    assert differences(look(workspace.home / "install"), workspace.clean()) == []
    assert programs_of(workspace.home / "build") == []


@pytest.fixture(scope="module")
def apart(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Loopback, Path]]:
    """Start a worker that sees everything but the folder that is returned."""
    if not alone():
        pytest.skip("no program may have mounts of its own here")
    hidden = tmp_path_factory.mktemp("hidden")
    with loopback(tmp_path_factory.mktemp("apart"), hidden) as cluster:
        cluster.add("one")
        yield cluster, hidden


def test_workers_without_access_to_the_build_folder_are_rejected(apart: tuple[Loopback, Path]) -> None:
    cluster, hidden = apart
    workspace = Workspace(write_files(hidden / "ws", plain("a")), cluster)
    said = workspace.build(code=2)
    assert said == (
        f"error: the workers cannot access the build folder '{workspace.home / 'build'}'\n"
        "hint: mount it under the same path on the workers\n"
    )


def test_a_worker_without_access_to_the_build_folder_is_reported(apart: tuple[Loopback, Path]) -> None:
    cluster, hidden = apart
    workspace = Workspace(write_files(hidden / "ws", plain("a")), cluster)
    cluster.hidden = None
    cluster.add("with-access")
    try:
        said = workspace.build(code=2)
    finally:
        cluster.hidden = hidden
        cluster.kill("with-access")
    assert said.startswith("error: the workers at 'tcp://127.0.0.1:")
    assert said.count("tcp://") == 1


def test_a_worker_with_different_programs_is_reported(apart: tuple[Loopback, Path], tmp_path: Path) -> None:
    cluster, hidden = apart
    workspace = Workspace(write_files(tmp_path / "ws", plain("a")), cluster)
    program = hidden / "bin" / "cmake"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {shutil.which("cmake")} "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    path = os.pathsep.join((str(program.parent), surroundings(tmp_path)["PATH"]))
    said = workspace.build(code=2, env={"PATH": path})
    assert f"is not used: '{program}' does not exist there" in said


def test_the_build_waits_for_the_first_worker(tmp_path: Path) -> None:
    (tmp_path / "cluster").mkdir()
    with loopback(tmp_path / "cluster") as cluster:
        workspace = Workspace(write_files(tmp_path / "ws", plain("a")), cluster)
        process = workspace.start(*workspace.options)
        assert process.stdout is not None
        first = process.stdout.readline()
        assert first == f"waiting for a worker at {cluster.address}, for 60 seconds at most\n"
        cluster.add("late")
        said, _ = process.communicate(timeout=60)
        assert process.returncode == 0, said


def test_missing_requirements_are_reported(tree: Tree, forge: Forge) -> None:
    root = tree(plain("a"))
    ran = forge("build", "--executor", "dask", cwd=root)
    assert ran.code == 2
    assert ran.err.startswith("error: '--executor dask' needs '--scheduler ADDRESS'\nhint: ")
    ran = forge("test", "--executor", "dask", cwd=root)
    assert ran.code == 2
    assert "invalid choice: 'dask'" in ran.err


def test_an_unresponsive_scheduler_is_reported(tmp_path: Path) -> None:
    workspace = Workspace(
        write_files(tmp_path / "ws", plain("a")), Loopback(tmp_path, address="tcp://127.0.0.1:9")
    )
    hasty = {"DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "500ms"}
    process = workspace.start(*workspace.options, env=hasty)
    said, _ = process.communicate(timeout=60)
    assert process.returncode == 2
    assert said.startswith("error: cannot connect to the scheduler at 'tcp://127.0.0.1:9': ")
    assert len(said.splitlines()) == 2, said
    said = Workspace(workspace.home, Loopback(tmp_path, address="what is this")).build(code=2, env=hasty)
    assert said.startswith("error: cannot connect to the scheduler at 'what is this': ")


def test_without_dask_the_install_command_is_printed(tmp_path: Path) -> None:
    write_files(tmp_path / "absent", {"sitecustomize.py": "import sys\nsys.modules['distributed'] = None\n"})
    workspace = Workspace(
        write_files(tmp_path / "ws", plain("a")), Loopback(tmp_path, address="tcp://127.0.0.1:9")
    )
    path = os.pathsep.join((str(tmp_path / "absent"), str(ROOT)))
    process = workspace.start(*workspace.options, env={"PYTHONPATH": path})
    said, _ = process.communicate(timeout=60)
    assert process.returncode == 2
    assert said == f"error: '--executor dask' needs Dask\nhint: run: {extra_command('dask')}\n"
