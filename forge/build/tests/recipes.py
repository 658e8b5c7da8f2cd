"""The test steps of each build type, CTest, pytest or unittest, and which tests a package has.

Like the exit codes of CTest and pytest, the steps distinguish failed tests from failed runs.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import field, replace
from pathlib import Path

from forge.base.errors import Location, Problem, WorkspaceError
from forge.base.files import text_or_nothing
from forge.base.formats import read_toml
from forge.base.frozen import Pairs, frozen
from forge.base.layout import TEST_SCRATCH_DIR, Layout
from forge.base.templating import render
from forge.build.recipes.context import Recipe
from forge.build.tasks import TEST_FAILURES, TIMED_OUT, Step, StepCondition, StepKind
from forge.build.tests.options import TestOptions
from forge.workspace.model import DependencyKind, Package
from forge.workspace.python_metadata import PythonMetadata, read_pyproject, read_setup_cfg, read_setup_py

NO_TESTS = "no tests"
UNITTESTS = Path(__file__).with_name("unittests.py")
DATA_FILE = ".coverage"
OMITTED = ("setup.py", "test/*", "tests/*")
"""Files of Python packages that coverage.py does not count, relative to the package."""
MAX_TESTS = 1000
_OF_CTEST = ((8, TEST_FAILURES),)
_OF_PYTHON = ((1, TEST_FAILURES), (5, NO_TESTS), (TIMED_OUT, TEST_FAILURES))


@frozen
class ChosenTests:
    """Additional arguments and variables of a test run that restrict it to some tests."""

    ctest_args: tuple[str, ...] = ()
    pytest_args: tuple[str, ...] = ()
    unittest_args: tuple[str, ...] = ()
    cargo_args: tuple[str, ...] = ()
    env: Pairs = ()


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
    isolated: bool = False
    """Whether tests that run at the same time get separate ROS domains."""

    chosen: Mapping[str, ChosenTests] = field(default_factory=dict)
    """Packages with a selection of tests."""

    def source(self, package: Package) -> Path:
        return self.root / package.path

    def of(self, package: Package) -> TestContext:
        chosen = self.chosen.get(package.name, ChosenTests())
        if not package.settings and package.name not in self.chosen:
            return self
        options, values = self.options, package.option_values
        own = replace(
            options,
            test_jobs=_number(package, values("test-jobs")) or options.test_jobs,
            python_testing=options.python_testing or next(iter(values("python-testing")), None),
            ctest_args=(*options.ctest_args, *values("ctest-args"), *chosen.ctest_args),
            pytest_args=(*options.pytest_args, *values("pytest-args"), *chosen.pytest_args),
            unittest_args=(*options.unittest_args, *values("unittest-args"), *chosen.unittest_args),
            cargo_args=(*options.cargo_args, *chosen.cargo_args),
        )
        return replace(self, options=own)

    def results_of(self, name: str) -> Path:
        return (self.options.test_result_base or self.layout.build) / name

    def not_run(self, name: str) -> Path:
        """Return the result file that says why the tests of a package did not run or complete."""
        return self.results_of(name) / "test_results" / name / "not_run.xml"


def _number(package: Package, values: Sequence[str]) -> int:
    for value in values:
        if value.isdecimal():
            return int(value)
        message = f"'test-jobs' of '{package.name}' expects a number, not '{value}'"
        raise WorkspaceError(Problem(message, Location(package.path)))
    return 0


def ctest_recipe(package: Package, context: TestContext, configuration: str) -> Recipe:
    """Return the CTest run of a configuration with colcon's options; no steps for ''."""
    build = context.layout.build_dir(package.name)
    folders = tuple(dict.fromkeys((build, context.results_of(package.name))))
    stale = [folder / "Testing" / "TAG" for folder in folders]
    if not (context.options.ctest_args and configuration):
        # Each run gets a new name; a full run also removes results of deleted tests.
        stale += [folder / "Testing" / "[0-9]*-[0-9]*" for folder in folders]
        stale += [folder / "test_results" / package.name / "*.xml" for folder in folders]
        stale.append(known_cases_file(build))
    if not configuration:
        return Recipe(clean=tuple(stale))
    until_fail = context.options.retest_until_fail
    named = any(word in {"-C", "--build-config"} for word in context.options.ctest_args)
    argv = (
        str(context.ctest),
        *(() if named else ("-C", configuration)),
        *("-D", "ExperimentalTest", "--no-compress-output", "-V", "--force-new-ctest-process"),
        *(("--timeout", f"{limit:g}") if (limit := context.options.test_timeout) else ()),
        *context.options.ctest_args,
        *(("--repeat-until-fail", str(until_fail + 1)) if until_fail else ()),
    )
    dart = build / "DartConfiguration.tcl"
    files = [(context.not_run(package.name), missing_result(package, "ctest"))]
    folder = build
    tests = count_ctests(build, MAX_TESTS)
    # The observations of `--cached` must not depend on the order of tests, so these run one after another.
    chosen = any(word.startswith(("-j", "--parallel")) for word in context.options.ctest_args)
    one_by_one = chosen or context.options.cached or not context.isolated or context.options.test_jobs == 1
    at_once = 0 if one_by_one or tests < 2 else min(context.options.test_jobs or MAX_TESTS, tests)
    if at_once:
        # In this folder, CTest reads the tests through a file that forge writes, and writes results through a
        # link.
        folder = parallel_folder(build)
        read = text_or_nothing(dart)
        other_lines = [line for line in read.splitlines() if not line.startswith(_FOLDERS_OF_DART)]
        own_lines = f"SourceDirectory: {build}\nBuildDirectory: {folder}\n"
        files += [
            (folder / "CTestTestfile.cmake", render("testing/isolated_tests.cmake.j2", build=str(build))),
            (folder / dart.name, own_lines + "".join(f"{line}\n" for line in other_lines)),
            *(
                (folder / name, f'include("{build}/{name}")\n')
                for name in _CUSTOM
                if (build / name).is_file()
            ),
        ]
    elif not dart.exists():
        files.append((dart, ""))  # without it, which only `include(CTest)` creates, CTest prints two errors
    env = context.chosen.get(package.name, ChosenTests()).env
    step = Step(StepKind.CTEST, argv, folder, env, meanings=_OF_CTEST, tests_at_once=at_once, tests=tests)
    again = replace(step, argv=(*argv, "--rerun-failed"), condition=StepCondition.TESTS_FAILED)
    return Recipe((step, *(again,) * context.options.retest_until_pass), tuple(files), tuple(stale))


_FOLDERS_OF_DART = ("SourceDirectory:", "BuildDirectory:")
_CUSTOM = ("CTestCustom.cmake", "CTestCustom.ctest")


def known_cases_file(build: Path) -> Path:
    """Return the file with the tests that runs of chosen tests have left out of the result files."""
    return build / TEST_SCRATCH_DIR / "cases.json"


def parallel_folder(build: Path) -> Path:
    """Return the working directory of CTest if it runs the tests of a package in parallel."""
    return build / TEST_SCRATCH_DIR / "ctest"


def python_recipe(package: Package, context: TestContext, wants: Collection[str]) -> Recipe:
    """Return the pytest run if the package requires pytest, else the unittest run; both write a JUnit file.

    `wants` are the normalized names of the distributions that the tests require. Without pytest's plugin for
    repetition, the whole run is repeated.
    """
    build, source = context.layout.build_dir(package.name), context.source(package)
    options, modules, results = context.options, context.modules, context.results_of(package.name)
    python = [str(context.python)]
    if options.coverage:
        python += ["-m", "coverage", "run", "--branch", f"--source={source}", f"--omit={','.join(OMITTED)}"]
    stale = []
    if framework(package, context, wants) == "pytest":
        kind, other = StepKind.PYTEST, StepKind.UNITTEST
        junit = results / "pytest.xml"
        plugin = "pytest_cov" in modules
        covered = plugin and not options.coverage and (options.pytest_with_coverage or "pytest-cov" in wants)
        coverage = (
            f"--cov={source}",
            *(f"--cov-report={suffix}:{build}/coverage.{suffix}" for suffix in ("html", "xml")),
            "--cov-branch",
        )
        repeats = bool(options.retest_until_fail) and "pytest_repeat" in modules
        words = (
            *("-m", "pytest", "--tb=short"),
            f"--junit-xml={junit}",
            f"--junit-prefix={package.name}",
            *("-o", f"cache_dir={build / '.pytest_cache'}"),
            *(coverage if covered else ()),
            *(("--no-cov",) if options.coverage and plugin else ()),
            *((f"--count={options.retest_until_fail + 1}",) if repeats else ()),
            *options.pytest_args,
        )
        stale += [] if options.pytest_args else [known_cases_file(build)]
    else:
        kind, other = StepKind.UNITTEST, StepKind.PYTEST
        junit = results / "unittest.xml"
        covered = repeats = False
        words = (str(UNITTESTS), str(junit), package.name, "-v", *options.unittest_args)
    env = (("COVERAGE_FILE", str(build / DATA_FILE)),) if covered or options.coverage else ()
    argv = (*python, *words)
    step = Step(kind, argv, source, env, meanings=_OF_PYTHON, seconds=options.test_timeout)
    count = 0 if repeats else options.retest_until_fail or options.retest_until_pass
    passed, failed = StepCondition.TESTS_PASSED, StepCondition.TESTS_FAILED
    again = replace(step, condition=passed if options.retest_until_fail else failed)
    missing = (junit, missing_result(package, kind.value, options.test_timeout))
    return Recipe((step, *(again,) * count), (missing,), (results / f"{other.value}.xml", *stale))


def framework(package: Package, context: TestContext, wants: Collection[str]) -> str:
    """Return 'pytest' or 'unittest': the option, else according to the package's metadata and manifest."""
    if context.options.python_testing:
        return "pytest" if context.options.python_testing == "pytest" else "unittest"
    declared = {dependency.name for dependency in package.manifest.dependencies}
    return "pytest" if "pytest" in wants or "python3-pytest" in declared else "unittest"


def missing_result(package: Package, program: str, seconds: float = 0) -> str:
    """Return a placeholder result, which remains if the run crashes or times out."""
    message = f"{program} exited without writing a result"
    message += f", or took longer than {seconds:g} s" if seconds else ""
    return error_result(package.name, f"{program}.missing_result", message)


def error_result(package: str, test: str, message: str) -> str:
    return render("testing/error_result.xml.j2", package=package, test=test, message=message)


_BUILD_TYPE = re.compile(r"^CMAKE_BUILD_TYPE:[^=]*=(.*)$", re.MULTILINE)
_SUBFOLDER = re.compile(r'^\s*subdirs\("?([^")]+)"?\)', re.MULTILINE)
_TESTS = re.compile(r"^\s*(add_test|include)\(", re.MULTILINE)


def count_ctests(build: Path, most: int) -> int:
    """Return the number of tests that CTest finds in a build folder, or at least `most`.

    A file that a list of tests includes may contain any number of them.
    """
    waiting, count = [build], 0
    while waiting and count < most:
        folder = waiting.pop()
        text = text_or_nothing(folder / "CTestTestfile.cmake")
        count += sum(most if word == "include" else 1 for word in _TESTS.findall(text))
        waiting += [folder / name for name in _SUBFOLDER.findall(text)]
    return count


def requirements_of_tests(source: Path) -> frozenset[str]:
    """Return the normalized names of distributions that a Python package's tests require.

    Reads tests_require and test extras in setup.py, setup.cfg and pyproject.toml, and dependency groups.
    Values in setup.py that are not literals are ignored.
    """
    names = (
        dependency.name
        for facts in _facts(source)
        for dependency in facts.dependencies
        if DependencyKind.TEST in dependency.kinds
    )
    return frozenset(re.sub(r"[-_.]+", "-", name).lower() for name in names)


def _facts(source: Path) -> Iterator[PythonMetadata]:
    """Yield the metadata of each of a package's files; unreadable ones are skipped."""
    with suppress(SyntaxError, ValueError, RecursionError):
        yield read_setup_py(text_or_nothing(source / "setup.py")) or PythonMetadata()
    yield read_setup_cfg(text_or_nothing(source / "setup.cfg"))
    with suppress(WorkspaceError):
        table = read_toml(text_or_nothing(source / "pyproject.toml"), source / "pyproject.toml")
        groups = table.get("dependency-groups", {})
        yield read_pyproject(table) or PythonMetadata()
        yield read_pyproject({"project": {"optional-dependencies": groups}}) or PythonMetadata()


def has_ctests(build: Path) -> bool:
    return count_ctests(build, 1) > 0


def ctest_configuration(build: Path) -> str:
    """Return the configuration for CTest: from CMake's cache, else Release as in colcon; '' without tests."""
    if not has_ctests(build):
        return ""
    match = _BUILD_TYPE.search(text_or_nothing(build / "CMakeCache.txt"))
    configurations = {"Debug", "MinSizeRel", "RelWithDebInfo"}
    return match[1] if match and match[1] in configurations else "Release"
