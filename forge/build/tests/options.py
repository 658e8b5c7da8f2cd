"""The options of `forge test`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from forge.base.env_vars import EXECUTORS, default_executor
from forge.base.frozen import frozen
from forge.base.options import flag, option

_RUNNERS = "test runners"
_TIMES: dict[str, Any] = {"default": 0, "parse": int, "metavar": "N", "conflicts": "retest"}


@frozen
class TestOptions:
    GROUP = "test options"

    __test__ = False  # pytest collects classes with this prefix

    test_result_base: Path | None = option(
        "folder for result files (default: the build folder)",
        parse=lambda path: Path(path).absolute(),
        metavar="DIR",
    )
    retest_until_fail: int = option("repeat passing tests up to N times, until they fail", **_TIMES)
    retest_until_pass: int = option("repeat failing tests up to N times, until they pass", **_TIMES)
    test_timeout: float = option(
        "time limit of each CTest test, or of the whole run with another runner; its child processes are "
        "stopped, too (default: no limit)",
        default=0.0,
        parse=float,
        metavar="SECONDS",
    )
    test_jobs: int = option(
        "maximum number of tests of one CMake package to run in parallel (default: its share of --jobs)",
        default=0,
        parse=int,
        metavar="N",
    )
    cached: bool = flag(
        "replay passed tests whose inputs have not changed; tests are observed to determine their inputs"
    )
    abort_on_error: bool = flag("stop when a package cannot be tested (failing tests do not stop the run)")
    return_code_on_test_failure: bool = flag(
        "exit with code 1 if a test failed (default: exit with code 0, like colcon)"
    )
    fail_if_no_tests: bool = flag("exit with code 1 if no test ran")
    coverage: bool = flag(
        "measure which lines the tests execute, with gcovr and coverage.py; build C and C++ packages with "
        "--mixin coverage",
    )
    timings: bool = flag("write an HTML report of times and a trace file into the log folder")
    executor: str = option(
        "test packages in parallel, or sequentially in topological order (default: parallel)",
        default_factory=lambda: default_executor(EXECUTORS),
        choices=EXECUTORS,
    )
    python: str | None = option(
        "interpreter for Python tests (default: that of the last build)", metavar="PATH", group=_RUNNERS
    )
    ctest_args: tuple[str, ...] = option(
        "arguments for CTest, for all packages; takes all arguments up to the next option of colcon",
        default=(),
        metavar="ARG",
        group=_RUNNERS,
    )
    python_testing: str | None = option(
        "runner of Python tests; setuppy_test is colcon's name for unittest (default: pytest if the package "
        "depends on it, else unittest)",
        choices=("pytest", "unittest", "setuppy_test"),
        group=_RUNNERS,
    )
    pytest_args: tuple[str, ...] = option("arguments for pytest", default=(), metavar="ARG", group=_RUNNERS)
    pytest_with_coverage: bool = flag("measure coverage with pytest-cov", group=_RUNNERS)
    cargo_args: tuple[str, ...] = option(
        "arguments for `cargo test`", default=(), metavar="ARG", group=_RUNNERS
    )
    unittest_args: tuple[str, ...] = option(
        "arguments for unittest", default=(), metavar="ARG", group=_RUNNERS
    )
