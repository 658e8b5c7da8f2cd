"""Large workspaces: what four times as many take is four times as much, and nothing is too deep.

FORGE_TEST_SCALE=1 tries 5,000 packages, chains of 3,000 and 20,000 interfaces, and prints what they took:
`make scale`, some twenty minutes.
"""

import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.bench.workspaces import CMAKELISTS, MANIFEST, write_workspace
from tests.packages import manifest_text

pytestmark = pytest.mark.slow

LARGE = os.environ.get("FORGE_TEST_SCALE") == "1"
PACKAGES = 5000 if LARGE else 400
BUILT = 5000 if LARGE else 48
LINKS = 3000 if LARGE else 300
BUILT_LINKS = 3000 if LARGE else 32
INTERFACES = 20000 if LARGE else 400
SETUP = "from setuptools import setup\nsetup(name='{name}', version='1.0.0')\n"
INTERFACE = """cmake_minimum_required(VERSION 3.18)
project({name})
find_package(rosidl_default_generators REQUIRED)
rosidl_generate_interfaces({name} "msg/One.msg")
"""


class Cost(NamedTuple):
    """What a command took: seconds of the processor and megabytes at its peak.

    `own` are the seconds that the command itself took, without the programs that it started.
    """

    seconds: float
    own: float
    megabytes: float
    out: str


_MEASURE = """import os, subprocess, sys
process = subprocess.Popen(sys.argv[1:])
# While nobody has asked how it ended, the system still tells its own times from those of its children.
os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
with open(f"/proc/{process.pid}/stat") as stream:
    user, system = map(int, stream.read().rpartition(")")[2].split()[11:13])
own = (user + system) / os.sysconf("SC_CLK_TCK")
_, status, usage = os.wait4(process.pid, 0)
print()
print(os.waitstatus_to_exitcode(status), usage.ru_utime + usage.ru_stime, own, usage.ru_maxrss)
"""
"""A program of its own: a process inherits the peak of the one that starts it, and pytest is large."""


def cost(root: Path, *words: str) -> Cost:
    argv = [
        sys.executable,
        "-S",
        "-c",
        _MEASURE,
        sys.executable,
        "-m",
        "forge",
        "--log-base",
        os.devnull,
        *words,
    ]
    done = subprocess.run(argv, cwd=root, env=surroundings(), capture_output=True, text=True, check=True)
    out, _, measured = done.stdout.rstrip().rpartition("\n")
    code, seconds, own, kilobytes = measured.split()
    assert code == "0", done.stderr[-2000:]
    found = Cost(float(seconds), float(own), int(kilobytes) / 1024, out)
    children = f" and {found.seconds - found.own:.1f} s of others" if found.seconds > found.own + 0.1 else ""
    print(f"{root.name} {' '.join(words)}: {found.own:.1f} s{children}, {found.megabytes:.0f} MB")
    return found


def surroundings() -> dict[str, str]:
    """Return an environment that no ROS was sourced in."""
    foreign = ("AMENT_", "CMAKE_PREFIX_PATH", "COLCON_", "ROS_")
    found = {name: value for name, value in os.environ.items() if not name.startswith(foreign)}
    return {**found, "PYTHONPATH": str(Path(__file__).parents[2])}


def write_chain(root: Path, kind: str, count: int) -> Path:
    """Write packages of a build type that each need the one before."""
    for number in range(count):
        name, before = f"link_{number:05}", f"link_{number - 1:05}"
        folder = root / "src" / name
        folder.mkdir(parents=True)
        need = f"  <depend>{before}</depend>\n" if number else ""
        if kind == "cmake":
            (folder / "package.xml").write_text(MANIFEST.format(name=name, depends=need))
            (folder / "CMakeLists.txt").write_text(CMAKELISTS.format(name=name))
        elif kind == "ament_python":
            (folder / "package.xml").write_text(manifest_text(name, need.strip(), build_type=kind))
            (folder / "setup.py").write_text(SETUP.format(name=name))
        else:
            more = (
                "<buildtool_depend>ament_cmake</buildtool_depend>",
                "<build_depend>rosidl_default_generators</build_depend>",
            )
            group = "<member_of_group>rosidl_interface_packages</member_of_group>"
            (folder / "package.xml").write_text(manifest_text(name, *more, need.strip(), group))
            (folder / "CMakeLists.txt").write_text(INTERFACE.format(name=name))
            (folder / "msg").mkdir()
            (folder / "msg" / "One.msg").write_text("int8 one\n")
    return root


@pytest.mark.needs("cmake")
@pytest.mark.parametrize(
    "words",
    [("list",), ("graph", "--dot"), ("info", "--json"), ("build", "--dry-run", "--merge-install")],
    ids=str,
)
def test_time_and_memory_are_linear_in_packages(words: tuple[str, ...], tmp_path: Path) -> None:
    few = cost(write_workspace(tmp_path / "few", PACKAGES // 4, files=1), *words)
    many = cost(write_workspace(tmp_path / "many", PACKAGES, files=1), *words)
    assert in_proportion(few, many)


@pytest.mark.needs("cmake")
@pytest.mark.parametrize("kind", ["cmake", "ament_python", "ament_cmake"])
def test_a_long_chain_is_ordered_and_planned(kind: str, tmp_path: Path) -> None:
    if kind == "ament_cmake":
        pytest.importorskip("numpy")
    root = write_chain(tmp_path / f"chain_{kind}", kind, LINKS)
    assert len(cost(root, "list", "--topological-order", "--names-only").out.split()) == LINKS
    planned = cost(root, "build", "--dry-run", "--merge-install")
    assert planned.out.index("link_00000") < planned.out.index(f"link_{LINKS - 1:05}")
    assert planned.megabytes < 45 + LINKS * LINKS / 100_000


def in_proportion(few: Cost, many: Cost) -> bool:
    """Tell if four times as many took about four times as much, start-up and noise allowed for."""
    return many.own < 8 * few.own + 0.5 and many.megabytes < 4 * few.megabytes + 20


def built_twice(root: Path, packages: int) -> tuple[Cost, Cost]:
    """Build a workspace, then build it again with nothing to do; return what each took."""
    words = ("build", "--merge-install", "--event-handlers", "console_start_end-")
    first = cost(root, *words)
    assert f"Summary: {packages} packages finished [" in first.out
    again = cost(root, *words)
    assert f"Summary: 0 packages finished, {packages} packages unchanged [" in again.out
    return first, again


def write_mixture(root: Path, packages: int) -> Path:
    """Write a workspace in which each tenth package is one of Python."""
    write_workspace(root, packages, files=1)
    for folder in sorted(root.glob("src/group_3/*")):
        manifest = (folder / "package.xml").read_text()
        (folder / "package.xml").write_text(
            manifest.replace("<build_type>cmake<", "<build_type>ament_python<")
        )
        (folder / "CMakeLists.txt").unlink()
        (folder / "setup.py").write_text(SETUP.format(name=folder.name))
    return root


@pytest.mark.needs("cmake")
def test_many_packages_are_built_and_then_up_to_date(tmp_path: Path) -> None:
    costs = [
        built_twice(write_mixture(tmp_path / f"built_{count}", count), count)
        for count in ((BUILT // 4, BUILT // 2, BUILT) if LARGE else (BUILT // 4, BUILT))
    ]
    assert in_proportion(costs[0][0], costs[-1][0])
    assert in_proportion(costs[0][1], costs[-1][1])


@pytest.mark.needs("cmake")
def test_a_long_chain_is_built_and_then_up_to_date(tmp_path: Path) -> None:
    """Each link sees all below it, so that something grows with the square; it must be little."""
    short, long = (
        built_twice(write_chain(tmp_path / f"built_chain_{count}", "cmake", count), count)
        for count in (BUILT_LINKS // 4, BUILT_LINKS)
    )
    assert in_proportion(short[0], long[0])
    assert in_proportion(short[1], long[1])


def test_a_large_cycle_is_reported_quickly(tmp_path: Path) -> None:
    root = write_chain(tmp_path / "circle", "cmake", LINKS)
    first = root / "src" / "link_00000" / "package.xml"
    first.write_text(MANIFEST.format(name="link_00000", depends=f"  <depend>link_{LINKS - 1:05}</depend>\n"))
    argv = [sys.executable, "-m", "forge", "list"]
    done = subprocess.run(
        argv, cwd=root, env=surroundings(), capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 2
    assert "dependency cycle" in done.stderr


def test_time_and_memory_are_linear_in_interfaces(tmp_path: Path) -> None:
    costs = []
    for count in (INTERFACES // 4, INTERFACES):
        folder = tmp_path / str(count) / "src" / "many" / "msg"
        folder.mkdir(parents=True)
        for number in range(count):
            before = f"M{number - 1} before\n" if number % 50 else ""
            (folder / f"M{number}.msg").write_text(f"# Message {number}\nint8 a\nstring b\n{before}")
        root = tmp_path / str(count)
        words = (
            "interface",
            "generate",
            "src/many",
            "--package",
            "many",
            "--output",
            "out",
            "--lang",
            "python",
        )
        costs.append(cost(root, *words))
        again = cost(root, *words)
        assert "0 of" in again.out
    assert in_proportion(costs[0], costs[-1])
