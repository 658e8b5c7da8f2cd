"""The coverage of tests: reports of gcovr and coverage.py, and what is missing for them."""

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from forge.base.errors import HostError, WarningReporter
from forge.base.layout import Layout
from forge.build.tasks import BuildPlan, Step, StepKind, Task
from forge.output.reporters import Report, Run
from forge.plugins.coverage.reporter import Coverage, CoveredLines, gcov_of, summary_lines
from forge.toolchain.python_modules import install_command
from tests.packages import package

HALF = """int half(int number)
{
  if (number < 0) {
    return 0;
  }
  return number / 2;
}
"""
MAIN = "int half(int); int main(void) { return half(4) - 2; }\n"


def task(root: Path, name: str, build_type: str, *, tests: bool = True) -> Task:
    build = root / "build" / name
    build.mkdir(parents=True, exist_ok=True)
    steps = (Step(StepKind.CTEST, ("true",), build),) if tests else ()
    return Task(name, package(name, build_type=build_type), root, build, (), steps, "it is selected")


def run(
    root: Path, *tasks: Task, variables: Mapping[str, str] = os.environ, python: str = sys.executable
) -> Run:
    return Run(
        command="test",
        plan=BuildPlan({task.name: task for task in tasks}),
        layout=Layout(root / "build", root / "install", None),
        root=root,
        variables=variables,
        python=Path(python),
        jobs=1,
        warn=WarningReporter(),
        log_folder=None,
        clock=0.0,
        displayed=str,
    )


def counts(report: Report) -> list[tuple[object, object]]:
    """Return the lines of each package, and how many of them were executed."""
    return [(members["lines"], members["covered"]) for _, _, members in report.events]


def source(root: Path, name: str) -> Path:
    folder = root / package(name).path
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@pytest.mark.needs("gcc", "gcov", "gcovr")
def test_only_c_lines_executed_in_this_run_are_counted(tmp_path: Path) -> None:
    one = task(tmp_path, "half", "cmake")
    folder = source(tmp_path, "half")
    (folder / "half.c").write_text(HALF)
    (folder / "test").mkdir()
    (folder / "test/main.c").write_text(MAIN)
    command = ["gcc", "--coverage", str(folder / "half.c"), str(folder / "test/main.c"), "-o", "program"]
    subprocess.run(command, cwd=one.build_dir, check=True)
    subprocess.run(["./program"], cwd=one.build_dir, check=True)
    assert list(one.build_dir.glob("*.gcda"))
    (one.build_dir / "CMakeCache.txt").write_text("CMAKE_C_COMPILER:FILEPATH=/usr/bin/gcc\n")

    coverage = Coverage(run(tmp_path, one))
    assert not list(one.build_dir.glob("*.gcda"))
    subprocess.run(["./program"], cwd=one.build_dir, check=True)
    pages = one.build_dir / "coverage.html/index.html"
    report = coverage.conclude(complete=True)
    assert report.events == (("Coverage", "half", {"lines": 4, "covered": 3, "report": str(pages)}),)
    assert report.lines == ("Coverage: 75.0% of 4 lines", f"  half   75.0% of 4 lines: {pages}")
    assert pages.is_file()


def test_data_files_of_several_processes_are_combined(tmp_path: Path) -> None:
    one = task(tmp_path, "half", "python")
    folder = source(tmp_path, "half")
    (folder / "half.py").write_text(
        "def half(number):\n    if number < 0:\n        return 0\n    return number / 2\n"
    )
    (folder / "run.py").write_text("import half\nhalf.half(4)\n")
    (folder / ".coveragerc").write_text("[run]\nparallel = true\n[report]\nfail_under = 100\n")
    coverage = Coverage(run(tmp_path, one))
    env = {**os.environ, "COVERAGE_FILE": str(one.build_dir / ".coverage")}
    argv = [sys.executable, "-m", "coverage", "run", f"--source={folder}", "run.py"]
    subprocess.run(argv, cwd=folder, env=env, check=True)
    assert len(list(one.build_dir.glob(".coverage.*"))) == 1
    assert counts(coverage.conclude(complete=True)) == [(6, 5)]


def test_a_failed_report_gives_the_reason(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one = task(tmp_path, "half", "python")
    source(tmp_path, "half")
    assert Coverage(run(tmp_path, one)).conclude(complete=True).events == ()
    assert capsys.readouterr().err == "warning: cannot measure the coverage of 'half': No data to report.\n"


def test_an_interrupted_run_has_no_report(tmp_path: Path) -> None:
    one = task(tmp_path, "half", "python")
    assert Coverage(run(tmp_path, one)).conclude(complete=False) == Report()
    assert not (one.build_dir / "coverage.html").exists()


def test_packages_not_built_for_coverage_give_a_warning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tasks = (
        task(tmp_path, "a", "cmake"),
        task(tmp_path, "b", "ament_cmake"),
        task(tmp_path, "c", "cmake", tests=False),
    )
    assert Coverage(run(tmp_path, *tasks, variables={})).conclude(complete=True).events == ()
    assert capsys.readouterr().err == (
        "warning: not built for coverage: 'a', 'b'\n"
        "hint: forge build --mixin coverage --packages-select a b\n"
    )


def test_missing_programs_are_named_with_the_install_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tasks = (task(tmp_path, "a", "cmake"), task(tmp_path, "p", "ament_python"))
    (tmp_path / "build/a/a.gcno").touch()
    monkeypatch.setattr(sys, "executable", str(tmp_path / "other/python3"))
    python = tmp_path / "python3"
    python.write_text("#!/bin/sh\necho coverage\n")
    python.chmod(0o755)
    with pytest.raises(HostError) as caught:
        Coverage(run(tmp_path, *tasks, variables={"PATH": ""}, python=str(python)))
    gcovr, coverage = caught.value.problems
    assert gcovr.message.startswith("gcovr, ")
    assert "uv tool install gcovr" in str(gcovr.hint)
    assert coverage.message.startswith(f"'{python}' has no coverage.py")
    assert coverage.hint == install_command(python, ("coverage",))


@pytest.mark.parametrize(
    ("compiler", "gcov"),
    [
        ("/usr/bin/g++-12", "gcov-12"),
        ("/usr/bin/aarch64-linux-gnu-g++", "aarch64-linux-gnu-gcov"),
        ("/usr/bin/clang++-14", "llvm-cov-14 gcov"),
        ("/usr/bin/g++-11", ""),
        ("/usr/bin/c++", ""),
    ],
)
def test_gcov_matches_the_compiler(tmp_path: Path, compiler: str, gcov: str) -> None:
    bin_ = tmp_path / "bin"
    bin_.mkdir()
    for name in ("gcov-12", "aarch64-linux-gnu-gcov", "llvm-cov-14"):
        (bin_ / name).write_text("#!/bin/sh\n")
        (bin_ / name).chmod(0o755)
    (tmp_path / "CMakeCache.txt").write_text(f"CMAKE_CXX_COMPILER:STRING={compiler}\n")
    assert gcov_of(tmp_path, {"PATH": str(bin_)}) == gcov


def test_the_summary_has_a_total_and_a_line_per_package() -> None:
    found = [CoveredLines("a", 3, 2, Path("x")), CoveredLines("longer", 0, 0, Path("y"))]
    assert list(summary_lines(found)) == [
        "Coverage: 66.6% of 3 lines",
        "  a        66.6% of 3 lines: x",
        "  longer       - of 0 lines: y",
    ]
    assert list(summary_lines([])) == ["Coverage: - of 0 lines"]


@pytest.mark.needs("gcc", "gcov", "gcovr")
def test_a_missed_threshold_does_not_prevent_the_report(tmp_path: Path) -> None:
    one = task(tmp_path, "half", "cmake")
    folder = source(tmp_path, "half")
    (folder / "half.c").write_text(HALF)
    (folder / "gcovr.cfg").write_text("fail-under-line = 100\n")
    subprocess.run(["gcc", "--coverage", "-c", str(folder / "half.c")], cwd=one.build_dir, check=True)
    coverage = Coverage(run(tmp_path, one))
    assert counts(coverage.conclude(complete=True)) == [(4, 0)]
