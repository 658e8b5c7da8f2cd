"""The test steps of each build type: CTest, pytest or unittest.

Exit codes of CTest and pytest distinguish failed tests from failed runs, and so do the steps.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.base.templating import render
from forge.build.recipes.context import Recipe
from forge.build.tasks import TEST_FAILURES, Step, StepCondition, StepKind
from forge.build.tests.options import TestOptions

if TYPE_CHECKING:
    from collections.abc import Collection

    from forge.base.layout import Layout
    from forge.workspace.model import Package

NO_TESTS = "no tests"
UNITTESTS = Path(__file__).with_name("unittests.py")
DATA_FILE = ".coverage"
OMITTED = ("setup.py", "test/*", "tests/*")
"""Files of Python packages that coverage.py does not count, relative to the package."""
_OF_CTEST = ((8, TEST_FAILURES),)
_OF_PYTHON = ((1, TEST_FAILURES), (5, NO_TESTS))


@frozen
class TestContext:
    """Folders, programs and options of a test run; `modules` are the available pytest plugins."""

    __test__ = False

    root: Path
    layout: Layout
    python: Path
    ctest: Path | None = None
    modules: frozenset[str] = frozenset()
    options: TestOptions = TestOptions()

    def source(self, package: Package) -> Path:
        return self.root / package.path

    def of(self, package: Package) -> TestContext:
        """Return the context with the package's own options added."""
        if not package.settings:
            return self
        options, values = self.options, package.option_values
        own = replace(
            options,
            python_testing=options.python_testing or next(iter(values("python-testing")), None),
            ctest_args=(*options.ctest_args, *values("ctest-args")),
            pytest_args=(*options.pytest_args, *values("pytest-args")),
            unittest_args=(*options.unittest_args, *values("unittest-args")),
        )
        return replace(self, options=own)

    def results_of(self, name: str) -> Path:
        return (self.options.test_result_base or self.layout.build) / name

    def not_run(self, name: str) -> Path:
        """Return the result file with the reason why the tests of a package did not run or complete."""
        return self.results_of(name) / "test_results" / name / "not_run.xml"


def ctest_recipe(package: Package, context: TestContext, configuration: str) -> Recipe:
    """Return the CTest run of a configuration with colcon's options; no steps if that is ''."""
    build = context.layout.build_dir(package.name)
    folders = tuple(dict.fromkeys((build, context.results_of(package.name))))
    stale = [folder / "Testing" / "TAG" for folder in folders]
    if not (context.options.ctest_args and configuration):
        # Each run gets a new name; a full run also removes results of deleted tests.
        stale += [folder / "Testing" / "[0-9]*-[0-9]*" for folder in folders]
        stale += [folder / "test_results" / package.name / "*.xml" for folder in folders]
    if not configuration:
        return Recipe(clean=tuple(stale))
    until_fail = context.options.retest_until_fail
    named = any(word in {"-C", "--build-config"} for word in context.options.ctest_args)
    argv = (
        str(context.ctest),
        *(() if named else ("-C", configuration)),
        *("-D", "ExperimentalTest", "--no-compress-output", "-V", "--force-new-ctest-process"),
        *context.options.ctest_args,
        *(("--repeat-until-fail", str(until_fail + 1)) if until_fail else ()),
    )
    step = Step(StepKind.CTEST, argv, build, meanings=_OF_CTEST)
    again = replace(step, argv=(*argv, "--rerun-failed"), condition=StepCondition.TESTS_FAILED)
    # CTest prints two errors without this file, which only `include(CTest)` creates.
    dart = build / "DartConfiguration.tcl"
    missing = (context.not_run(package.name), missing_result(package, "ctest"))
    files = (missing,) if dart.exists() else ((dart, ""), missing)
    return Recipe((step, *(again,) * context.options.retest_until_pass), files, tuple(stale))


def python_recipe(package: Package, context: TestContext, wants: Collection[str]) -> Recipe:
    """Return the pytest run if the package requires pytest, else the unittest run.

    `wants` are the normalized names of the distributions that the tests require.
    """
    if framework(package, context, wants) == "pytest":
        return pytest_recipe(package, context, wants)
    return unittest_recipe(package, context)


def framework(package: Package, context: TestContext, wants: Collection[str]) -> str:
    """Return 'pytest' or 'unittest': the option, else according to the package's metadata and manifest."""
    if context.options.python_testing:
        return "pytest" if context.options.python_testing == "pytest" else "unittest"
    declared = {dependency.name for dependency in package.manifest.dependencies}
    return "pytest" if "pytest" in wants or "python3-pytest" in declared else "unittest"


def pytest_recipe(package: Package, context: TestContext, wants: Collection[str]) -> Recipe:
    """Return the pytest run; without plugins for repetition the whole run is repeated."""
    build = context.layout.build_dir(package.name)
    junit = context.results_of(package.name) / "pytest.xml"
    options, modules = context.options, context.modules
    plugin = "pytest_cov" in modules
    covered = plugin and not options.coverage and (options.pytest_with_coverage or "pytest-cov" in wants)
    coverage = (
        f"--cov={context.source(package)}",
        *(f"--cov-report={kind}:{build}/coverage.{kind}" for kind in ("html", "xml")),
        "--cov-branch",
    )
    repeats = options.retest_until_fail and "pytest_repeat" in modules
    reruns = options.retest_until_pass and "pytest_rerunfailures" in modules
    argv = (
        *_python(package, context),
        *("-m", "pytest", "--tb=short"),
        f"--junit-xml={junit}",
        f"--junit-prefix={package.name}",
        *("-o", f"cache_dir={build / '.pytest_cache'}"),
        *(coverage if covered else ()),
        *(("--no-cov",) if options.coverage and plugin else ()),
        *((f"--count={options.retest_until_fail + 1}",) if repeats else ()),
        *((f"--reruns={options.retest_until_pass}",) if reruns else ()),
        *options.pytest_args,
    )
    env = (("COVERAGE_FILE", str(build / DATA_FILE)),) if covered or options.coverage else ()
    step = Step(StepKind.PYTEST, argv, context.source(package), env, meanings=_OF_PYTHON)
    steps = (step,) if repeats or reruns else _with_repetitions(step, options)
    missing = (junit, missing_result(package, "pytest"))
    return Recipe(steps, (missing,), (junit.with_name("unittest.xml"),))


def unittest_recipe(package: Package, context: TestContext) -> Recipe:
    """Return the unittest run through forge's runner, which writes a JUnit file."""
    junit, options = context.results_of(package.name) / "unittest.xml", context.options
    words = (str(UNITTESTS), str(junit), package.name, "-v")
    argv = (*_python(package, context), *words, *options.unittest_args)
    data = str(context.layout.build_dir(package.name) / DATA_FILE)
    env = (("COVERAGE_FILE", data),) if options.coverage else ()
    step = Step(StepKind.UNITTEST, argv, context.source(package), env, meanings=_OF_PYTHON)
    missing = (junit, missing_result(package, "unittest"))
    return Recipe(_with_repetitions(step, options), (missing,), (junit.with_name("pytest.xml"),))


def missing_result(package: Package, program: str) -> str:
    """Return a placeholder result, so that a crashed run is reported."""
    message = f"{program} exited without writing a result"
    return error_result(package.name, f"{program}.missing_result", message)


def error_result(package: str, test: str, message: str) -> str:
    return render("testing/error_result.xml.j2", package=package, test=test, message=message)


def _with_repetitions(step: Step, options: TestOptions) -> tuple[Step, ...]:
    until_fail = options.retest_until_fail
    condition = StepCondition.TESTS_PASSED if until_fail else StepCondition.TESTS_FAILED
    return (step, *(replace(step, condition=condition),) * (until_fail or options.retest_until_pass))


def _python(package: Package, context: TestContext) -> tuple[str, ...]:
    """Return the command that runs Python, below coverage.py if coverage is measured."""
    if not context.options.coverage:
        return (str(context.python),)
    measured = (f"--source={context.source(package)}", f"--omit={','.join(OMITTED)}")
    return (str(context.python), "-m", "coverage", "run", "--branch", *measured)
