"""`forge test` with packages that are quick to build."""

import importlib.util
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.conftest import Forge, Ran, Tree
from tests.packages import manifest_text
from tests.snippets import ROOT
from tests.testable import PYTEST, UNITTEST, built_once, cmake_package, python_package, restored

pytestmark = pytest.mark.needs("cmake", "ctest", "ninja")

GOOD = "add_test(NAME good COMMAND ${CMAKE_COMMAND} -E true)"
BAD = 'add_test(NAME "bad.one" COMMAND sh -c "echo no luck; exit 3")'


@pytest.fixture(scope="module")
def all_kinds(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build a workspace with packages of all kinds, once."""
    files = {
        **cmake_package("c_bad", GOOD, BAD),
        **cmake_package("c_good", GOOD, needs="<depend>c_none</depend>"),
        **cmake_package("c_none"),
        **python_package("p_test", PYTEST.format(name="p_test"), pytest=True),
        **python_package("u_test", UNITTEST.format(name="u_test"), pytest=False),
        **python_package("u_none", "", pytest=False),
    }
    return built_once(tmp_path_factory.mktemp("built") / "ws", files)


@pytest.fixture
def workspace(all_kinds: Path) -> Path:
    """Return the workspace as it was built."""
    return restored(all_kinds)


def result(root: Path, name: str) -> str:
    """Return the content of colcon's result file of a package."""
    return (root / "build" / name / "colcon_test.rc").read_text().strip()


def lines(ran: Ran, beginning: str) -> list[str]:
    """Return the rest of each line with this beginning."""
    found = (line.strip() for line in ran.out.splitlines())
    return [line[len(beginning) :].strip() for line in found if line.startswith(beginning)]


def test_an_empty_folder_has_nothing_to_test(forge: Forge, tmp_path: Path) -> None:
    """Nothing is written, so that the folder does not become a workspace."""
    ran = forge("test", cwd=tmp_path)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err.startswith(f"error: no packages found below '{tmp_path}'\nhint: change to the root")
    assert list(tmp_path.iterdir()) == []


def test_all_kinds_of_packages_are_tested(forge: Forge, workspace: Path) -> None:
    ran = forge("test", cwd=workspace)
    assert ran.code == 0, ran.err
    assert "Summary: 6 packages finished" in ran.out
    assert "  9 tests, 0 errors, 3 failures, 1 skipped\n" in ran.out
    assert "  3 packages had test failures: c_bad p_test u_test\n" in ran.out
    finished = {line.split()[0]: line for line in lines(ran, "Finished <<<")}
    assert finished["c_bad"].endswith("s]\t[ with test failures ]")
    assert finished["c_good"].endswith("s]")
    assert [result(workspace, name) for name in ("c_bad", "c_good", "c_none", "u_none")] == [
        "test failures",
        "0",
        "0",
        "0",
    ]
    for name in ("p_test/pytest.xml", "u_test/unittest.xml", "u_none/unittest.xml", "c_bad/Testing/TAG"):
        assert (workspace / "build" / name).is_file()
    assert not (workspace / "build/c_none/Testing").exists()
    assert (workspace / "log/latest_test/c_bad/stdout_stderr.log").is_file()
    assert not list(workspace.glob("src/**/__pycache__"))
    ran = forge("test-result", cwd=workspace)
    assert ran.code == 1
    assert ran.out.endswith("\nSummary: 9 tests, 0 errors, 3 failures, 1 skipped\n")


def test_the_printed_commands_repeat_failed_tests(forge: Forge, workspace: Path) -> None:
    ran = forge("test", cwd=workspace)
    assert "3 failed tests:\n  c_bad: bad.one\n      no luck\n" in ran.out
    assert "  p_test: tests.test_p_test.test_value[2]\n      assert 2 == 1\n" in ran.out
    assert "  u_test: tests.test_u_test.Values.test_bad\n      AssertionError: 1 != 2\n" in ran.out
    for line, words in zip(
        lines(ran, "repeat:"), ("1 tests failed out of 1", "1 failed", "Ran 1 test"), strict=True
    ):
        done = subprocess.run(["sh", "-c", line], cwd=workspace, capture_output=True, text=True, check=False)
        assert done.returncode != 0
        assert words in done.stdout + done.stderr
        # In a subshell, so that the folder and the variables of the terminal remain; short enough to read.
        assert line.startswith("(. build/")
        assert str(workspace) not in line


FAILED = '<testsuite tests="0" failures="0"><testcase name="t"><failure message="no"/></testcase></testsuite>'


def test_a_test_program_that_exits_with_0_hides_no_failure(forge: Forge, built: Tree) -> None:
    cases = {
        "torn": ("<testsuite tests=", "r.xml", "{}/build/torn/r.xml"),
        "empty": ("", "test_results/p/r.gtest.xml", "{}/build/empty/test_results/p/r.gtest.xml"),
        "failed": (FAILED, "r.xml", "r: t"),
    }
    files: dict[str, str] = {}
    for name, (result, path, _) in cases.items():
        copy = f"copy ${{CMAKE_SOURCE_DIR}}/r ${{CMAKE_BINARY_DIR}}/{path}"
        write = f"add_test(NAME r COMMAND ${{CMAKE_COMMAND}} -E {copy})"
        fixture = "configure_file(r fixture.xml COPYONLY)"
        files |= {**cmake_package(name, fixture, write), f"src/{name}/r": result}
    root = built(files)
    (root / "build/empty/test_results/p").mkdir(parents=True)
    ran = forge("test", "--return-code-on-test-failure", cwd=root)
    assert ran.code == 1
    assert "3 packages had test failures: empty failed torn" in ran.out
    for name, (_, _, told) in cases.items():
        assert f"\n  {name}: {told.format(root)}\n" in ran.out
        assert (root / f"build/{name}/colcon_test.rc").read_text() == "test failures\n"
    assert forge("test", cwd=root).code == 0
    # What is not of this run does not count.
    ran = forge("test", "--return-code-on-test-failure", "--ctest-args", "-R", "none", cwd=root)
    assert ran.code == 0


def test_python_tests_without_a_readable_result_fail(forge: Forge, built: Tree) -> None:
    late = "import atexit, os\ndef test_a(): pass\n"
    cases = {
        "exits": "import os\ndef test_a(): os._exit(0)",
        "cut": f"{late}atexit.register(os.truncate, '../../build/cut/pytest.xml', 60)",
        "html": f"{late}def put(): open('../../build/html/pytest.xml', 'w').write('<html/>')\n"
        "atexit.register(put)",
    }
    root = built(
        {k: v for name, text in cases.items() for k, v in python_package(name, text, pytest=True).items()}
    )
    ran = forge("test", "--return-code-on-test-failure", cwd=root)
    assert ran.code == 1
    assert "3 packages had test failures: cut exits html" in ran.out
    assert "3 tests, 3 errors, 0 failures" in ran.out


CONFTEST = "import os\ndef pytest_{hook}:\n    {statement}\n"


def test_a_failed_pytest_run_is_an_error_in_the_results(forge: Forge, built: Tree) -> None:
    """This holds even if all tests that ran have passed, because CI systems read only the results."""
    root = built(python_package("p", "def test_a(): pass", pytest=True))
    conftest = root / "src/p/conftest.py"
    for hook, statement, told in (
        ("sessionfinish(session)", "session.exitstatus = 3", "pytest exited with code 3"),
        ("sessionfinish(session)", "session.exitstatus = 1", "pytest reported failed tests"),
        ("unconfigure(config)", "os.unlink(config.option.xmlpath)", "pytest exited without writing a result"),
    ):
        conftest.write_text(CONFTEST.format(hook=hook, statement=statement))
        assert_the_run_failed(forge, root, told)
    conftest.unlink()
    assert forge("test", "--return-code-on-test-failure", cwd=root).code == 0
    assert forge("test-result", cwd=root).out == "Summary: 1 test, 0 errors, 0 failures, 0 skipped\n"


@pytest.mark.parametrize(
    "line",
    [
        "set_directory_properties(PROPERTIES TEST_INCLUDE_FILES ${CMAKE_BINARY_DIR}/none.cmake)",
        "add_test(NAME rm COMMAND ${CMAKE_COMMAND} -E rm -r ${CMAKE_BINARY_DIR}/Testing)",
        "add_test(NAME rm COMMAND ${CMAKE_COMMAND} -E rm -r ${CMAKE_BINARY_DIR})",
    ],
)
def test_a_ctest_run_without_results_is_an_error_in_the_results(forge: Forge, built: Tree, line: str) -> None:
    root = built(cmake_package("p", GOOD, BAD, line))
    assert_the_run_failed(forge, root, "ctest exited without writing a result")


def test_ctest_arguments_that_select_no_test_are_an_error(forge: Forge, workspace: Path) -> None:
    options = ("--packages-select", "c_bad", "--ctest-args", "-D", "ContinuousTest")
    ran = forge("test", "--return-code-on-test-failure", *options, cwd=workspace)
    assert ran.code == 1
    assert "ctest exited without writing a result" in ran.out


def assert_the_run_failed(forge: Forge, root: Path, told: str) -> None:
    """Assert that the summary, the results and the JSON output contain one error."""
    ran = forge("test", "--return-code-on-test-failure", cwd=root)
    assert ran.code == 1
    assert told in ran.out
    summary = next(line for line in ran.out.splitlines() if ", 1 error, 0 failures, " in line).strip()
    ran = forge("test-result", "--verbose", cwd=root)
    assert ran.code == 1
    assert told in ran.out
    assert f"Summary: {summary}\n" in ran.out
    summary = json.loads(forge("test", "--json", cwd=root).out.splitlines()[-1])
    assert summary["tests"]["errors"] + len(summary["not_tested"]) == 1


def test_a_test_run_killed_with_forge_is_an_error(forge: Forge, built: Tree) -> None:
    root = built(
        {
            **cmake_package("c", 'add_test(NAME a COMMAND sh -c "touch ../c_began && sleep 60")'),
            **python_package("p", "import time\ndef test_a():\n    time.sleep(60)\n", pytest=True),
        }
    )
    killed = subprocess.Popen(
        [sys.executable, "-m", "forge", "test", "-j2"],
        cwd=root,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    began = (root / "build/c_began", root / "build/p/pytest.xml")
    end = time.monotonic() + 60
    while not all(path.exists() for path in began) and time.monotonic() < end:
        time.sleep(0.05)
    killed.kill()
    killed.wait()
    ran = forge("test-result", cwd=root)
    assert ran.code == 1
    assert ran.out.endswith("Summary: 2 tests, 2 errors, 0 failures, 0 skipped\n")
    # The next forge stops the programs of the killed one.
    assert forge("build", cwd=root).code == 0


def test_results_of_removed_tests_are_deleted(forge: Forge, built: Tree) -> None:
    root = built({**cmake_package("c", GOOD), **python_package("p", "def test_a(): pass", pytest=True)})
    for base in ("build", "results"):
        assert "  2 tests, 0 errors" in forge("test", "--test-result-base", base, cwd=root).out
    lists = root / "src/c/CMakeLists.txt"
    lists.write_text(lists.read_text().replace(GOOD, ""))
    assert forge("build", cwd=root).code == 0
    for base in ("build", "results"):
        forge("test", "--python-testing", "unittest", "--test-result-base", base, cwd=root)
        ran = forge("test-result", "--test-result-base", base, cwd=root)
        assert ran.out == "Summary: 0 tests, 0 errors, 0 failures, 0 skipped\n"


def test_frameworks_get_their_own_arguments(forge: Forge, workspace: Path) -> None:
    only = ("--packages-select", "c_bad", "p_test", "u_test")
    words = ("--ctest-args", "-R", "good", "--pytest-args", "-k", "good", "--unittest-args")
    ran = forge("test", *only, *words, "-k", "good", cwd=workspace)
    assert "test failures" not in ran.out
    assert "  3 tests, 0 errors, 0 failures, 0 skipped\n" in ran.out
    assert forge("test-result", cwd=workspace).out == "Summary: 3 tests, 0 errors, 0 failures, 0 skipped\n"


@pytest.mark.parametrize("source", ["command line", "colcon_defaults.yaml", "forge.toml", "mixin"])
def test_frameworks_get_arguments_that_are_also_options_of_forge(
    forge: Forge, workspace: Path, source: str
) -> None:
    """Only options of colcon end a list of arguments on the command line; lists in files need no end."""
    words = ["--log-level=DEBUG", "--strict", "-p", "no:cacheprovider", "--packages-select"]
    passed = words[:-1] if source == "command line" else words[:2]
    text = json.dumps(passed)
    options: tuple[str, ...] = ()
    match source:
        case "command line":
            options = ("--pytest-args", *words, "p_test")
        case "colcon_defaults.yaml":
            (workspace / source).write_text(f"test:\n  pytest-args: {text}\n")
        case "forge.toml":
            (workspace / source).write_text(f"[test]\npytest-args = {text}\n")
        case _:
            (workspace / "my.mixin").write_text(f"test:\n  mine:\n    pytest-args: {text}\n")
            options = ("--mixin-files", "my.mixin", "--mixin", "mine")
    ran = forge("test", *options, cwd=workspace)
    assert ran.code in {0, 1}
    assert f" {' '.join(passed)}" in (workspace / "log/latest_test/p_test/command.log").read_text()


def test_pytest_cov_is_used_if_installed(forge: Forge, workspace: Path) -> None:
    only = ("--packages-select", "p_test", "--pytest-with-coverage")
    ran = forge("test", *only, cwd=workspace)
    plugin = importlib.util.find_spec("pytest_cov") is not None
    assert (workspace / "build/p_test/coverage.xml").is_file() is plugin
    assert ("coverage is not measured" in ran.err) is not plugin


def test_coverage_is_part_of_the_summary(forge: Forge, workspace: Path) -> None:
    ran = forge("test", "--packages-select", "u_test", "c_good", "--coverage", cwd=workspace / "src")
    assert ran.code == 0
    assert (
        "not built for coverage: 'c_good'\nhint: forge build --mixin coverage --packages-select c_good"
        in ran.err
    )
    report = "../build/u_test/coverage.html/index.html"
    assert f"\nCoverage: 100.0% of 1 lines\n  u_test  100.0% of 1 lines: {report}\n" in ran.out
    assert (workspace / "src" / report).is_file()
    told = forge("test", "--packages-select", "u_test", "--coverage", "--json", cwd=workspace).out
    events = [json.loads(line) for line in told.splitlines()]
    assert [(e["package"], e["lines"], e["covered"]) for e in events if e["event"] == "Coverage"] == [
        ("u_test", 1, 1)
    ]
    assert events[-1]["tests"] == {"tests": 2, "errors": 0, "failures": 1, "skipped": 0}


def test_a_crashed_test_run_leaves_a_result_and_is_repeated(forge: Forge, workspace: Path) -> None:
    test = workspace / "src/u_test/tests/test_u_test.py"
    test.write_text("import os\nos._exit(1)\n")
    ran = forge("test", "--packages-select", "u_test", cwd=workspace)
    assert "  u_test: unittest.missing_result\n      unittest exited without writing a result\n" in ran.out
    assert "unittests.py" in lines(ran, "repeat:")[0]


def test_the_test_framework_can_be_selected(forge: Forge, workspace: Path) -> None:
    ran = forge("test", "--packages-select", "u_test", "--python-testing", "pytest", cwd=workspace)
    assert "had test failures: u_test" in ran.out
    assert (workspace / "build/u_test/pytest.xml").is_file()
    ran = forge("test", "--packages-select", "p_test", "--python-testing", "setuppy_test", cwd=workspace)
    assert (workspace / "build/p_test/unittest.xml").is_file()


def test_results_can_be_written_to_another_folder(forge: Forge, workspace: Path, tmp_path: Path) -> None:
    forge("test", "--test-result-base", str(tmp_path / "results"), cwd=workspace)
    names = {path.relative_to(tmp_path / "results").as_posix() for path in tmp_path.glob("results/*/*.xml")}
    assert names == {"p_test/pytest.xml", "u_test/unittest.xml", "u_none/unittest.xml"}
    assert (tmp_path / "results/c_bad/Testing/TAG").is_file()
    ran = forge("test-result", "--test-result-base", str(tmp_path / "results"), cwd=workspace)
    assert ran.out.endswith("\nSummary: 9 tests, 0 errors, 3 failures, 1 skipped\n")


COUNTING = """import pathlib
def test_third():
    count = pathlib.Path({path!r})
    count.write_text(count.read_text() + "x")
    assert len(count.read_text()) {relation} 3
"""


@pytest.mark.parametrize(
    "case",
    [
        (("--retest-until-pass", "5"), ">=", "passed", 3),
        (("--retest-until-pass", "1"), ">=", "failed", 2),
        (("--retest-until-fail", "5"), "<", "failed", 3),
        (("--retest-until-fail", "1"), "<", "passed", 2),
    ],
)
def test_tests_are_repeated_until_they_pass_or_fail(
    forge: Forge, workspace: Path, tmp_path: Path, case: tuple[tuple[str, ...], str, str, int]
) -> None:
    options, relation, end, runs = case
    count = tmp_path / "count"
    count.write_text("")
    (workspace / "src/u_none/tests/test_u_none.py").write_text(
        COUNTING.format(path=str(count), relation=relation)
    )
    ran = forge("test", "--packages-select", "u_none", "--python-testing", "pytest", *options, cwd=workspace)
    assert ("had test failures" in ran.out) is (end == "failed")
    assert len(count.read_text()) == runs


@pytest.mark.parametrize("kind", ["pytest", "ctest"])
def test_a_repetition_without_tests_hides_no_failure(forge: Forge, tree: Tree, kind: str) -> None:
    """The failed tests no longer exist when they are repeated."""
    if kind == "pytest":
        root = tree(python_package("p", "def test_a(): assert False", pytest=True))
        hook = "import pathlib\ndef pytest_collection_modifyitems(items):\n    flag = pathlib.Path('flag')\n"
        hook += "    items[:] = [] if flag.exists() else items\n    flag.touch()\n"
        (root / "src/p/conftest.py").write_text(hook)
    else:
        test = 'add_test(NAME t COMMAND sh -c "sed -i /add_test/d CTestTestfile.cmake; exit 1")'
        root = tree(cmake_package("p", test))
    assert forge("build", cwd=root).code == 0
    ran = forge("test", "--return-code-on-test-failure", "--retest-until-pass", "2", cwd=root)
    assert ran.code == 1
    assert ("ran no test when repeated" if kind == "pytest" else "1 failed test:\n  p: t\n") in ran.out
    assert "flaky" not in ran.out
    assert forge("test-result", cwd=root).code == 1


def test_unbuilt_packages_are_reported_and_others_tested(forge: Forge, tree: Tree) -> None:
    root = tree({**cmake_package("a", GOOD), **cmake_package("b", GOOD, needs="<depend>a</depend>")})
    ran = forge("test", cwd=root)
    assert ran.code == 2
    assert ran.err == (
        "error: no package can be tested: 'a', 'b' or their dependencies are not built\n"
        "hint: run 'forge build' first, with the same options to select packages\n"
    )
    ran = forge("test", "--packages-select", "a", cwd=root)
    assert ran.code == 2
    assert ran.err == "error: 'a' cannot be tested: 'a' is not built\nhint: forge build --packages-up-to a\n"
    assert forge("build", "--packages-select", "a", cwd=root).code == 0
    ran = forge("test", cwd=root)
    assert ran.code == 1
    assert "error: 'b' cannot be tested: 'b' is not built" in ran.err
    assert "Finished <<< a" in ran.out
    assert "  1 package failed: b\n" in ran.out


def test_a_program_that_cannot_be_started_fails_the_package(forge: Forge, workspace: Path) -> None:
    ran = forge("test", "--packages-select", "c_bad", cwd=workspace, env={"CTEST_COMMAND": "/no/ctest"})
    assert ran.code == 1
    assert "Failed   <<< c_bad" in ran.err
    assert result(workspace, "c_bad") == "127"


def test_a_package_whose_configuration_failed_is_not_tested(forge: Forge, built: Tree) -> None:
    """An earlier build is still installed, but 0 tests without a message would look like success."""
    root = built(cmake_package("c_good", GOOD))
    lists = root / "src/c_good/CMakeLists.txt"
    lists.write_text(lists.read_text() + "message(FATAL_ERROR no)\n")
    assert forge("build", cwd=root).code == 1
    ran = forge("test", cwd=root)
    assert "warning: 'c_good' cannot be tested: CMake failed in the last build" in ran.err
    assert "hint: forge build --packages-select c_good\n" in ran.err
    assert "1 package not tested: c_good" in ran.out
    assert forge("test", "--return-code-on-test-failure", cwd=root).code == 1
    lists.write_text(lists.read_text().replace("message(FATAL_ERROR no)\n", ""))
    assert forge("build", "--cmake-args", "-j4", cwd=root).code == 1, "CMake rejects this option"
    assert "CMake failed in the last build" in forge("test", cwd=root).err
    assert forge("build", "--packages-select", "c_good", cwd=root).code == 0
    assert "cannot be tested" not in forge("test", cwd=root).err


def test_a_package_whose_last_build_failed_is_not_tested(forge: Forge, tree: Tree) -> None:
    """The test programs and installed files of the previous build would pass."""
    fails = "add_custom_target(x ALL COMMAND sh -c 'test ! -e ${CMAKE_SOURCE_DIR}/fail')"
    root = tree(
        {
            **cmake_package("c", GOOD, fails),
            **python_package("p", "def test_a(): pass", pytest=True),
            **cmake_package("user", GOOD, needs="<depend>c</depend><depend>p</depend>"),
        }
    )
    setup = root / "src/p/setup.py"
    setup.write_text(f"import os\nassert not os.path.exists('fail')\n{setup.read_text()}")
    assert forge("build", cwd=root).code == 0
    for name in ("c", "p"):
        (root / "src" / name / "fail").write_text("")
        assert forge("build", cwd=root).code == 1
        ran = forge("test", "--return-code-on-test-failure", "--packages-select", "c", "p", cwd=root)
        assert ran.code == 1
        assert f"warning: '{name}' cannot be tested: its last build failed or was stopped" in ran.err
        assert f"1 package not tested: {name}" in ran.out
        assert forge("test-result", cwd=root).code == 1
        ran = forge("test", "--packages-select", "user", cwd=root)
        assert f"the last build of '{name}' failed or was stopped, so that tests use outdated" in ran.err
        (root / "src" / name / "fail").unlink()
        assert forge("build", cwd=root).code == 0
    assert forge("test", "--return-code-on-test-failure", cwd=root).code == 0
    assert forge("test-result", cwd=root).code == 0


def test_packages_of_unknown_build_types_are_skipped_with_a_warning(forge: Forge, tree: Tree) -> None:
    root = tree({"src/a/package.xml": manifest_text("a", build_type="catkin")})
    ran = forge("test", cwd=root)
    assert ran.code == 0
    assert "warning: cannot test 'a': unsupported build type 'catkin'" in ran.err
    assert "Summary: 0 packages finished" in ran.out
    assert "1 package not tested: a" in ran.out
    assert forge("test", "--return-code-on-test-failure", cwd=root).code == 1


def test_without_pytest_only_packages_that_need_it_are_not_tested(
    forge: Forge, workspace: Path, tmp_path: Path
) -> None:
    python = tmp_path / "python"
    python.write_text(f'#!/bin/sh\nexec "{sys.executable}" -S -E "$@"\n')
    python.chmod(0o755)
    ran = forge("test", "--python", str(python), cwd=workspace)
    assert ran.code == 1
    assert f"error: '{python}' has no pytest, which is required by 'p_test'" in ran.err
    assert "--python-testing unittest" in ran.err
    assert "Finished <<< c_good" in ran.out
    assert "1 package not tested: p_test" in ran.out
    assert "has no pytest" in forge("test-result", "--verbose", cwd=workspace).out
    alone = forge("test", "--python", str(python), "--packages-select", "p_test", cwd=workspace)
    assert (alone.code, "has no pytest" in alone.err) == (2, True)
    manifest = workspace / "src/p_test/package.xml"
    test_depend = "<test_depend>python3-pytest</test_depend></package>"
    manifest.write_text(manifest.read_text().replace("</package>", test_depend))
    (workspace / "forge.lock").touch()
    locked = forge("test", "--python", str(python), "--packages-select", "p_test", cwd=workspace)
    assert "hint: run 'forge fetch --test'; or test with unittest" in locked.err


def test_other_packages_are_tested_without_cargo(
    forge: Forge, tree: Tree, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = tree(
        {
            **cmake_package("a", "add_test(NAME t COMMAND sh -c true)"),
            "src/r/package.xml": manifest_text("r", build_type="ament_cargo"),
            "src/r/Cargo.toml": '[package]\nname = "r"\nversion = "0.1.0"\n',
            "install/r/share/colcon-core/packages/r": "",
        }
    )
    assert forge("build", "--packages-select", "a", cwd=root).code == 0
    monkeypatch.setattr("forge.plugins.cargo.build_type.find_program", lambda *_: None)
    ran = forge("test", cwd=root)
    assert (ran.code, "error: cargo not found; 'r' needs it\n" in ran.err) == (1, True)
    assert "1 package finished" in ran.out
    assert "1 package not tested: r" in ran.out


def test_tests_in_a_cycle_see_packages_that_were_built_later(forge: Forge, tree: Tree) -> None:
    """Tests of a need b, which needs a. colcon rejects this order, although builds do not need it."""
    check = 'add_test(NAME sees COMMAND sh -c "echo $CMAKE_PREFIX_PATH | grep -q install/b")'
    root = tree(
        {
            **cmake_package("a", check, needs="<test_depend>b</test_depend>"),
            **cmake_package("b", "install(FILES package.xml DESTINATION . RENAME bConfig.cmake)"),
        }
    )
    (root / "src/b/package.xml").write_text(manifest_text("b", "<depend>a</depend>", build_type="cmake"))
    built = forge("build", cwd=root)
    assert built.code == 0, built.err
    assert "warning: test dependency of 'a' on 'b' closes a cycle and is ignored" in built.err
    ran = forge("test", "--return-code-on-test-failure", cwd=root)
    assert ran.code == 0, ran.out
    assert forge("list", "-t", "-n", cwd=root).out == "a\nb\n"
    only = forge("build", "--packages-up-to", "b", cwd=root)
    assert "2 packages unchanged" in only.out


def test_sources_that_changed_since_the_build_are_reported(forge: Forge, tree: Tree, built: Tree) -> None:
    root = built(
        {
            **cmake_package("below", GOOD),
            **cmake_package("above", GOOD, needs="<depend>below</depend>"),
            **python_package("p", PYTEST.format(name="p"), pytest=True),
        }
    )
    assert "changed since its last build" not in forge("test", "--packages-select", "above", cwd=root).err
    tree({"src/below/CMakeLists.txt": (root / "src/below/CMakeLists.txt").read_text() + "\n"})
    tree({"src/below/new.txt": "", "src/p/p/__init__.py": "VALUE = 1 # edited\n"})
    ran = forge("test", "--packages-select", "above", cwd=root)
    assert ran.code == 0
    changed = "'below' has changed since its last build, so that tests use outdated files"
    assert ran.err.startswith(
        f"src/below: warning: {changed}: 'CMakeLists.txt' changed, 'new.txt' was added\nhint: "
    )
    # Its tests run in its source folder.
    assert "has changed since" not in forge("test", "--packages-select", "p", cwd=root).err
    assert forge("build", cwd=root).code == 0
    assert "changed since its last build" not in forge("test", "--packages-select", "above", cwd=root).err


def test_tests_that_are_to_be_repeated_are_not_cached(forge: Forge, built: Tree) -> None:
    root = built(cmake_package("c", GOOD))
    assert forge("test", "--cached", cwd=root).code == 0
    ran = forge("test", "--cached", "--retest-until-pass", "1", cwd=root)
    assert "all tests run: '--cached' has no effect with '--retest-until-pass'" in ran.err
    assert "cached" not in ran.out
