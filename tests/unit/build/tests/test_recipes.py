"""The command lines that test a package."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from forge.base.layout import Layout
from forge.build.tasks import TEST_FAILURES, Step, StepCondition
from forge.build.tests.options import TestOptions
from forge.build.tests.recipes import (
    PackageTests,
    TestContext,
    ctest_recipe,
    framework,
    missing_result,
    pytest_recipe,
    python_recipe,
    unittest_recipe,
)
from tests.packages import package

if TYPE_CHECKING:
    from forge.workspace.model import Package

CONTEXT = TestContext(
    root=Path("/ws"),
    layout=Layout(Path("/ws/build"), Path("/ws/install"), None),
    python=Path("/usr/bin/python3"),
    ctest=Path("/usr/bin/ctest"),
    modules=frozenset({"pytest"}),
)
PY = package("p", build_type="ament_python")
CM = package("c", build_type="cmake")
DEBUG = PackageTests(configuration="Debug")


def with_options(**options: object) -> TestContext:
    """Return the context with other options."""
    modules = options.pop("modules", CONTEXT.modules)
    return replace(CONTEXT, modules=modules, options=TestOptions(**options))  # type: ignore[arg-type]


def only(steps: tuple[Step, ...]) -> tuple[str, ...]:
    """Return the words of the one step."""
    (step,) = steps
    return step.argv


def test_ctest_is_started_as_colcon_starts_it() -> None:
    recipe = ctest_recipe(CM, CONTEXT, DEBUG)
    assert only(recipe.steps) == (
        *("/usr/bin/ctest", "-C", "Debug", "-D", "ExperimentalTest", "--no-compress-output", "-V"),
        "--force-new-ctest-process",
    )
    assert recipe.steps[0].meaning(8) == TEST_FAILURES
    assert recipe.steps[0].meaning(1) is None
    assert Path("/ws/build/c/test_results/c/*.xml") in recipe.clean


def test_ctest_takes_a_configuration_from_its_words() -> None:
    words = only(ctest_recipe(CM, with_options(ctest_args=("-C", "X")), DEBUG).steps)
    assert words.count("-C") == 1
    assert words[-2:] == ("-C", "X")


def test_some_tests_leave_the_results_of_others_alone() -> None:
    recipe = ctest_recipe(CM, with_options(ctest_args=("-R", "one")), DEBUG)
    assert recipe.clean == (Path("/ws/build/c/Testing/TAG"),)


def test_without_ctest_tests_there_is_nothing_to_do() -> None:
    assert ctest_recipe(CM, CONTEXT, PackageTests()).steps == ()


def test_ctest_repeats_by_itself_while_tests_pass_and_is_started_again_for_failed_ones() -> None:
    words = only(ctest_recipe(CM, with_options(retest_until_fail=2), DEBUG).steps)
    assert words[-2:] == ("--repeat-until-fail", "3")
    steps = ctest_recipe(CM, with_options(retest_until_pass=2), DEBUG).steps
    assert [step.condition for step in steps] == [
        StepCondition.ALWAYS,
        StepCondition.TESTS_FAILED,
        StepCondition.TESTS_FAILED,
    ]
    assert all(step.argv[-1] == "--rerun-failed" for step in steps[1:])


@pytest.mark.parametrize(
    ("context", "words", "count"),
    [
        ({"retest_until_fail": 2, "modules": frozenset({"pytest_repeat"})}, "--count=3", 1),
        ({"retest_until_pass": 2, "modules": frozenset({"pytest_rerunfailures"})}, "--reruns=2", 1),
        ({"retest_until_fail": 2}, "--tb=short", 3),
        ({"retest_until_pass": 2}, "--tb=short", 3),
        ({"pytest_with_coverage": True, "modules": frozenset({"pytest_cov"})}, "--cov=/ws/src/p", 1),
        ({"pytest_args": ("-k", "x")}, "x", 1),
    ],
)
def test_pytest_repeats_with_its_plugins_or_is_started_again(
    context: dict[str, object], words: str, count: int
) -> None:
    recipe = pytest_recipe(PY, with_options(**context), PackageTests())
    assert words in recipe.steps[0].argv
    assert len(recipe.steps) == count
    until_fail = "retest_until_fail" in context
    condition = StepCondition.TESTS_PASSED if until_fail else StepCondition.TESTS_FAILED
    assert all(step.condition is condition for step in recipe.steps[1:])


def test_a_package_that_wants_coverage_gets_it_where_it_can_be() -> None:
    wants = PackageTests(wants=frozenset({"pytest-cov"}))
    with_plugin = replace(CONTEXT, modules=frozenset({"pytest_cov"}))
    assert "--cov-branch" in pytest_recipe(PY, with_plugin, wants).steps[0].argv
    assert "--cov-branch" not in pytest_recipe(PY, CONTEXT, wants).steps[0].argv
    assert dict(pytest_recipe(PY, with_plugin, wants).steps[0].env) == {
        "COVERAGE_FILE": "/ws/build/p/.coverage"
    }


@pytest.mark.parametrize(
    ("of", "wants", "option", "expected"),
    [
        (PY, frozenset(), None, "unittest"),
        (PY, frozenset({"pytest"}), None, "pytest"),
        (PY, frozenset({"pytest"}), "unittest", "unittest"),
        (PY, frozenset({"pytest"}), "setuppy_test", "unittest"),
        (PY, frozenset(), "pytest", "pytest"),
        (package("p", "python3-pytest"), frozenset(), None, "pytest"),
    ],
)
def test_a_package_says_what_tests_it(
    of: Package, wants: frozenset[str], option: str | None, expected: str
) -> None:
    assert framework(of, with_options(python_testing=option), PackageTests(wants=wants)) == expected


def test_settings_of_a_package_come_after_the_options_of_all() -> None:
    settings = {"ctest-args": ["-R", "x"], "python-testing": "pytest", "pytest-args": "-v"}
    context = with_options(ctest_args=("-j2",)).of(replace(PY, settings=settings))
    assert context.options.ctest_args == ("-j2", "-R", "x")
    assert (context.options.python_testing, context.options.pytest_args) == ("pytest", ("-v",))
    assert CONTEXT.of(PY) is CONTEXT


def test_a_result_stands_before_there_is_one() -> None:
    recipe = python_recipe(PY, with_options(test_result_base=Path("/r")), PackageTests())
    assert recipe.files == ((Path("/r/p/unittest.xml"), missing_result(PY, "unittest")),)
    assert 'errors="1"' in recipe.files[0][1]


def test_coverage_runs_pytest_and_unittest_below_coverage_py() -> None:
    words = only(pytest_recipe(PY, with_options(coverage=True), PackageTests()).steps)
    assert words[:4] == ("/usr/bin/python3", "-m", "coverage", "run")
    assert f"--source=/ws/{PY.path}" in words
    assert words[words.index("--omit=setup.py,test/*,tests/*") + 1 :][:2] == ("-m", "pytest")
    step = unittest_recipe(PY, with_options(coverage=True), PackageTests()).steps[0]
    assert step.argv[1:4] == ("-m", "coverage", "run")
    assert step.env == (("COVERAGE_FILE", "/ws/build/p/.coverage"),)


def test_coverage_takes_the_place_of_pytest_cov() -> None:
    """Both would trace the same lines."""
    context = with_options(coverage=True, modules=frozenset({"pytest", "pytest_cov", "coverage"}))
    words = only(pytest_recipe(PY, context, PackageTests(wants=frozenset({"pytest-cov"}))).steps)
    assert "--no-cov" in words
    assert not any(word.startswith("--cov") for word in words)
