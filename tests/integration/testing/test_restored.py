"""Tests of packages whose installed files came from the package cache."""

import json
import shutil
from pathlib import Path

import pytest

from tests.conftest import Forge, Ran, Tree
from tests.packages import manifest_text
from tests.testable import PYTEST, cmake_package, python_package

pytestmark = pytest.mark.needs("cmake", "ctest", "ninja")

TEST = ("test", "--return-code-on-test-failure")
BAD = """
add_custom_target(program ALL COMMAND ${CMAKE_COMMAND} -E touch ${CMAKE_BINARY_DIR}/program)
set(command "test -e ${CMAKE_BINARY_DIR}/program && cat ${CMAKE_SOURCE_DIR}/text && exit 1")
add_test(NAME bad COMMAND sh -c "${command}")
"""
GOOD = BAD.replace("exit 1", "exit 0").replace("NAME bad", "NAME good")
AMENT = """cmake_minimum_required(VERSION 3.18)
project(ament NONE)
find_package(ament_cmake REQUIRED)
find_package(good REQUIRED)
if(BUILD_TESTING)
  ament_add_test(bad COMMAND false)
endif()
ament_package()
"""


def packages() -> dict[str, str]:
    """Return packages of several build types, one of which depends on another."""
    config = "\ninstall(FILES good-config.cmake DESTINATION lib/cmake/good)\n"
    return {
        **cmake_package("good", GOOD + config),
        "src/good/text": "first",
        "src/good/good-config.cmake": "",
        **cmake_package("none"),
        **python_package("p", PYTEST.format(name="p"), pytest=True),
        "src/ament/package.xml": manifest_text("ament", "<depend>ament_cmake</depend><depend>good</depend>"),
        "src/ament/CMakeLists.txt": AMENT,
    }


def tree_of(folder: Path) -> dict[str, tuple[bytes, int]]:
    """Return the contents and times of all files below a folder."""
    found = (path for path in folder.rglob("*") if path.is_file())
    return {str(path): (path.read_bytes(), path.stat().st_mtime_ns) for path in found}


def restore(forge: Forge, root: Path, *options: str) -> Ran:
    """Build with a cache, and again in a fresh clone."""
    build = ("build", "--cache", str(root / "cache"), *options)
    assert forge(*build, cwd=root).code == 0
    for name in ("build", "install", "log"):
        shutil.rmtree(root / name)
    ran = forge(*build, cwd=root)
    assert ran.code == 0
    return ran


@pytest.mark.parametrize("layout", [(), ("--merge-install",)])
def test_all_packages_are_tested_after_a_restore(forge: Forge, tree: Tree, layout: tuple[str, ...]) -> None:
    root = tree(packages())
    built = ("build", "--cache", str(root / "cache"), *layout)
    assert forge(*built, cwd=root).code == 0
    first = forge(*TEST, *layout, cwd=root)
    told = [line for line in first.out.splitlines() if " tests, " in line]
    restore(forge, root, *layout)
    before = tree_of(root / "install")
    ran = forge(*TEST, *layout, cwd=root)
    assert ran.code == 1
    assert [line for line in ran.out.splitlines() if " tests, " in line] == told
    assert "building the tests of " in ran.out
    assert "building the tests of " not in forge(*TEST, *layout, cwd=root).out
    # Without tests there is nothing to build for them.
    assert not (root / "build/none/CMakeCache.txt").exists()
    assert tree_of(root / "install") == before
    assert "Starting" not in forge(*built, cwd=root).out


def test_results_of_restored_packages_can_be_written_elsewhere(forge: Forge, tree: Tree) -> None:
    root = tree({**cmake_package("p", BAD), "src/p/text": ""})
    option = ("--test-result-base", "results")
    restore(forge, root, *option)
    ran = forge(*TEST, *option, cwd=root)
    assert ran.code == 1
    assert "1 test, 0 errors, 1 failure" in ran.out
    assert "\n1 failed test:\n" in ran.out
    assert forge("test-result", *option, cwd=root).code == 1


def test_tests_are_not_run_if_sources_changed_after_a_restore(forge: Forge, tree: Tree) -> None:
    root = tree({**cmake_package("p", BAD), "src/p/text": "first"})
    build = ("build", "--cache", str(root / "cache"))
    bad = (root / "src/p/CMakeLists.txt").read_text()
    assert forge(*build, cwd=root).code == 0
    (root / "src/p/CMakeLists.txt").write_text(bad.replace("exit 1", "exit 0"))
    assert forge(*build, cwd=root).code == 0
    (root / "src/p/CMakeLists.txt").write_text(bad)
    assert "came from the cache" in forge(*build, cwd=root).out
    # The build folder has the test program of the second build, which would pass.
    assert forge(*TEST, cwd=root).code == 1


def test_a_failed_build_for_tests_fails_the_test_run(forge: Forge, tree: Tree) -> None:
    outside = tree({}) / "outside"
    outside.write_text("")
    broken = f'add_custom_target(needy ALL COMMAND cat "{outside}")\n' + GOOD
    root = tree({**cmake_package("p", broken), **cmake_package("q", GOOD)})
    tree({"src/p/text": "", "src/q/text": ""})
    restore(forge, root)
    outside.unlink()
    ran = forge("test", "--json", cwd=root)
    assert ran.code == 1
    summary = json.loads(ran.out.splitlines()[-1])
    assert (summary["code"], summary["not_tested"], summary["tests"]["tests"]) == (1, ["p"], 1)
    assert forge("test-result", cwd=root).code == 1
    outside.write_text("")
    assert forge(*TEST, cwd=root).code == 0
    assert forge("test-result", cwd=root).code == 0


def test_tests_that_cannot_run_are_counted(forge: Forge, tree: Tree) -> None:
    root = tree({**cmake_package("p", GOOD), "src/p/text": "", **cmake_package("q", GOOD), "src/q/text": ""})
    restore(forge, root)
    shutil.rmtree(root / "build/p")
    ran = forge(*TEST, cwd=root)
    assert ran.code == 1
    assert "1 package not tested: p" in ran.out
    assert "warning: 'p' cannot be tested" in ran.err
    assert "hint: forge build --force --packages-select p" in ran.err
    assert 'errors="1"' in (root / "build/p/test_results/p/not_run.xml").read_text()
    assert forge("test", cwd=root).code == 0
    forge("build", "--force", "--packages-select", "p", cwd=root)
    assert forge(*TEST, cwd=root).code == 0
    assert not (root / "build/p/test_results/p/not_run.xml").exists()


def test_a_test_run_without_tests_is_reported(forge: Forge, tree: Tree, built: Tree) -> None:
    root = built(cmake_package("p"))
    ran = forge("test", cwd=root)
    assert ran.code == 0
    assert "  no test ran\n" in ran.out
    assert forge("test", "--fail-if-no-tests", cwd=root).code == 1
    (root / "forge.toml").write_text("[test]\nfail-if-no-tests = true\n")
    assert forge("test", cwd=root).code == 1
    tree({**cmake_package("p", GOOD), "src/p/text": ""})
    assert forge("build", cwd=root).code == 0
    assert forge("test", cwd=root).code == 0
