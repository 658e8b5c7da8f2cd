"""Build type to the steps that test a package: CTest, pytest or unittest; pure.

The exit code of CTest and pytest tells failed tests from a run that failed; the steps know the difference.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from forge.frozen import frozen
from forge.model import FAILURE, SUCCESS, TEST_FAILURES, Step
from forge.templating import render

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from forge.layout import Layout
    from forge.model import Package

NO_TESTS = "no tests"
UNITTESTS = Path(__file__).with_name("unittests.py")
_OF_CTEST = ((8, TEST_FAILURES),)
_OF_PYTHON = ((1, TEST_FAILURES), (5, NO_TESTS))


@frozen
class Bench:
    """What all tests of one run share: folders, programs and options.

    `modules` are the modules around pytest that the interpreter has; `results` is a folder for results
    apart from the build folders, or None.
    """

    root: Path
    layout: Layout
    python: Path
    ctest: Path | None = None
    modules: frozenset[str] = frozenset()
    results: Path | None = None
    framework: str | None = None
    until_fail: int = 0
    until_pass: int = 0
    coverage: bool = False
    ctest_args: tuple[str, ...] = ()
    pytest_args: tuple[str, ...] = ()
    unittest_args: tuple[str, ...] = ()

    def source(self, package: Package) -> Path:
        """Return the absolute folder of a package."""
        return self.root / package.path

    def of(self, package: Package) -> Bench:
        """Return the bench with what the package's own settings add to the options of all."""
        if not package.settings:
            return self
        return replace(
            self,
            framework=self.framework or next(iter(package.words("python-testing")), None),
            ctest_args=(*self.ctest_args, *package.words("ctest-args")),
            pytest_args=(*self.pytest_args, *package.words("pytest-args")),
            unittest_args=(*self.unittest_args, *package.words("unittest-args")),
        )

    def results_of(self, name: str) -> Path:
        """Return the folder that the results of a package go to."""
        return (self.results or self.layout.build) / name


@frozen
class Look:
    """What a package and its build folder say about its tests.

    `configuration` is what CMake built, '' when there is no CTest test; `wants` are the Python
    distributions that its tests are said to need, names normalised.
    """

    configuration: str = ""
    wants: frozenset[str] = frozenset()


@frozen
class TestRecipe:
    """The steps, the files written before the first, and what of earlier runs is removed before."""

    __test__ = False  # pytest collects what is called Test

    steps: tuple[Step, ...] = ()
    files: tuple[tuple[Path, str], ...] = ()
    clean: tuple[Path, ...] = ()


def ctest_recipe(package: Package, bench: Bench, look: Look) -> TestRecipe:
    """Return the run of CTest, with colcon's options; nothing when there are no tests."""
    if not look.configuration:
        return TestRecipe()
    build = bench.layout.build_dir(package.name)
    named = any(word in {"-C", "--build-config"} for word in bench.ctest_args)
    argv = (
        str(bench.ctest),
        *(() if named else ("-C", look.configuration)),
        *("-D", "ExperimentalTest", "--no-compress-output", "-V", "--force-new-ctest-process"),
        *bench.ctest_args,
        *(("--repeat-until-fail", str(bench.until_fail + 1)) if bench.until_fail else ()),
    )
    step = Step("ctest", argv, build, meanings=_OF_CTEST)
    again = replace(step, argv=(*argv, "--rerun-failed"), after=FAILURE)
    # Another name for each run; where all tests run, the results of tests that are gone go too.
    stale = [build / "Testing" / "TAG"]
    if not bench.ctest_args:
        stale += [build / "Testing" / "[0-9]*-[0-9]*", build / "test_results" / package.name / "*.xml"]
    return TestRecipe((step, *(again,) * bench.until_pass), clean=tuple(stale))


def python_recipe(package: Package, bench: Bench, look: Look) -> TestRecipe:
    """Return the run of pytest if the package asks for it, else of unittest."""
    name = framework(package, bench, look)
    return (pytest_recipe if name == "pytest" else unittest_recipe)(package, bench, look)


def framework(package: Package, bench: Bench, look: Look) -> str:
    """Return 'pytest' or 'unittest': the option's, else what the package's metadata or manifest asks for."""
    if bench.framework:
        return "pytest" if bench.framework == "pytest" else "unittest"
    declared = {dependency.name for dependency in package.manifest.dependencies}
    return "pytest" if "pytest" in look.wants or "python3-pytest" in declared else "unittest"


def pytest_recipe(package: Package, bench: Bench, look: Look) -> TestRecipe:
    """Return the run of pytest; where a plugin that repeats is missing, the whole run is repeated."""
    build = bench.layout.build_dir(package.name)
    junit = bench.results_of(package.name) / "pytest.xml"
    covered = (bench.coverage or "pytest-cov" in look.wants) and "pytest_cov" in bench.modules
    repeats = bench.until_fail and "pytest_repeat" in bench.modules
    reruns = bench.until_pass and "pytest_rerunfailures" in bench.modules
    argv = (
        *(str(bench.python), "-m", "pytest", "--tb=short"),
        f"--junit-xml={junit}",
        f"--junit-prefix={package.name}",
        *("-o", f"cache_dir={build / '.pytest_cache'}"),
        *(_coverage(bench.source(package), build) if covered else ()),
        *((f"--count={bench.until_fail + 1}",) if repeats else ()),
        *((f"--reruns={bench.until_pass}",) if reruns else ()),
        *bench.pytest_args,
    )
    env = (("COVERAGE_FILE", str(build / ".coverage")),) if covered else ()
    step = Step("pytest", argv, bench.source(package), env, meanings=_OF_PYTHON)
    further = 0 if repeats or reruns else bench.until_fail or bench.until_pass
    return TestRecipe(
        (step, *(_again(step, bench),) * further), ((junit, missing_result(package, "pytest")),)
    )


def unittest_recipe(package: Package, bench: Bench, _: Look) -> TestRecipe:
    """Return the run of unittest through our own program, which writes a JUnit file."""
    junit = bench.results_of(package.name) / "unittest.xml"
    argv = (str(bench.python), str(UNITTESTS), str(junit), package.name, "-v", *bench.unittest_args)
    step = Step("unittest", argv, bench.source(package), meanings=_OF_PYTHON)
    further = (_again(step, bench),) * (bench.until_fail or bench.until_pass)
    return TestRecipe((step, *further), ((junit, missing_result(package, "unittest")),))


def missing_result(package: Package, program: str) -> str:
    """Return the result that stands until there is one: a run that dies must not look like none."""
    return render("testing/missing_result.xml.j2", package=package.name, program=program)


TEST_RECIPES: Mapping[str, Callable[[Package, Bench, Look], TestRecipe]] = {
    "ament_cmake": ctest_recipe,
    "cmake": ctest_recipe,
    "ament_python": python_recipe,
    "python": python_recipe,
}


def _again(step: Step, bench: Bench) -> Step:
    return replace(step, after=SUCCESS if bench.until_fail else FAILURE)


def _coverage(source: Path, build: Path) -> tuple[str, ...]:
    return (
        f"--cov={source}",
        f"--cov-report=html:{build / 'coverage.html'}",
        f"--cov-report=xml:{build / 'coverage.xml'}",
        "--cov-branch",
    )
