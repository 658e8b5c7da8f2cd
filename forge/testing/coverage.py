"""Coverage of tests: gcovr reports on C and C++, coverage.py on Python.

Each package gets the same two reports in its build folder: coverage.xml in Cobertura's format, which CI
services read, and pages in coverage.html.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from typing import TYPE_CHECKING

from forge.base.errors import HostError, Problem, raise_if_any
from forge.base.files import remove_tree, text_or_nothing
from forge.base.frozen import frozen
from forge.build.tests.recipes import DATA_FILE, OMITTED
from forge.toolchain.programs import CMAKE_TYPES, PYTHON_TYPES, find_program
from forge.toolchain.python_modules import install_command

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from forge.base.errors import WarningReporter
    from forge.build.tasks import BuildPlan, Task
    from forge.build.tests.recipes import TestContext

_XML, _PAGES = "coverage.xml", "coverage.html"
_ROOT = re.compile(r"<coverage\s[^>]*>")
_COMPILER = re.compile(r"^CMAKE_(?:C|CXX)_COMPILER:[^=]*=(.*)$", re.MULTILINE)
_COMPILER_NAME = re.compile(r"(.*?)(clang\+\+|clang|g\+\+|gcc)(-[\d.]+)?")


@frozen
class CoverageReport:
    """Commands that write the reports of a package, once its tests and those of its dependents have run."""

    package: str
    build: Path
    source: Path
    commands: tuple[tuple[str, ...], ...]
    combine: tuple[str, ...] = ()
    """The command that merges data files, if the configuration of coverage.py asks for several."""

    @property
    def pages(self) -> Path:
        """The start page of the report."""
        return self.build / _PAGES / "index.html"


@frozen
class CoveredLines:
    """The lines of a package that its tests can execute, and how many of them they did."""

    package: str
    lines: int
    covered: int
    pages: Path


def plan_coverage(
    plan: BuildPlan, context: TestContext, variables: Mapping[str, str], warn: WarningReporter
) -> tuple[CoverageReport, ...]:
    """Return the reports to write after the tests; remove the data of earlier runs.

    Warns about packages that were not compiled for coverage. Raises HostError for missing programs.
    """
    compiled = [task for task in plan.tasks.values() if task.package.build_type in CMAKE_TYPES]
    python = [task for task in plan.tasks.values() if task.package.build_type in PYTHON_TYPES]
    counting = [task for task in compiled if _counts_lines(task.build_dir)]
    gcovr = find_program("gcovr", variables)
    problems = []
    if counting and gcovr is None:
        hint = "'uv tool install gcovr', 'pipx install gcovr', or 'sudo apt install gcovr'"
        problems.append(
            Problem("gcovr, which measures the coverage of C and C++, is not installed", hint=hint)
        )
    if python and "coverage" not in context.modules:
        hint = install_command(context.python, ("coverage",))
        problems.append(
            Problem(f"'{context.python}' has no coverage.py, which --coverage requires", hint=hint)
        )
    raise_if_any(problems, HostError)
    warn(_not_counting([task for task in compiled if task.steps and task not in counting]))
    for task in (*counting, *python):
        _remove_data(task.build_dir)
    return (
        *(_compiled_report(task, str(gcovr), context, variables) for task in counting),
        *(_python_report(task, context) for task in python),
    )


def write_reports(
    reports: Sequence[CoverageReport], jobs: int, variables: Mapping[str, str]
) -> tuple[list[CoveredLines], list[Problem]]:
    """Write all reports, several at a time; return the results by package name, and what failed."""
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(jobs) as pool:
        results = list(pool.map(lambda report: _write_report(report, variables), reports))
    found = [result for result in results if isinstance(result, CoveredLines)]
    problems = [result for result in results if isinstance(result, Problem)]
    return sorted(found, key=lambda covered: covered.package), problems


def coverage_lines(found: Sequence[CoveredLines], paths: Iterable[str]) -> Iterator[str]:
    """Yield the summary: all packages together, then each with the path of its pages."""
    lines, covered = sum(one.lines for one in found), sum(one.covered for one in found)
    yield f"Coverage: {_percentage(lines, covered)} of {lines} lines"
    width = max((len(one.package) for one in found), default=0)
    for one, path in zip(found, paths, strict=True):
        percentage = _percentage(one.lines, one.covered)
        yield f"  {one.package:<{width}}  {percentage:>6} of {one.lines} lines: {path}"


def _percentage(lines: int, covered: int) -> str:
    # Rounded down, so that 100 % means all lines.
    return f"{covered * 1000 // lines / 10:.1f}%" if lines else "-"


def _counts_lines(build: Path) -> bool:
    """Tell whether the compiler wrote notes for coverage."""
    return any(name.endswith(".gcno") for _, _, names in os.walk(build) for name in names)


def _not_counting(tasks: Sequence[Task]) -> Iterator[Problem]:
    if tasks:
        names = ", ".join(f"'{task.name}'" for task in tasks)
        hint = f"forge build --mixin coverage --packages-select {' '.join(task.name for task in tasks)}"
        yield Problem(f"not built for coverage: {names}", hint=hint)


def _remove_data(build: Path) -> None:
    """Remove what earlier test runs counted, and their reports."""
    for folder, _, names in os.walk(build):
        for name in names:
            if name.endswith(".gcda"):
                os.unlink(os.path.join(folder, name))  # noqa: PTH108, PTH118  (a walk is text)
    for path in (*build.glob(f"{DATA_FILE}*"), build / _XML, build / _PAGES):
        remove_tree(str(path))


def _compiled_report(
    task: Task, gcovr: str, context: TestContext, variables: Mapping[str, str]
) -> CoverageReport:
    build, source = task.build_dir, context.source(task.package)
    report = CoverageReport(task.name, build, source, ())
    command = (
        *(gcovr, "--root", str(source), "--exclude", f"{re.escape(str(source))}/tests?/"),
        *(("--gcov-executable", gcov) if (gcov := _gcov(build, variables)) else ()),
        *("--xml", str(build / _XML), "--html-details", str(report.pages), str(build)),
    )
    return CoverageReport(task.name, build, source, (command,))


def _gcov(build: Path, variables: Mapping[str, str]) -> str:
    """Return the gcov of the compiler that built a package, '' for gcovr's default."""
    cache = text_or_nothing(build / "CMakeCache.txt")
    for compiler in _COMPILER.findall(cache):
        match = _COMPILER_NAME.fullmatch(os.path.basename(compiler))  # noqa: PTH119
        if match is None:
            continue
        prefix, name, version = match[1], match[2], match[3] or ""
        gcov = f"llvm-cov{version}" if "clang" in name else f"{prefix}gcov{version}"
        if shutil.which(gcov, path=variables.get("PATH")):
            return f"{gcov} gcov" if "clang" in name else gcov
    return ""


def _python_report(task: Task, context: TestContext) -> CoverageReport:
    program = (str(context.python), "-m", "coverage")
    # The configuration of the package must not fail the report.
    options = ("--fail-under=0", f"--omit={','.join(OMITTED)}")
    build = task.build_dir
    return CoverageReport(
        task.name,
        build,
        context.source(task.package),
        (
            (*program, "xml", *options, "-o", str(build / _XML)),
            (*program, "html", *options, "-d", str(build / _PAGES)),
        ),
        (*program, "combine"),
    )


def _write_report(report: CoverageReport, variables: Mapping[str, str]) -> CoveredLines | Problem:
    """Run the commands; return the numbers in their result, or why there is none."""
    report.pages.parent.mkdir(parents=True, exist_ok=True)
    env = {**variables, "COVERAGE_FILE": str(report.build / DATA_FILE)}
    several = report.combine and any(report.build.glob(f"{DATA_FILE}.*"))
    said = ""
    for command in ((report.combine,) if several else ()) + report.commands:
        ran = subprocess.run(command, cwd=report.source, env=env, capture_output=True, text=True, check=False)
        said += ran.stdout + ran.stderr
    # The exit codes also tell of thresholds in the configuration of gcovr.
    root = _ROOT.search(text_or_nothing(report.build / _XML))
    numbers = dict(re.findall(r'(lines-\w+)="(\d+)"', root[0] if root else ""))
    if not numbers.keys() >= {"lines-valid", "lines-covered"} or not report.pages.is_file():
        last = next(reversed(said.strip().splitlines()), "no message")
        return Problem(f"cannot measure the coverage of '{report.package}': {last}")
    return CoveredLines(
        report.package, int(numbers["lines-valid"]), int(numbers["lines-covered"]), report.pages
    )
