"""The reporter of `forge test --coverage`: gcovr reports on C and C++, coverage.py on Python.

Each package gets the same two reports in its build folder: coverage.xml in Cobertura's format, which CI
services read, and pages in coverage.html.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from forge.base.errors import HostError, Problem, raise_if_any
from forge.base.files import remove_tree, text_or_nothing
from forge.base.frozen import frozen
from forge.base.layout import forge_command
from forge.build.tasks import Task
from forge.build.tests.recipes import DATA_FILE, OMITTED
from forge.output.reporters import Report, Reporter, Run
from forge.toolchain.programs import find_program
from forge.toolchain.python_modules import install_command, missing_modules
from forge.workspace.model import CMAKE_TYPES, PYTHON_TYPES

_XML, _PAGES = "coverage.xml", "coverage.html"
_ROOT = re.compile(r"<coverage\s[^>]*>")
_COMPILER = re.compile(r"^CMAKE_(?:C|CXX)_COMPILER:[^=]*=(.*)$", re.MULTILINE)
_COMPILER_NAME = re.compile(r"(.*?)(clang\+\+|clang|g\+\+|gcc)(-[\d.]+)?")


@frozen
class CoveredLines:
    """The number of lines of a package that its tests can execute, and the number that they did execute."""

    package: str
    lines: int
    covered: int
    pages: Path


class Coverage(Reporter):
    """The report on one test run."""

    def __init__(self, run: Run) -> None:
        """Plan the reports, and remove the data of earlier runs.

        Warns about packages that were not compiled for coverage. Raises HostError for missing programs.
        """
        tasks = run.plan.tasks.values()
        compiled = [task for task in tasks if task.package.build_type in CMAKE_TYPES]
        python = [task for task in tasks if task.package.build_type in PYTHON_TYPES]
        # The compiler writes notes for coverage.
        counting = [task for task in compiled if any(task.build_dir.rglob("*.gcno"))]
        gcovr = find_program("gcovr", run.variables)
        problems = []
        if counting and gcovr is None:
            hint = "'uv tool install gcovr', 'pipx install gcovr', or 'sudo apt install gcovr'"
            problems.append(
                Problem("gcovr, which measures the coverage of C and C++, is not installed", hint=hint)
            )
        if python and missing_modules(run.python, ("coverage",)):
            hint = install_command(run.python, ("coverage",))
            problems.append(
                Problem(f"'{run.python}' has no coverage.py, which --coverage requires", hint=hint)
            )
        raise_if_any(problems, HostError)
        if other := [task.name for task in compiled if task.steps and task not in counting]:
            names = ", ".join(f"'{name}'" for name in other)
            words = f"build --mixin coverage --packages-select {' '.join(other)}"
            hint = forge_command(words, run.layout.profile)
            run.warn([Problem(f"not built for coverage: {names}", hint=hint)])
        self._run = run
        self._gcovr = str(gcovr)
        self._tasks = (*counting, *python)
        for build in (task.build_dir for task in self._tasks):
            old = (*build.rglob("*.gcda"), *build.glob(f"{DATA_FILE}*"), build / _XML, build / _PAGES)
            for path in old:
                remove_tree(str(path))

    def conclude(self, *, complete: bool) -> Report:
        """Write the reports, several at a time, unless the run was interrupted."""
        if not complete:
            return Report()
        with ThreadPoolExecutor(self._run.jobs) as pool:
            results = list(pool.map(self._write_report, self._tasks))
        self._run.warn([result for result in results if isinstance(result, Problem)])
        measured = [result for result in results if isinstance(result, CoveredLines)]
        measured.sort(key=lambda one: one.package)
        members = ({"lines": one.lines, "covered": one.covered, "report": str(one.pages)} for one in measured)
        return Report(
            tuple(summary_lines(measured, self._run.displayed)),
            tuple(("Coverage", one.package, of_one) for one, of_one in zip(measured, members, strict=True)),
        )

    def _write_report(self, task: Task) -> CoveredLines | Problem:
        """Write the report of a package; return its numbers, or the reason why it is missing."""
        build, source = task.build_dir, self._run.root / task.package.path
        pages = build / _PAGES / "index.html"
        pages.parent.mkdir(parents=True, exist_ok=True)
        env = {**self._run.variables, "COVERAGE_FILE": str(build / DATA_FILE)}
        output = ""
        for command in self._commands(task, source, pages):
            result = subprocess.run(command, cwd=source, env=env, capture_output=True, text=True, check=False)
            output += result.stdout + result.stderr
        # The exit codes also reflect thresholds in the configuration of gcovr.
        root = _ROOT.search(text_or_nothing(build / _XML))
        numbers = dict(re.findall(r'(lines-\w+)="(\d+)"', root[0] if root else ""))
        if not numbers.keys() >= {"lines-valid", "lines-covered"} or not pages.is_file():
            last = next(reversed(output.strip().splitlines()), "no message")
            return Problem(f"cannot measure the coverage of '{task.name}': {last}")
        return CoveredLines(task.name, int(numbers["lines-valid"]), int(numbers["lines-covered"]), pages)

    def _commands(self, task: Task, source: Path, pages: Path) -> Iterator[tuple[str, ...]]:
        build = task.build_dir
        if task.package.build_type in CMAKE_TYPES:
            gcov = gcov_of(build, self._run.variables)
            yield (
                *(self._gcovr, "--root", str(source), "--exclude", f"{re.escape(str(source))}/tests?/"),
                *(("--gcov-executable", gcov) if gcov else ()),
                *("--xml", str(build / _XML), "--html-details", str(pages), str(build)),
            )
            return
        program = (str(self._run.python), "-m", "coverage")
        if any(build.glob(f"{DATA_FILE}.*")):
            # The configuration of coverage.py requests a data file per process.
            yield (*program, "combine")
        # The configuration of the package must not fail the report.
        options = ("--fail-under=0", f"--omit={','.join(OMITTED)}")
        yield (*program, "xml", *options, "-o", str(build / _XML))
        yield (*program, "html", *options, "-d", str(build / _PAGES))


start = Coverage


def summary_lines(measured: Sequence[CoveredLines], displayed: Callable[[Path], str] = str) -> Iterator[str]:
    """Yield the summary: all packages together, then each with the path of its pages."""
    lines, covered = sum(one.lines for one in measured), sum(one.covered for one in measured)
    yield f"Coverage: {_percentage(lines, covered)} of {lines} lines"
    width = max((len(one.package) for one in measured), default=0)
    for one in measured:
        percentage = _percentage(one.lines, one.covered)
        yield f"  {one.package:<{width}}  {percentage:>6} of {one.lines} lines: {displayed(one.pages)}"


def _percentage(lines: int, covered: int) -> str:
    # Rounded down, so that 100 % means all lines.
    return f"{covered * 1000 // lines / 10:.1f}%" if lines else "-"


def gcov_of(build: Path, variables: Mapping[str, str]) -> str:
    """Return the gcov of the compiler that built a package, '' for gcovr's default."""
    cache = text_or_nothing(build / "CMakeCache.txt")
    for compiler in _COMPILER.findall(cache):
        match = _COMPILER_NAME.fullmatch(Path(compiler).name)
        if match is None:
            continue
        prefix, name, version = match[1], match[2], match[3] or ""
        gcov = f"llvm-cov{version}" if "clang" in name else f"{prefix}gcov{version}"
        if shutil.which(gcov, path=variables.get("PATH")):
            return f"{gcov} gcov" if "clang" in name else gcov
    return ""
