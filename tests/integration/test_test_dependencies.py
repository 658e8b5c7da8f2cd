"""Dependencies that only tests need may be left out: with BUILD_TESTING=OFF, or --no-test-dependencies."""

import json
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text

pytestmark = pytest.mark.needs("cmake")

OFF = ("--cmake-args", "-DBUILD_TESTING=OFF")
WITHOUT = ("--no-test-dependencies",)
LISTS = """cmake_minimum_required(VERSION 3.18)
project({0} NONE)
include(CTest)
if(BUILD_TESTING)
  {1}
  add_test(NAME {0} COMMAND ${{CMAKE_COMMAND}} -E true)
endif()
install(FILES package.xml DESTINATION share/{0})
{2}
"""
CONFIG = 'file(WRITE ${{CMAKE_BINARY_DIR}}/{0}Config.cmake "")\n'
CONFIG += "install(FILES ${{CMAKE_BINARY_DIR}}/{0}Config.cmake DESTINATION share/{0}/cmake)"
PYTHON = 'from setuptools import setup\nsetup(name="{0}", version="0.1.0", py_modules=[])\n'


def package(name: str, depends: str = "", find: str = "", build_type: str = "cmake") -> dict[str, str]:
    files = {f"src/{name}/package.xml": manifest_text(name, depends, build_type=build_type)}
    if build_type == "cmake":
        text = LISTS.format(name, find and f"find_package({find} REQUIRED)", CONFIG.format(name))
        return files | {f"src/{name}/CMakeLists.txt": text}
    return files | {f"src/{name}/setup.py": PYTHON.format(name)}


@pytest.fixture
def workspace(tree: Tree) -> Path:
    """Make two packages with test dependencies, one of CMake and one of Python, and one without."""
    return tree(
        {
            **package("lint"),
            **package("low"),
            **package("top", "<depend>low</depend><test_depend>lint</test_depend>", "lint"),
            **package("script", "<depend>top</depend><test_depend>lint</test_depend>", "", "ament_python"),
        }
    )


def built(forge: Forge, root: Path, *options: str) -> set[str]:
    ran = forge("build", *options, cwd=root)
    assert ran.code == 0, ran.err
    return {line.split()[2] for line in ran.out.splitlines() if line.startswith("Finished <<<")}


@pytest.mark.parametrize("options", [OFF, WITHOUT])
def test_packages_up_to_can_exclude_test_dependencies(
    options: tuple[str, ...], forge: Forge, workspace: Path
) -> None:
    assert built(forge, workspace, "--packages-up-to", "top", *options) == {"low", "top"}
    assert built(forge, workspace, "--packages-up-to", "script", *options) == {"script"}
    assert built(forge, workspace, "--packages-up-to", "script") >= {"lint", "top", "script"}


@pytest.mark.parametrize("options", [OFF, WITHOUT])
@pytest.mark.parametrize("way", ["--packages-skip", "--packages-ignore"])
def test_a_skipped_test_dependency_stops_nothing(
    way: str, options: tuple[str, ...], forge: Forge, workspace: Path
) -> None:
    assert built(forge, workspace, way, "lint", *options) == {"low", "top", "script"}


def test_a_missing_test_dependency_gives_a_hint_about_the_option(forge: Forge, workspace: Path) -> None:
    ran = forge("build", "--packages-skip", "lint", cwd=workspace)
    assert ran.code == 2
    assert "or pass '--no-test-dependencies': only tests need them" in ran.err
    ran = forge("build", "--packages-skip", "low", cwd=workspace)
    assert ran.code == 2
    assert "--no-test-dependencies" not in ran.err


@pytest.mark.parametrize(
    "files",
    [
        {"forge.toml": "[build]\nno-test-dependencies = true\n"},
        {"forge.toml": '[build]\ncmake-args = ["-DBUILD_TESTING=OFF"]\n'},
        {"colcon_defaults.yaml": "build:\n  cmake-args: [-D, 'BUILD_TESTING:BOOL=0']\n"},
        {"colcon.meta": "{names: {top: {cmake-args: [-DBUILD_TESTING=off]}}}\n"},
    ],
)
def test_configuration_files_can_exclude_test_dependencies(
    files: dict[str, str], forge: Forge, tree: Tree, workspace: Path
) -> None:
    tree(files)
    assert built(forge, workspace, "--packages-up-to", "top") == {"low", "top"}


@pytest.mark.parametrize(
    ("meta", "options"),
    [
        ("{names: {top: {cmake-args: [-DBUILD_TESTING=ON]}}}\n", OFF),
        ("{names: {low: {cmake-args: [-DBUILD_TESTING=OFF]}}}\n", ()),
        ("{}", ("--ament-cmake-args", "-DBUILD_TESTING=OFF")),
        ("{}", ("--cmake-args", "-DBUILD_TESTING=OFF", "-DBUILD_TESTING=ON")),
    ],
)
def test_package_options_take_precedence(
    meta: str, options: tuple[str, ...], forge: Forge, tree: Tree, workspace: Path
) -> None:
    """Its own arguments come after those of all packages, and the last one counts."""
    tree({"colcon.meta": meta})
    assert built(forge, workspace, "--packages-up-to", "top", *options) == {"low", "lint", "top"}


@pytest.mark.parametrize("way", ["options", "forge.toml"])
def test_a_package_with_enabled_tests_keeps_its_test_dependencies(
    way: str, forge: Forge, tree: Tree, workspace: Path
) -> None:
    """`--no-test-dependencies` and -DBUILD_TESTING=ON contradict each other: the tests could not be built."""
    on = ("--cmake-args", "-DBUILD_TESTING=ON") if way == "options" else ()
    if way == "forge.toml":
        tree({"forge.toml": "[packages.top]\ncmake-args = ['-DBUILD_TESTING=ON']\n"})
    ran = forge("build", "--packages-up-to", "top", *WITHOUT, *on, cwd=workspace)
    assert ran.code == 0, ran.err
    assert "Finished <<< lint" in ran.out
    assert "warning: '--no-test-dependencies' has no effect on 'top': BUILD_TESTING is turned on\n" in ran.err


def test_list_graph_and_deps_select_the_same_packages(forge: Forge, tree: Tree, workspace: Path) -> None:
    tree(package("more", "<test_depend>python3-pytest</test_depend>"))
    names = forge("list", "--packages-up-to", "top", "--names-only", *WITHOUT, cwd=workspace).out.split()
    assert names == ["low", "top"]
    (graph,) = [forge("graph", "--json", *WITHOUT, cwd=workspace).out]
    assert "lint" not in json.dumps([row for row in json.loads(graph)["packages"] if row["name"] == "top"])
    assert "pytest" not in forge("deps", *WITHOUT, cwd=workspace).out


def test_the_option_rebuilds_only_affected_packages(forge: Forge, workspace: Path) -> None:
    """A CMake package with such dependencies is configured without tests; others do not change."""
    built(forge, workspace, "--packages-skip", "script")
    ran = forge("build", "--packages-skip", "script", "--explain", *WITHOUT, cwd=workspace)
    assert ran.err == "options changed since the last build: -DBUILD_TESTING=OFF; 1 package is rebuilt\n"
    assert "top: build, the option '-DBUILD_TESTING=OFF' was added\n" in ran.out
    assert "2 packages: up to date\n" in ran.out
    assert built(forge, workspace, "--packages-skip", "script", *WITHOUT) == set()
    built(forge, workspace, "--packages-select", "script", *WITHOUT)
    ran = forge("build", "--explain", "--packages-select", "script", "lint", cwd=workspace)
    assert "script: build, the dependency 'lint' was added\n" in ran.out


def test_packages_built_without_tests_are_reported(forge: Forge, workspace: Path) -> None:
    built(forge, workspace, "--packages-up-to", "top", *OFF)
    ran = forge("test", "--packages-select", "top", "--return-code-on-test-failure", cwd=workspace)
    assert ran.code == 0, ran.err
    assert "warning: 'top' was built without tests\nhint: build without -DBUILD_TESTING=OFF and " in ran.err
    built(forge, workspace, "--packages-up-to", "top")
    ran = forge("test", "--packages-select", "top", cwd=workspace)
    assert "built without tests" not in ran.err
    assert "1 test, 0 errors" in ran.out


def test_embedded_linters_do_not_replace_test_dependencies(forge: Forge, tree: Tree) -> None:
    """The real ones are ignored: the embedded ones would get into the prefix of a real ROS."""
    root = tree({**package("a", "<test_depend>ament_lint_auto</test_depend>"), **package("ament_lint_auto")})
    ignoring = ("--packages-ignore", "ament_lint_auto", "--merge-install")
    assert built(forge, root, *ignoring, *WITHOUT) == {"a"}
    assert not (root / "install/share/ament_lint_auto").exists()
