"""One job budget, watched from outside: how many compilers run while real packages are built."""

import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from tests.conftest import Tree
from tests.packages import manifest_text
from tests.snippets import surroundings

pytestmark = [pytest.mark.slow, pytest.mark.needs("cmake", "make", "g++")]

COMPILERS = frozenset({"cc1plus", "cc1", "as", "ld"})
"""The programs that do the work of one job, one after the other."""

CMAKE = """cmake_minimum_required(VERSION 3.18)
project({name} CXX)
add_library({name} SHARED {sources})
install(TARGETS {name})
"""
SOURCE = "#include <map>\n#include <string>\nstd::map<std::string, int> {name};\n"


def package(name: str, files: int, *needs: str) -> dict[str, str]:
    """Return a package whose every source keeps a compiler busy for a while."""
    names = [f"{name}_{number}" for number in range(files)]
    depends = "".join(f"<depend>{need}</depend>" for need in needs)
    return {
        f"src/{name}/package.xml": manifest_text(name, depends, build_type="cmake"),
        f"src/{name}/CMakeLists.txt": CMAKE.format(
            name=name, sources=" ".join(f"{one}.cpp" for one in names)
        ),
        **{f"src/{name}/{one}.cpp": SOURCE.format(name=one) for one in names},
    }


@dataclass
class Watch:
    """How many compilers ran below a folder, looked at again and again."""

    folder: Path
    counts: list[int] = field(default_factory=list)

    @property
    def most(self) -> int:
        return max(self.counts)

    def look(self) -> None:
        """Count once; who vanishes meanwhile does not count."""
        self.counts.append(sum(1 for _ in self._running()))

    def _running(self) -> Iterator[str]:
        for process in Path("/proc").iterdir():
            if process.name.isdigit():
                try:
                    name = (process / "comm").read_text().strip()
                    if name in COMPILERS and str(self.folder) in str((process / "cwd").readlink()):
                        yield name
                except OSError:
                    continue


def watched(folder: Path, *argv: str, env: dict[str, str] | None = None) -> Watch:
    """Run a command in a folder until it ended well, and count compilers all the while."""
    watch = Watch(folder)
    ended = threading.Event()

    def look() -> None:
        while not ended.is_set():
            watch.look()
            time.sleep(0.004)

    thread = threading.Thread(target=look)
    thread.start()
    try:
        ran = subprocess.run(
            argv,
            cwd=folder,
            env={**surroundings(folder), **(env or {})},
            capture_output=True,
            text=True,
            check=False,
        )
    finally:
        ended.set()
        thread.join()
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "stderr" not in ran.stdout + ran.stderr
    return watch


FORGE = (sys.executable, "-m", "forge", "--log-base", os.devnull, "build")


@pytest.fixture
def workspace(tree: Tree) -> Path:
    """Return three packages of which the last needs the first."""
    return tree({**package("a", 2), **package("b", 2), **package("c", 1, "a")})


def ninjas() -> list[str]:
    """Return every ninja of this machine: the wheel's speaks of jobs, a distribution's older one does not."""
    paths = dict.fromkeys([str(Path(sys.executable).parent), *os.environ["PATH"].split(os.pathsep)])
    found = [shutil.which("ninja", path=path) for path in paths]
    return list({str(Path(one).resolve()): one for one in found if one}.values())


@pytest.mark.parametrize("ninja", ninjas())
def test_concurrent_ninjas_share_the_jobs(workspace: Path, ninja: str) -> None:
    watch = watched(workspace, *FORGE, "--jobs", "2", "--parallel-workers", "4", env={"NINJA": ninja})
    assert watch.most == 2


def test_concurrent_makes_share_the_jobs(workspace: Path) -> None:
    watch = watched(workspace, *FORGE, "--jobs", "2", env={"CMAKE_GENERATOR": "Unix Makefiles"})
    assert watch.most == 2


def test_makeflags_of_the_user_set_the_job_budget(workspace: Path) -> None:
    watch = watched(workspace, *FORGE, "--packages-select", "a", env={"MAKEFLAGS": "-j1"})
    assert watch.most == 1


def test_an_outer_make_shares_its_jobs(workspace: Path) -> None:
    """Its own recipe compiles beside forge: both together keep to its number."""
    (workspace / "mine.cpp").write_text("#include <regex>\nstd::regex mine;\n")
    mine = "".join(f"\tc++ -c mine.cpp -o mine_{number}.o\n" for number in range(3))
    forge = " ".join(FORGE)
    (workspace / "Makefile").write_text(f"all: mine forge\nmine:\n{mine}forge:\n\t+{forge}\n")
    watch = watched(workspace, "make", "-j2")
    assert watch.most == 2


BUSY = """cmake_minimum_required(VERSION 3.18)
project({name} NONE)
foreach(number RANGE 1 {count})
  add_custom_command(OUTPUT done_${{number}} COMMAND sleep 0.1)
  list(APPEND all done_${{number}})
endforeach()
add_custom_target(busy ALL DEPENDS ${{all}})
"""


def busy(name: str, count: int, *needs: str) -> dict[str, str]:
    """Return a package with so many short jobs."""
    depends = "".join(f"<depend>{need}</depend>" for need in needs)
    return {
        f"src/{name}/package.xml": manifest_text(name, depends, build_type="cmake"),
        f"src/{name}/CMakeLists.txt": BUSY.format(name=name, count=count),
    }


@pytest.mark.parametrize("generator", ["Ninja", "Unix Makefiles"])
def test_a_large_package_does_not_delay_small_ones(tree: Tree, generator: str) -> None:
    """Of three jobs the large one has two when 'x' ends, and must leave one to the second of two others."""
    folder = tree({**busy("large", 40), **busy("x", 1), **busy("s1", 10, "x"), **busy("s2", 1, "x")})
    ran = subprocess.run(
        (*FORGE, "--jobs", "3"),
        cwd=folder,
        env={**surroundings(folder), "CMAKE_GENERATOR": generator},
        capture_output=True,
        text=True,
        check=True,
    )
    ended = [line.split()[2] for line in ran.stdout.splitlines() if line.startswith("Finished <<<")]
    assert ended.index("s2") < ended.index("large")
