"""The command lines that test a package."""

from dataclasses import replace
from pathlib import Path

import pytest

from forge.base.layout import Layout
from forge.build.tasks import TEST_FAILURES, Step
from forge.build.tests.options import TestOptions
from forge.build.tests.recipes import (
    TestContext,
    ctest_recipe,
    framework,
    python_recipe,
)
from forge.workspace.model import Package
from tests.packages import package

CONTEXT = TestContext(
    root=Path("/ws"),
    layout=Layout(Path("/ws/build"), Path("/ws/install"), None),
    python=Path("/usr/bin/python3"),
    ctest=Path("/usr/bin/ctest"),
    modules=frozenset({"pytest"}),
)
PY = package("p", build_type="ament_python")
CM = package("c", build_type="cmake")


def with_options(**options: object) -> TestContext:
    modules = options.pop("modules", CONTEXT.modules)
    return replace(CONTEXT, modules=modules, options=TestOptions(**options))  # type: ignore[arg-type]


def only(steps: tuple[Step, ...]) -> tuple[str, ...]:
    (step,) = steps
    return step.argv


def test_ctest_gets_the_same_arguments_as_from_colcon() -> None:
    recipe = ctest_recipe(CM, CONTEXT, "Debug")
    assert only(recipe.steps) == (
        *("/usr/bin/ctest", "-C", "Debug", "-D", "ExperimentalTest", "--no-compress-output", "-V"),
        "--force-new-ctest-process",
    )
    assert recipe.steps[0].meaning(8) == TEST_FAILURES
    assert recipe.steps[0].meaning(1) is None
    assert Path("/ws/build/c/test_results/c/*.xml") in recipe.clean


def test_running_selected_tests_keeps_the_results_of_others() -> None:
    recipe = ctest_recipe(CM, with_options(ctest_args=("-R", "one")), "Debug")
    assert recipe.clean == (Path("/ws/build/c/Testing/TAG"),)


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
def test_a_package_chooses_its_test_framework(
    of: Package, wants: frozenset[str], option: str | None, expected: str
) -> None:
    assert framework(of, with_options(python_testing=option), wants) == expected


def test_package_settings_follow_global_options() -> None:
    settings = {"ctest-args": ["-R", "x"], "python-testing": "pytest", "pytest-args": "-v"}
    context = with_options(ctest_args=("-j2",)).of(replace(PY, settings=settings))
    assert context.options.ctest_args == ("-j2", "-R", "x")
    assert (context.options.python_testing, context.options.pytest_args) == ("pytest", ("-v",))
    assert CONTEXT.of(PY) is CONTEXT


def test_coverage_replaces_pytest_cov() -> None:
    """Both would trace the same lines."""
    context = with_options(coverage=True, modules=frozenset({"pytest", "pytest_cov", "coverage"}))
    words = only(python_recipe(PY, context, {"pytest", "pytest-cov"}).steps)
    assert "--no-cov" in words
    assert not any(word.startswith("--cov") for word in words)
