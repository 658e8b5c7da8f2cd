"""Packages with tests, which cost little to build, and workspaces that are built once for many tests."""

import shutil
from collections.abc import Mapping
from pathlib import Path

import pytest

from forge.base.extensions import OPTIONS, OWN, is_installed
from forge.cli.main import main
from forge.testing.collecting import collect
from forge.testing.outcomes import Counts, counted_once
from tests.conftest import Ran, surroundings
from tests.packages import manifest_text, write_files


def needs_plugin(name: str) -> pytest.MarkDecorator:
    """Return the marker of a test that another plugin of the group `forge.options` takes part in."""
    plugin = OWN[OPTIONS][name].split(".")[2]
    return pytest.mark.skipif(
        not is_installed(OPTIONS, name), reason=f"the plugin '{plugin}' is not installed"
    )


def counted_results(base: Path) -> str:
    """Return the numbers of tests in the result files below a folder, as `forge test-result` prints them."""
    return str(sum((each.counts for each in counted_once(collect(base).outcomes)), Counts()))


CMAKE = """cmake_minimum_required(VERSION 3.18)
project({name} NONE)
enable_testing()
{tests}
install(FILES package.xml DESTINATION share/{name})
"""

SETUP = """from setuptools import setup
setup(
    name="{name}", version="0.1.0", packages=["{name}"], {more}
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/{name}"]),
        ("share/{name}", ["package.xml"]),
    ],
)
"""


def cmake_package(name: str, *tests: str, needs: str = "") -> dict[str, str]:
    """Return a plain CMake package with lines that add tests."""
    return {
        f"src/{name}/package.xml": manifest_text(name, needs, build_type="cmake"),
        f"src/{name}/CMakeLists.txt": CMAKE.format(name=name, tests="\n".join(tests)),
    }


def python_package(name: str, test: str, *, pytest: bool) -> dict[str, str]:
    """Return an ament_python package whose tests are one module."""
    more = 'extras_require={"test": ["pytest"]},' if pytest else ""
    return {
        f"src/{name}/package.xml": manifest_text(name, build_type="ament_python"),
        f"src/{name}/setup.py": SETUP.format(name=name, more=more),
        f"src/{name}/{name}/__init__.py": "VALUE = 1\n",
        f"src/{name}/resource/{name}": "",
        f"src/{name}/tests/__init__.py": "",
        f"src/{name}/tests/test_{name}.py": test,
    }


PYTEST = """import {name}
import pytest

def test_good():
    assert {name}.VALUE == 1

@pytest.mark.parametrize("value", [1, 2])
def test_value(value):
    assert value == 1

@pytest.mark.skip
def test_later():
    pass
"""

UNITTEST = """import unittest
import {name}

class Values(unittest.TestCase):
    def test_good(self):
        self.assertEqual({name}.VALUE, 1)

    def test_bad(self):
        self.assertEqual({name}.VALUE, 2)
"""


def built_once(root: Path, files: Mapping[str, str], *options: str) -> Path:
    """Write a workspace and build it; `restored` brings it back."""
    run_forge(write_files(root, files), "build", *options)
    save(root, "built")
    return root


def run_forge(root: Path, *words: str) -> None:
    """Run a command that must succeed as the fixture `forge` does, for fixtures that live longer."""
    with surroundings(root, {}):
        assert main(words) == 0


def save(root: Path, state: str) -> None:
    """Keep a copy of a workspace beside it."""
    shutil.copytree(root, root.with_name(f"{root.name}-{state}"), symlinks=True)


def restored(root: Path, state: str = "built") -> Path:
    """Return a workspace, in its place, as it was when it was saved."""
    shutil.rmtree(root)
    return Path(shutil.copytree(root.with_name(f"{root.name}-{state}"), root, symlinks=True))


GTEST = r"""#!/bin/sh
# Like a program of Google Test: it runs what GTEST_FILTER names, and writes a result file.
out="$1"
cases=""
failed=0
set -f
for case in Math.adds Math.subtracts Other.fails All/Param.below/0 Typed/1.size; do
  for filter in $(echo "${GTEST_FILTER:-*}" | tr : ' '); do
    case $case in $filter) break ;; *) false ;; esac
  done || continue
  echo "ran $case"
  failure=""
  case $case in Math.adds | Other.fails)
    if [ ! -f "$2" ]; then failure='<failure message="no luck"/>'; failed=1; fi ;;
  esac
  cases="$cases<testcase classname=\"p.${case%.*}\" name=\"${case#*.}\">$failure</testcase>"
done
mkdir -p "$(dirname "$out")"
echo "<testsuites><testsuite name=\"p\">$cases</testsuite></testsuites>" > "$out"
exit $failed
"""
TESTS = (
    "set(run sh ${CMAKE_SOURCE_DIR}/gtest.sh)",
    "set(result ${CMAKE_BINARY_DIR}/test_results/p/math.gtest.xml)",
    "add_test(NAME math COMMAND ${run} ${result} ${CMAKE_SOURCE_DIR}/fixed)",
    'add_test(NAME plain COMMAND sh -c "echo plain && exit 1")',
    'add_test(NAME good COMMAND sh -c "true")',
)
CASES = {
    **cmake_package("p", *TESTS),
    "src/p/gtest.sh": GTEST,
    **python_package("y", PYTEST.format(name="y"), pytest=True),
    **python_package("u", UNITTEST.format(name="u"), pytest=False),
}
"""Packages with tests that fail and pass, of each kind of test runner."""


def failed_tests(ran: Ran) -> list[str]:
    """Return the failed tests that a summary lists."""
    table = ran.out.partition(" failed test")[2]
    return [line.strip() for line in table.splitlines() if line.startswith("  ") and line[2] != " "]
