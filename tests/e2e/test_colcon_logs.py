"""forge and colcon write the same files into build and log folders, which other tools read.

docs/reference/from-colcon.md lists which files are meant to differ.
"""

import re
from collections import OrderedDict
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.e2e.test_colcon_installs import surroundings  # noqa: F401  (a fixture)
from tests.listed_differences import ListedDifferences
from tests.packages import manifest_text
from tests.peers import Colcon, Twins

pytestmark = [pytest.mark.slow, pytest.mark.needs("colcon", "cmake", "ninja")]

PAGE = ListedDifferences("Files of build and log folders")
CMAKE = """cmake_minimum_required(VERSION 3.18)
project({name} C)
{more}
include(CTest)
add_test(NAME works COMMAND true)
add_executable({name}_tool tool.c)
install(TARGETS {name}_tool DESTINATION lib/{name})
"""
AMENT = """cmake_minimum_required(VERSION 3.18)
project(am NONE)
find_package(ament_cmake REQUIRED)
install(DIRECTORY lib DESTINATION .)
ament_package()
"""
SETUP = """from setuptools import setup
setup(name="py", version="0.1.0", packages=["py"], extras_require={"test": ["pytest"]}, data_files=[
    ("share/ament_index/resource_index/packages", ["resource/py"]), ("share/py", ["package.xml"])])
"""
PYTHON = {
    "src/py/package.xml": manifest_text(
        "py", "<test_depend>python3-pytest</test_depend>", build_type="ament_python"
    ),
    "src/py/setup.py": SETUP,
    "src/py/resource/py": "",
    "src/py/py/__init__.py": "",
    "src/py/test/test_py.py": "def test_right():\n    pass\n\n\ndef test_wrong():\n    assert 1 == 2\n",
}
ONE = ("--executor", "sequential")
NINJA = ("--cmake-args", "-GNinja")
"""forge prefers Ninja; the files of another generator are not the subject."""
_EVENT = re.compile(r"\[(\d+\.\d{6})\] \((\S+)\) (\w+): (\{.*\})")
_TIMES = ((r"_\d{4}-\d\d-\d\d_\d\d-\d\d-\d\d", "_TIME"), (r"\d{8}-\d{4}", "TIME"))


def cmake(name: str, *needs: str, more: str = "") -> dict[str, str]:
    """Return the files of a package with a program and a test."""
    return {
        f"src/{name}/package.xml": manifest_text(
            name, *(f"<depend>{need}</depend>" for need in needs), build_type="cmake"
        ),
        f"src/{name}/CMakeLists.txt": CMAKE.format(name=name, more=more),
        f"src/{name}/tool.c": "int main(void) { return 0; }\n",
    }


WORKING = {
    **cmake("base", more='message(WARNING "it\'s \\"quoted\\"")'),
    **cmake("above", "base"),
    **PYTHON,
    "src/am/package.xml": manifest_text("am", "<depend>ament_cmake</depend>"),
    "src/am/CMakeLists.txt": AMENT,
    "src/am/lib/libam.so": "",
}
FAILING = {
    **cmake("base"),
    **cmake("broken", "base", more='message(FATAL_ERROR "no luck")'),
    **cmake("skipped", "broken"),
    **cmake("unselected"),
}


@pytest.fixture
def both(
    request: pytest.FixtureRequest,
    forge: Forge,
    tree: Tree,
    surroundings: dict[str, str],  # noqa: F811
) -> Iterator[Twins]:
    root = tree({f"{who}/{name}": text for who in ("ours", "theirs") for name, text in request.param.items()})
    running = Twins(root, forge, Colcon(surroundings), surroundings)
    yield running
    running.end()


def files(root: Path) -> set[str]:
    """Return the files and links of the build and log folders, without dates in their names."""
    found = set()
    for folder in ("build", "log"):
        for path in (root / folder).rglob("*"):
            name = path.relative_to(root).as_posix()
            if "/CMakeFiles/" not in name and (path.is_symlink() or not path.is_dir()):
                for pattern, text in _TIMES:
                    name = re.sub(pattern, text, name)
                found.add(name)
    return found


def unexplained(both: Twins) -> list[str]:
    """Return the files that only one of the tools has, but for those on the page."""
    ours, theirs = map(files, both.roots)
    names = sorted((name, "forge" if name in ours else "colcon") for name in ours ^ theirs)
    return [f"{name}: {who}" for name, who in names if not PAGE.explain(name, who)]


Event = tuple[str, str, dict[str, object]]


def events(root: Path, verb: str) -> list[Event]:
    """Return the name, the kind and the members of each event in the last log, without those of the timer."""
    found, times = [], []
    for line in (root / f"log/latest_{verb}/events.log").read_text().splitlines():
        match = _EVENT.fullmatch(line)
        assert match is not None, line
        times.append(float(match[1]))
        members = eval(match[4], {"OrderedDict": OrderedDict})
        found.append((match[2], match[3], members))
    assert times[0] == 0.0
    assert times == sorted(times)
    assert found[0] == ("-", "TimerEvent", {})
    assert found[-1] == ("-", "EventReactorShutdown", {})
    return [event for event in found if event[1] != "TimerEvent"]


def course(root: Path, verb: str) -> list[tuple[object, ...]]:
    """Return the states of packages in their order, with relative prefixes; whatever runs for it."""
    states = {"JobUnselected", "JobQueued", "JobStarted", "JobEnded", "JobSkipped", "TestFailure"}
    return [
        (name, kind, *(str(value).replace(str(root), "") for value in members.values()))
        for name, kind, members in events(root, verb)
        if kind in states
    ]


def kinds(root: Path, verb: str, package: str) -> list[tuple[str, object]]:
    """Return what happened to a package, without its output."""
    told = ("progress", "rc", "returncode")
    return [
        (kind, next((members[key] for key in told if key in members), None))
        for name, kind, members in events(root, verb)
        if name == package and not kind.endswith("Line")
    ]


@pytest.mark.parametrize("both", [WORKING], indirect=True)
def test_builds_and_tests_leave_the_same_files(both: Twins) -> None:
    both.agree("build", *ONE, *NINJA)
    assert "\n".join(unexplained(both)) == ""
    ours, theirs = (course(root, "build") for root in both.roots)
    assert ours == theirs
    assert kinds(both.roots[0], "build", "base") == kinds(both.roots[1], "build", "base")
    both.agree("test", *ONE)
    assert "\n".join(unexplained(both)) == ""
    ours, theirs = (course(root, "test") for root in both.roots)
    assert ours == theirs
    for package, verb in (("base", "build"), ("py", "build"), ("py", "test"), ("base", "test")):
        folders = [root / f"log/latest_{verb}/{package}" for root in both.roots]
        assert shapes(folders[0]) == shapes(folders[1])


def shapes(folder: Path) -> dict[str, set[str]]:
    """Return the kinds of lines in each file of a package."""
    line = re.compile(
        r"(\[\d+\.\d{3}s\] )?(Invoking command in '[^']+': |Invoked command in '[^']+' returned '\d+': )?"
    )
    return {
        path.name: {
            re.sub(r"[\d.]+|'.*'", "", match[0])
            for text in path.read_text().splitlines()
            if (match := line.match(text)) and match[0]
        }
        for path in folder.iterdir()
    }


@pytest.mark.parametrize("both", [FAILING], indirect=True)
@pytest.mark.parametrize("options", [(), ("--continue-on-error",)])
def test_failures_leave_the_same_files(both: Twins, options: tuple[str, ...]) -> None:
    both.agree("build", *ONE, *options, "--packages-up-to", "skipped", *NINJA)
    assert "\n".join(unexplained(both)) == ""
    ours, theirs = (course(root, "build") for root in both.roots)
    assert ours == theirs
    assert {kind for _, kind, *_ in ours} >= {"JobUnselected", "JobEnded", "JobSkipped"}


SLOW = "execute_process(COMMAND sleep 3)"
ABORTED = {
    **cmake("slow", more=SLOW),
    **cmake("broken", more='execute_process(COMMAND sleep 1)\nmessage(FATAL_ERROR "no luck")'),
}


@pytest.mark.parametrize("both", [ABORTED], indirect=True)
def test_aborted_packages_leave_the_same_files(both: Twins) -> None:
    both.agree("build", "--parallel-workers", "2", *NINJA)
    assert "\n".join(unexplained(both)) == ""
    ours, theirs = ({line for line in course(root, "build") if line[1] == "JobEnded"} for root in both.roots)
    assert ours == theirs == {("slow", "JobEnded", "slow", "SIGINT"), ("broken", "JobEnded", "broken", "1")}


def test_documented_file_differences_exist() -> None:
    """Runs after the folders were compared: each line was needed by one of them."""
    if not PAGE.used:
        pytest.skip("the folders were not compared in this run")
    assert PAGE.unused == set()
