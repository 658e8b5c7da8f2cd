"""forge and colcon build the same packages in the same order, say so alike, and fail alike.

docs/reference/from-colcon.md lists what is meant to differ.
"""

import random
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import Forge, Ran
from tests.packages import manifest_text
from tests.peers import Colcon, Twins, colcon_in
from tests.snippets import ROOT

pytestmark = [pytest.mark.slow, pytest.mark.needs("colcon", "cmake", "ninja")]

NAMES = ("a", "b_2", "c-c", "Dd", "e", "zz")
FAILS = 'if(NOT EXISTS "${CMAKE_CURRENT_SOURCE_DIR}/mended")\n  message(FATAL_ERROR "no luck")\nendif()'
ONE = ("--executor", "sequential")
"""One package after the other: then it is the order alone that decides what happens."""


@pytest.fixture(scope="module")
def colcon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Colcon]:
    with colcon_in(tmp_path_factory.mktemp("home"), COLCON_LOG_PATH="/dev/null") as running:
        yield running


@pytest.fixture
def twins(tmp_path: Path, colcon: Colcon, forge: Forge) -> Twins:
    return Twins(tmp_path, forge, colcon)


def told(ran: Ran) -> list[str]:
    """Return what was said about packages, and the sums; not how long it took, nor what was fresh."""
    lines = [re.sub(r" \[[^]]*\]|, \d+ packages? unchanged", "", line) for line in ran.out.splitlines()]
    lines = [line for line in lines if line and "stderr output" not in line]
    failed = [re.sub(r" \[[^]]*\]", "", line) for line in ran.err.splitlines() if line.startswith("Failed ")]
    return [*lines, *failed]


def notes(root: Path) -> dict[str, str]:
    return {path.parent.name: path.read_text().strip() for path in root.glob("build/*/colcon_build.rc")}


@pytest.mark.parametrize("seed", range(4))
def test_packages_are_built_in_the_same_order_with_the_same_failures(twins: Twins, seed: int) -> None:
    chance = random.Random(seed)
    names = chance.sample(NAMES, 5)
    bad = names[chance.randrange(1, 3)]
    for number, name in enumerate(names):
        needs = chance.sample(names[:number], min(number, chance.randrange(3)))
        tags = [chance.choice(("depend", "exec_depend", "test_depend")) for _ in needs]
        lines = [f"<{tag}>{need}</{tag}>" for tag, need in zip(tags, needs, strict=True)]
        twins.package(name, *lines, more=FAILS if name == bad else "")
    for options in ((*ONE,), (*ONE, "--continue-on-error"), (*ONE, "--packages-select-build-failed")):
        forget(twins)
        ours, theirs = twins.agree("build", *options)
        assert told(ours) == told(theirs), options
        assert ours.code
        assert notes(twins.roots[0]).keys() == notes(twins.roots[1]).keys()
        assert failed(twins.roots[0]) == failed(twins.roots[1]) == {bad}
    twins.write(f"src/{bad}/mended", "")
    ours, theirs = twins.agree("build", *ONE, "--packages-skip-build-finished")
    assert told(ours) == told(theirs)
    ours, theirs = twins.agree("build", *ONE, "--packages-up-to", names[-1])
    assert ours.code == 0
    assert notes(twins.roots[0]) == notes(twins.roots[1])


@pytest.mark.parametrize(
    "handler", ["console_package_list+", "console_start_end-", "summary-", "console_cohesion+"]
)
def test_event_handlers_print_the_same_as_in_colcon(twins: Twins, handler: str) -> None:
    twins.package("b", more='message(STATUS "two words")')
    twins.package("a", "<depend>b</depend>", more='message(WARNING "hm")')
    ours, theirs = twins.agree("build", *ONE, "--event-handlers", handler)
    # What programs print is theirs: forge starts them in other ways.
    aside = re.compile(r"^--- output: \w+\n.*?^---\n", re.MULTILINE | re.DOTALL)
    said = [aside.sub("[output]\n", re.sub(r" \[[\d.]+s\]", "", ran.out)) for ran in (ours, theirs)]
    assert said[0] == said[1]
    assert all(("two words" in ran.out) == (handler == "console_cohesion+") for ran in (ours, theirs))


def forget(twins: Twins) -> None:
    """Let forge forget what is fresh; colcon knows no such thing."""
    for path in twins.roots[0].glob("build/forge_*"):
        path.unlink()


def failed(root: Path) -> set[str]:
    """Return the packages whose build failed, as far as colcon's selection options can tell."""
    return {name for name, note in notes(root).items() if note not in {"0", "SIGINT"}}


def test_both_tools_report_unbuildable_packages(twins: Twins) -> None:
    twins.package("a")
    twins.package("b", "<depend>a</depend>")
    ours, theirs = twins.agree("build", "--packages-select", "b")
    assert ours.code
    twins.package("a", folder="another_a")
    assert twins.agree("build")[0].code
    assert not twins.agree("build", "--packages-select", "b", "--packages-skip", "a")[0].out.startswith(
        "Starting"
    )
    ours, theirs = twins.agree("build", "--packages-up-to", "nobody")
    assert ours.code
    ours, theirs = twins.agree("build", "--packages-select-regex", "nobody")
    assert told(ours) == told(theirs) == ["Summary: 0 packages finished"]


MEANT = {
    "rejects a cycle that only a `test_depend` closes": ("<test_depend>b</test_depend>", "cmake"),
}
"""Lines of the page, each with a package that shows the difference."""


def test_both_tools_skip_packages_of_unknown_build_types(twins: Twins) -> None:
    """Unless one is selected by name: colcon skips it, and builds nothing."""
    twins.package("a")
    twins.package("b")
    twins.write("src/a/package.xml", manifest_text("a", build_type="wierd"))
    ours, theirs = twins.agree("build")
    assert told(ours) == told(theirs)
    ours, theirs = twins.run("build", "--packages-select", "a")
    assert (ours.code, theirs.code) == (2, 0)
    line = "| skips packages of an unknown build type, with a warning, also if they are selected |"
    assert line in (ROOT / "docs/reference/from-colcon.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("line", MEANT)
def test_documented_build_differences_exist(twins: Twins, line: str) -> None:
    need, build_type = MEANT[line]
    twins.package("a")
    twins.write("src/a/package.xml", manifest_text("a", need, build_type=build_type))
    twins.package("b", "<depend>a</depend>" if "test" in need else "")
    ours, theirs = twins.run("build")
    assert (ours.code == 0) != (theirs.code == 0)
    assert f"| {line} |" in (ROOT / "docs/reference/from-colcon.md").read_text(encoding="utf-8")


PEAR = """<package packagerversion="1.9.5" version="2.0" xmlns="http://pear.php.net/dtd/package-2.0">
<name>grpc</name><channel>pecl.php.net</channel><version><release>1.0.0</release></version></package>
"""
"""The package.xml that gRPC and other sources have for PHP."""


@pytest.mark.parametrize("file", ["CMakeLists.txt", "setup.py", "README"])
def test_foreign_package_xml_files_are_not_ros_packages(twins: Twins, file: str) -> None:
    contents = {
        "CMakeLists.txt": "cmake_minimum_required(VERSION 3.5)\nproject(grpc NONE)\ninstall(CODE [[]])\n",
        "setup.py": "from setuptools import setup\nsetup(name='grpc', packages=[])\n",
        "README": "",
    }
    twins.package("a")
    twins.write("src/vendor/package.xml", PEAR)
    twins.write(f"src/vendor/{file}", contents[file])
    ours, theirs = twins.agree("build", *ONE)
    assert (ours.code, theirs.code) == (0, 0)
    assert told(ours) == told(theirs)
    assert "vendor/package.xml: warning: the file is not a manifest of ROS" in ours.err


def test_cmake_warnings_about_forge_do_not_fail_builds(twins: Twins) -> None:
    twins.package("a")
    ours, theirs = twins.agree("build", "--cmake-args", "--warn-uninitialized", "-Werror=dev")
    assert (ours.code, theirs.code) == (0, 0)
    assert ours.err == ""


def test_both_tools_reject_folders_of_another_layout(twins: Twins) -> None:
    twins.package("a")
    assert twins.agree("build")[0].code == 0
    assert twins.agree("build", "--merge-install")[0].code
    for root in twins.roots:
        (root / "build/.built_by").write_text("ament_tools")
    assert twins.agree("build")[0].code


def test_both_tools_pass_the_same_options_to_cmake(twins: Twins) -> None:
    twins.package("a", more='file(WRITE "${CMAKE_BINARY_DIR}/said" "[${X}][${Y}][${CMAKE_BUILD_TYPE}]")')
    twins.write("src/a/colcon.pkg", "cmake-args: [-DY=package]\n")
    twins.write("colcon.meta", "names: {a: {cmake-args: ['-DCMAKE_BUILD_TYPE=Debug']}}\n")
    twins.write("colcon_defaults.yaml", "build: {cmake-args: [-DX=default, -Wno-dev]}\n")
    for options in ((), ("--cmake-args", "-DX=a b", " -DY=line", "-G", "Unix Makefiles"), ("--metas",)):
        # CMake's cache keeps what colcon's users do not say any more; forge begins with another one.
        twins.agree("build", "--cmake-clean-cache", *options)
        said = [(root / "build/a/said").read_text() for root in twins.roots]
        assert said[0] == said[1], options
