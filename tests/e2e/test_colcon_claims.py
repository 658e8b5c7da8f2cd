"""Intended differences that docs/reference/from-colcon.md lists, shown by running both tools."""

import re
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.conftest import Forge
from tests.packages import manifest_text
from tests.peers import Twins
from tests.snippets import ROOT

pytestmark = [pytest.mark.slow, pytest.mark.needs("colcon", "cmake", "make")]


def python_package(twins: Twins, name: str, more: str = "") -> None:
    twins.write(f"src/{name}/package.xml", manifest_text(name, build_type="ament_python"))
    setup = f"setup(name='{name}', version='1', packages=['{name}'])"
    twins.write(f"src/{name}/setup.py", f"from setuptools import setup\n{more}\n{setup}\n")
    twins.write(f"src/{name}/{name}/__init__.py")


@pytest.fixture
def twins(tmp_path: Path, forge: Forge) -> Iterator[Twins]:
    running = Twins(tmp_path, forge)
    running.write("src/README")
    yield running
    running.end()


def exit_codes(twins: Twins) -> None:
    twins.package("a", more="add_custom_target(fail ALL COMMAND false)")
    ours, theirs = twins.run("build", "--cmake-args", "-GUnix Makefiles")
    assert (ours.code, theirs.code) == (1, 2)


def info_begins_with_the_workspace(twins: Twins) -> None:
    twins.package("a")
    ours, theirs = twins.run("info")
    assert ours.out.startswith(f"workspace: {twins.ours}\n")
    assert "workspace" not in theirs.out


def environments_are_not_searched(twins: Twins) -> None:
    twins.write("venv/pyvenv.cfg")
    for folder in ("venv/lib", "site-packages", "node_modules"):
        twins.write(
            f"{folder}/inside/package.xml", manifest_text(folder.replace("/", "_"), build_type="cmake")
        )
        twins.write(f"{folder}/inside/CMakeLists.txt", "project(inside)\n")
    ours, theirs = twins.run("list", "-n")
    assert ours.out == ""
    assert len(theirs.out.split()) == 3


def listing_runs_no_code(twins: Twins) -> None:
    twins.write(
        "src/p/setup.py",
        "from setuptools import setup\nopen('ran', 'w').close()\nsetup(name=''.join(['comp', 'uted']))\n",
    )
    ours, theirs = twins.run("list", "-n")
    assert ours.out.split() == ["p"]
    assert theirs.out.split() == ["computed"]
    assert not (twins.ours / "src/p/ran").exists()
    assert (twins.theirs / "src/p/ran").exists()


def info_has_no_addresses(twins: Twins) -> None:
    python_package(twins, "p")
    ours, theirs = twins.run("info", "--packages-select", "p")
    assert "get_python_setup_options" not in ours.out
    assert "get_python_setup_options" in theirs.out


def a_pyproject_is_a_package(twins: Twins) -> None:
    twins.write("src/p/pyproject.toml", '[project]\nname = "p"\nversion = "1"\n')
    ours, theirs = twins.run("list", "-n")
    assert (ours.out, theirs.out) == ("p\n", "")


def a_broken_manifest_is_reported(twins: Twins) -> None:
    twins.package("a")
    twins.write("src/b/package.xml", '<package format="3"><name>b</name>')
    twins.write("src/b/CMakeLists.txt", "project(plain)\n")
    ours, theirs = twins.run("list", "-n")
    assert ours.out == "a\n"
    assert theirs.out.split() == ["a", "plain"]
    ours, _ = twins.run("build")
    assert ours.code == 2
    assert "src/b/package.xml" in ours.err
    ours, _ = twins.run("build", "--packages-select", "a")
    assert ours.code == 0


def ros_2_is_the_default(twins: Twins) -> None:
    twins.variables = {}
    twins.package("a", '<depend condition="$ROS_VERSION == 2">b</depend>')
    twins.package("b")
    ours, theirs = twins.run("list", "-t", "-n")
    assert ours.out.split() == ["b", "a"]
    assert theirs.out.split() == ["a", "b"]


def several_build_types(twins: Twins) -> None:
    text = manifest_text("a", build_type="cmake")
    twins.write(
        "src/a/package.xml",
        text.replace("</build_type>", "</build_type><build_type>ament_cmake</build_type>"),
    )
    twins.write("src/a/CMakeLists.txt", "# nothing\n")
    ours, theirs = twins.run("list")
    assert ours.out.split() == ["a", "src/a", "(ros.ament_cmake)"]
    assert "warning" in ours.err
    assert "ament_cmake" not in theirs.out


def attributes_of_licenses(twins: Twins) -> None:
    text = manifest_text("a", build_type="cmake")
    twins.write("src/a/package.xml", text.replace("<license>", '<license type="SPDX" source-files="a b">'))
    ours, theirs = twins.run("list", "-n")
    assert (ours.out, theirs.out) == ("a\n", "")


def unreadable_manifests_are_reported(twins: Twins) -> None:
    twins.write("src/a/package.xml", "<package>")
    ours, theirs = twins.run("list", "-n")
    assert "src/a/package.xml" in ours.err
    assert "package.xml" not in theirs.err


def all_packages_of_a_name_come_first(twins: Twins) -> None:
    twins.package("lib", folder="first")
    twins.package("lib", "<depend>z</depend>", folder="second")
    twins.package("app", "<depend>lib</depend>")
    twins.package("z")
    ours, theirs = twins.run("list", "-t", "-p")
    assert ours.out.split() == ["src/first", "src/z", "src/second", "src/app"]
    assert theirs.out.split() == ["src/first", "src/z", "src/app", "src/second"]


def dependencies_of_tests_that_are_not_built(twins: Twins) -> None:
    twins.package("a", "<test_depend>b</test_depend>")
    twins.package("b")
    ours, theirs = twins.run("build", "--packages-up-to", "a", "--cmake-args", "-DBUILD_TESTING=OFF")
    assert "Finished <<< b" not in ours.out
    assert "Finished <<< b" in theirs.out


def the_shortest_cycle(twins: Twins) -> None:
    for name, need in ("ab", "ba", "cd", "de", "ec"):
        twins.package(name, f"<depend>{need}</depend>")
    ours, theirs = twins.run("list", "-t", "-n")
    assert "dependency cycle: a -> b -> a\n" in ours.err
    assert all(re.search(rf"\b{name}\b", theirs.err) for name in "abcde")


def missing_packages_are_reported_first(twins: Twins) -> None:
    twins.package("a", "<depend>rclcpp</depend>", more="find_package(rclcpp REQUIRED)")
    ours, theirs = twins.run("build")
    assert "warning: 'a' needs 'rclcpp'" in ours.err
    for ran in (ours, theirs):
        assert ran.code == 1
        assert "Starting >>> a" in ran.out
        assert "rclcppConfig.cmake" in ran.err


def forgotten_arguments(twins: Twins) -> None:
    twins.package("a", more='file(WRITE "${CMAKE_BINARY_DIR}/said" "[${X}]")')
    twins.run("build", "--cmake-args", "-DX=1")
    twins.run("build", "--cmake-force-configure")
    assert (twins.ours / "build/a/said").read_text() == "[]"
    assert (twins.theirs / "build/a/said").read_text() == "[1]"


def unreadable_results(twins: Twins) -> None:
    twins.write("build/a/test_results/a/r.xml", "<testsuite ")
    ours, theirs = twins.run("test-result")
    assert (ours.code, theirs.code) == (1, 0)


TEST = "enable_testing()\nadd_test(NAME t COMMAND ${{CMAKE_COMMAND}} -E {command})\n"


def tests_of_a_failed_build(twins: Twins) -> None:
    twins.package("a", more=TEST.format(command="true"))
    twins.run("build")
    twins.package("a", more=TEST.format(command="true") + "add_custom_target(x ALL COMMAND false)")
    twins.run("build")
    ours, theirs = twins.run("test", "--return-code-on-test-failure")
    assert (ours.code, theirs.code) == (1, 0)


def failed_runs_in_results(twins: Twins) -> None:
    twins.package("a", more=TEST.format(command="rm -r Testing"))
    twins.run("build")
    twins.run("test")
    ours, theirs = twins.run("test-result")
    assert (ours.code, theirs.code) == (1, 0)


def results_of_tests_that_are_gone(twins: Twins) -> None:
    twins.package("a", more=TEST.format(command="false"))
    twins.run("build")
    twins.run("test")
    twins.package("a")
    twins.run("build")
    twins.run("test")
    ours, theirs = twins.run("test-result")
    assert (ours.code, theirs.code) == (0, 1)


def wrong_numbers_in_results(twins: Twins) -> None:
    twins.write(
        "build/a/test_results/a/r.xml",
        '<testsuite name="s" tests="1" errors="0" failures="0" skipped="0"><testcase name="t">'
        '<failure message="m"/></testcase></testsuite>',
    )
    ours, theirs = twins.run("test-result")
    assert (ours.code, theirs.code) == (1, 0)


def only_some_commands_write_logs(twins: Twins) -> None:
    twins.package("a")
    twins.run("list")
    assert not (twins.ours / "log").exists()
    assert (twins.theirs / "log/latest_list").exists()


def unused_variables(twins: Twins) -> None:
    twins.package("a")
    twins.package("b")
    ours, theirs = twins.run("build", "--cmake-args", "-DNOBODY_USES_THIS=1")
    assert "CMake variables not used by any package: NOBODY_USES_THIS\n" in ours.out
    assert "NOBODY_USES_THIS" not in ours.err
    assert theirs.err.count("NOBODY_USES_THIS") == 2


def repeated_warnings(twins: Twins) -> None:
    for name in "ab":
        twins.package(name, more='message(DEPRECATION "this is old")')
    ours, theirs = twins.run("build", "--executor", "sequential")
    assert ours.err.count("this is old") == 1
    assert theirs.err.count("this is old") == 2


def python_packages_are_checked(twins: Twins) -> None:
    python_package(twins, "p", "import setuptools\n")
    text = (twins.ours / "src/p/setup.py").read_text()
    entry_points = "entry_points={'console_scripts': ['start = p.missing:main']}"
    twins.write("src/p/setup.py", text.replace("packages=", f"{entry_points}, packages="))
    ours, theirs = twins.run("build")
    assert (ours.code, theirs.code) == (0, 0)
    assert "p.missing" in ours.err
    assert "p.missing" not in theirs.err


def cmake_in_the_sources(twins: Twins) -> None:
    twins.package("a")
    for root in (twins.ours, twins.theirs):
        subprocess.run(["cmake", "."], cwd=root / "src/a", check=True, stdout=subprocess.DEVNULL)
    twins.run("build")
    assert (twins.ours / "build/a/CMakeCache.txt").exists()
    assert not (twins.theirs / "build/a/CMakeCache.txt").exists()


def names_that_are_unknown(twins: Twins) -> None:
    twins.package("near")
    for option in ("--packages-select", "--packages-select-by-dep"):
        ours, theirs = twins.run("list", option, "neat")
        assert (ours.code, theirs.code) == (2, 0)
        assert "did you mean 'near'?" in ours.err


def messages(twins: Twins) -> None:
    ours, theirs = twins.run("list", "--packages-skip", "nobody")
    assert ours.err.startswith("warning: ")
    assert re.match(r"\[\d.*\] WARNING:colcon\.", theirs.err)


SHOWN: dict[str, Callable[[Twins], None]] = {
    "exits with 1, 2": exit_codes,
    "`info` only describes": info_begins_with_the_workspace,
    "searches virtual environments": environments_are_not_searched,
    "runs `setup.py` to list": listing_runs_no_code,
    "prints how it reads Python metadata": info_has_no_addresses,
    "does not find packages with only": a_pyproject_is_a_package,
    "treats a folder with a broken": a_broken_manifest_is_reported,
    "warns about an unknown name": names_that_are_unknown,
    "without a sourced ROS": ros_2_is_the_default,
    "rejects a package with several": several_build_types,
    "rejects licenses": attributes_of_licenses,
    "ignores an unreadable manifest": unreadable_manifests_are_reported,
    "if two packages have the same": all_packages_of_a_name_come_first,
    "with `-DBUILD_TESTING=OFF`": dependencies_of_tests_that_are_not_built,
    "lists all packages that it cannot": the_shortest_cycle,
    "reports a missing package": missing_packages_are_reported_first,
    "a CMake argument that is no longer": forgotten_arguments,
    "ignores result files": unreadable_results,
    "tests a package whose last build failed": tests_of_a_failed_build,
    "without a result that says so": failed_runs_in_results,
    "keeps the results of tests": results_of_tests_that_are_gone,
    "trusts the numbers": wrong_numbers_in_results,
    "creates a log folder": only_some_commands_write_logs,
    "each package that does not use": unused_variables,
    "prints the same CMake warning": repeated_warnings,
    "installs Python packages without checks": python_packages_are_checked,
    "uses a source folder in which": cmake_in_the_sources,
    "stderr contains": messages,
}
"""Lines of the page, by their beginnings, and what shows them."""


@pytest.mark.parametrize("claim", SHOWN)
def test_both_tools_behave_as_documented(twins: Twins, claim: str) -> None:
    SHOWN[claim](twins)


def test_every_documented_difference_is_on_the_page() -> None:
    text = (ROOT / "docs/reference/from-colcon.md").read_text(encoding="utf-8")
    section = text.partition("\n## Intended differences\n")[2].partition("\n## ")[0]
    lines = [line.removeprefix("| ") for line in section.splitlines()]
    assert {claim: sum(line.startswith(claim) for line in lines) for claim in SHOWN} == dict.fromkeys(
        SHOWN, 1
    )
