"""Tests that are repeated until they pass: all attempts are kept, and flaky tests are reported."""

import json
from xml.etree import ElementTree as ET

import pytest

from tests.conftest import Forge, Tree
from tests.testable import cmake_package, counted_results, python_package

pytestmark = pytest.mark.needs("cmake")

FLAKY = 'test -f "$1" || { touch "$1"; echo "not yet"; exit 1; }'
JUNIT = r"""
mkdir -p test_results/p
failure=""
test -f junit_flag || failure='<failure message="unlucky">at first</failure>'
{
  echo "<testsuite><testcase classname=\"p.Suite\" name=\"flaky\">$failure</testcase>"
  echo "<testcase classname=\"p.Suite\" name=\"good\"/></testsuite>"
} > test_results/p/junit.gtest.xml
touch junit_flag
test -z "$failure"
"""
PYTEST = """import pathlib
import pytest

def test_flaky(capsys):
    flag = pathlib.Path(__file__).with_name("flag")
    text = flag.read_text() if flag.exists() else ""
    flag.write_text(text + "x")
    assert len(text) == 2

def test_good():
    pass

def test_bad():
    assert False
"""


def test_flaky_tests_are_reported_and_all_attempts_kept(forge: Forge, built: Tree) -> None:
    root = built(
        {
            **cmake_package(
                "p",
                "add_test(NAME flaky COMMAND sh ${CMAKE_SOURCE_DIR}/flaky.sh ${CMAKE_BINARY_DIR}/flag)",
                "add_test(NAME junit COMMAND sh ${CMAKE_SOURCE_DIR}/junit.sh)",
                'add_test(NAME good COMMAND sh -c "true")',
                'add_test(NAME bad COMMAND sh -c "exit 1")',
            ),
            "src/p/flaky.sh": FLAKY,
            "src/p/junit.sh": JUNIT,
            **python_package("y", PYTEST, pytest=True),
        }
    )
    ran = forge("test", "--retest-until-pass", "2", cwd=root)
    assert "8 tests, 0 errors, 2 failures, 0 skipped  (3 flaky)\n" in ran.out, ran.out
    table = ran.out.partition("3 flaky tests:\n")[2].partition("\n\n")[0]
    assert "  p: Suite.flaky (passed at attempt 2)\n      unlucky\n" in table
    assert "  p: flaky (passed at attempt 2)\n      not yet\n" in table
    assert "  y: tests.test_y.test_flaky (passed at attempt 3)\n      AssertionError: assert 0 == 2" in table
    assert counted_results(root / "build") == "8 tests, 0 errors, 2 failures, 0 skipped"
    # Files of JUnit contain the failures of earlier attempts.
    found = {}
    for file in ("y/pytest.xml", "p/test_results/p/junit.gtest.xml"):
        for case in ET.parse(root / "build" / file).getroot().iter("testcase"):
            found[case.get("name")] = [child.tag for child in case]
    assert found["test_flaky"] == ["flakyFailure", "flakyFailure"]
    assert found["test_bad"] == ["failure", "rerunFailure", "rerunFailure"]
    assert found["flaky"] == ["flakyFailure"]
    assert found["test_good"] == found["good"] == []
    logs = root / "log/latest_test"
    assert b"unlucky" in (logs / "p/attempt_1/junit.gtest.xml").read_bytes()
    assert b"not yet" in (logs / "p/attempt_1/Test.xml").read_bytes()
    assert b"assert 1 == 2" in (logs / "y/attempt_2/pytest.xml").read_bytes()
    # Flaky tests are events, too.
    for flag in ("flag", "junit_flag"):
        (root / "build/p" / flag).unlink()
    ran = forge("test", "p", "--retest-until-pass", "1", "--json", cwd=root)
    events = [json.loads(line) for line in ran.out.splitlines()]
    flaky = {each["test"]: each for each in events if each["event"] == "FlakyTest"}
    assert flaky.keys() == {"flaky", "Suite.flaky"}
    assert (flaky["flaky"]["passed_at"], flaky["flaky"]["message"]) == (2, ["not yet"])


def test_tests_that_pass_at_the_first_attempt_are_not_flaky(forge: Forge, built: Tree) -> None:
    root = built(cmake_package("p", 'add_test(NAME good COMMAND sh -c "true")'))
    ran = forge("test", "--retest-until-pass", "3", cwd=root)
    assert "1 test, 0 errors, 0 failures, 0 skipped\n" in ran.out
    assert not list((root / "log/latest_test").rglob("attempt_*"))
