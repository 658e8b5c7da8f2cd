"""`forge test-result` prints the details of failed tests as colcon does."""

from pathlib import Path

from forge.base.xml import parse_xml
from forge.plugins.test_results.command import details
from forge.testing.outcomes import read_junit

JUNIT = """<testsuite name="pytest" tests="2" errors="1" failures="1">
  <testcase classname="p.test_a" name="test_bad" file="test_a.py" line="7">
    <failure message="assert 1 == 2&#10;  more">long
story</failure>
    <system-out>
hello
</system-out>
  </testcase>
  <testcase classname="p.test_a" name="test_worse"><error message="boom"/></testcase>
</testsuite>
"""


def test_failed_tests_are_printed_as_by_colcon() -> None:
    root = parse_xml(JUNIT.encode(), Path("r.xml"))
    bad, worse = read_junit(root, "build/p/r.xml", "build/p").cases
    assert details(bad) == [
        "- p.test_a test_bad (test_a.py:7)",
        "  <<< failure message",
        "    assert 1 == 2",
        "      more",
        "  >>>",
        "  <<< stdout output",
        "    hello",
        "  >>>",
    ]
    assert details(worse) == ["- p.test_a test_worse", "  <<< error message", "    boom", "  >>>"]
    assert bad.text == "long\nstory"
