"""Result files are counted without losing a failure."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.base.xml import parse_xml
from forge.testing.outcomes import (
    BrokenResultError,
    Counts,
    Outcome,
    counted_once,
    first_lines,
    last_lines,
    read_ctest,
    read_junit,
)

JUNIT = """<?xml version="1.0" encoding="utf-8"?>
<testsuites>
  <testsuite name="pytest" tests="3" errors="1" failures="1" skipped="1" disabled="1">
    <testcase classname="p.test_a" name="test_bad" file="test_a.py" line="7">
      <failure message="assert 1 == 2&#10;  more">long
story</failure>
      <system-out>
hello
</system-out>
    </testcase>
    <testcase classname="p.test_a" name="test_worse"><error message="boom"/></testcase>
    <testcase classname="p.test_a" name="test_good"/>
  </testsuite>
  <testsuite name="more" tests="2" failures="0"/>
</testsuites>
"""

CTEST = """<?xml version="1.0" encoding="UTF-8"?>
<Site BuildName="x"><Testing>
  <StartDateTime>now</StartDateTime>
  <Test Status="passed"><Name>one</Name></Test>
  <Test Status="failed"><Name>two</Name>
    <Results><Measurement><Value>so
bad
</Value></Measurement></Results>
  </Test>
  <Test Status="notrun"><Name>three</Name></Test>
  <Test Status="odd"><Name>four</Name></Test>
</Testing></Site>
"""


def junit(text: str) -> Outcome:
    return read_junit(parse_xml(text.encode(), Path("r.xml")), "build/p/r.xml", "build/p")


def ctest(text: str) -> Outcome:
    return read_ctest(parse_xml(text.encode(), Path("Test.xml")), "build/p/Testing/1/Test.xml", "build/p")


@pytest.mark.parametrize("number", ["-1", "many", "", "1.5"])
def test_a_result_without_valid_numbers_is_broken(number: str) -> None:
    for name in ("tests", "failures", "errors", "skipped"):
        with pytest.raises(BrokenResultError):
            junit(f"<testsuite {name}='{number}'/>")
    with pytest.raises(BrokenResultError):
        junit(f"<testsuites><testsuite><testsuite tests='{number}'/></testsuite></testsuites>")


FAILED = "<testcase name='t'><failure message='no'/></testcase>"


@pytest.mark.parametrize(
    "text",
    [
        f"<testsuite tests='0' failures='0'>{FAILED}</testsuite>",
        f"<testsuite>{FAILED}</testsuite>",
        f"<testsuites><testsuite>{FAILED}</testsuite></testsuites>",
        f"<testsuites tests='1' failures='0'><testsuite tests='1'>{FAILED}</testsuite></testsuites>",
        f"<testsuite tests='1' failures='0'><testsuite>{FAILED}</testsuite></testsuite>",
        "<testsuites tests='1' failures='1'><testsuite name='s'/></testsuites>",
        "<testsuites><testsuite><testsuite tests='1' failures='1'/></testsuite></testsuites>",
        f"<testsuites><testsuites><testsuite>{FAILED}</testsuite></testsuites></testsuites>",
        "<testsuite tests='0' errors='0' failures='0'><failure message='in its setup'/></testsuite>",
    ],
)
def test_failed_tests_count_even_if_the_totals_of_a_suite_are_too_low(text: str) -> None:
    assert junit(text).counts == Counts(tests=1, failures=1)


@pytest.mark.parametrize(
    ("completion", "counts"),
    [
        ("Disabled", Counts(1, skipped=1)),
        ("SKIP_RETURN_CODE=77", Counts(1, skipped=1)),
        ("SKIP_REGULAR_EXPRESSION_MATCHED", Counts(1, skipped=1)),
        ("Unable to find executable", Counts(1, errors=1)),
        ("Required Files Missing", Counts(1, errors=1)),
        ("Fixture dependency failed", Counts(1, errors=1)),
    ],
)
def test_a_test_that_ctest_could_not_run_is_not_counted_as_skipped(completion: str, counts: Counts) -> None:
    measured = f"<NamedMeasurement name='Completion Status'><Value>{completion}</Value></NamedMeasurement>"
    test = f"<Test Status='notrun'><Name>t</Name><Results>{measured}</Results></Test>"
    outcome = ctest(f"<Site><Testing>{test}</Testing></Site>")
    assert outcome.counts == counts
    assert [case.text for case in outcome.cases] == ([completion] if counts.errors else [])


VERDICTS = st.sampled_from([Counts(1), Counts(1, failures=1), Counts(1, errors=1), Counts(1, skipped=1)])
RUNS = st.dictionaries(
    st.sampled_from("abcd"), st.tuples(VERDICTS, st.none() | st.lists(VERDICTS, min_size=1))
)


@given(RUNS, st.sampled_from([".xml", ".catch2.xml", ".gtest.xml", ".xunit.xml"]))
def test_removing_duplicates_loses_no_tests_or_failures(
    run: dict[str, tuple[Counts, list[Counts] | None]], extension: str
) -> None:
    """Each test counts at least once, and removing duplicates hides no failure and adds none."""
    verdicts = tuple((name, said) for name, (said, _) in run.items())
    whole = Outcome(
        "build/p/Testing/1/Test.xml",
        "build/p",
        sum((said for _, said in verdicts), Counts()),
        by_name=verdicts,
    )
    files = [
        Outcome(f"build/p/test_results/p/{name}{extension}", "build/p", sum(told, Counts()))
        for name, (_, told) in run.items()
        if told is not None
    ]
    raw = [whole, *files]
    once = counted_once(raw)
    total = sum((outcome.counts for outcome in once), Counts())
    assert total.bad == any(outcome.counts.bad for outcome in raw)
    assert total.tests >= len(run)
    assert total.tests <= sum(outcome.counts.tests for outcome in raw)


def test_tests_of_different_packages_are_never_counted_as_duplicates() -> None:
    whole = ctest(CTEST)
    other = Outcome("build/q/test_results/q/one.xml", "build/q", Counts(5))
    own = Outcome("build/p/test_results/p/one.gtest.xml", "build/p", Counts(5))
    assert counted_once([whole, other])[0] == whole
    assert counted_once([whole, own])[0].counts.tests == 3


def test_error_lines_come_from_the_message_or_the_text() -> None:
    bad, worse = junit(JUNIT).cases
    assert first_lines([bad]) == ("assert 1 == 2", "  more")
    assert first_lines([bad, worse]) == (
        "test_bad:",
        "  assert 1 == 2",
        "    more",
        "test_worse:",
        "  boom",
    )
    silent = junit(
        "<testsuite tests='1' failures='1'><testcase><failure>\n why</failure></testcase></testsuite>"
    )
    assert first_lines(silent.cases) == (" why",)
    assert last_lines("a\n\nb\n") == ("a", "b")
