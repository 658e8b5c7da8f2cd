"""`forge test --cached` replays a pass only if a run could not end in another way; docs/how-to/testing.md."""

import json
import os
import re
import resource
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from tests.conftest import Forge, Ran, Tree
from tests.packages import manifest_text, write_files
from tests.testable import cmake_package, counted_results, python_package

pytestmark = pytest.mark.needs("cmake", "ctest", "ninja", "gcc")

PLAIN: dict[str, str | None] = {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "PYTEST_CURRENT_TEST": None}
"""Without plugins of the machine's pytest, and without what the pytest around these tests sets."""

FAILURES = "with test failures"
CODE = """import os
import pathlib
import p

HERE = pathlib.Path(__file__).parent


def test_data(tmp_path):
    (tmp_path / "scratch").write_text("x")
    assert (HERE / "data/number.txt").read_text() == "1\\n"
    assert p.VALUE == 1


def test_optional():
    assert not (HERE / "broken").exists()


def test_all_cases():
    assert len(os.listdir(HERE / "cases")) == 1


def test_variables():
    assert dict(os.environ).get("MY_" + "MODE", "good") == "good"
"""


def python(name: str, test: str = CODE) -> dict[str, str]:
    """Return a Python package with tests that look at files and folders."""
    return {
        **python_package(name, test.replace("import p\n", f"import {name} as p\n"), pytest=True),
        f"src/{name}/tests/data/number.txt": "1\n",
        f"src/{name}/tests/cases/one": "",
        "src/.gitignore": "data\n",
    }


def run(forge: Forge, root: Path, *words: str, env: dict[str, str | None] | None = None) -> Ran:
    """Run the tests; results must be those of the result files."""
    ran = forge("test", "--cached", *words, cwd=root, env={**PLAIN, **(env or {})})
    assert f"  {counted_results(root / 'build')}\n" in ran.out
    return ran


def remarks(ran: Ran) -> dict[str, str]:
    lines = [line for line in ran.out.splitlines() if line.startswith("Finished <<< ") and "\t[ " in line]
    return {line.split()[2]: line.partition("\t[ ")[2].removesuffix(" ]") for line in lines}


def why(ran: Ran) -> str:
    (remark,) = remarks(ran).values()
    return remark


def passed(forge: Forge, root: Path, **env: str | None) -> None:
    """Let a pass be recorded, and check that it is replayed."""
    assert forge("build", cwd=root).code == 0
    run(forge, root, env={**env})
    ran = run(forge, root, env={**env})
    assert {*remarks(ran).values()} == {"cached"}, ran.out
    assert " cached\n" in ran.out


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("ws")


@pytest.fixture
def root(forge: Forge, workspace: Path) -> Path:
    """Return a workspace with a recorded pass; only the first test has to build it."""
    shutil.rmtree(workspace / "src", ignore_errors=True)
    for name in ("forge.toml", "pytest.ini"):
        (workspace / name).unlink(missing_ok=True)
    passed(forge, write_files(workspace, python("p")))
    return workspace


def script(name: str, lines: str) -> dict[str, str]:
    """Return a Python package with one test of unittest, which starts faster than pytest."""
    head = f"""import os, pathlib, unittest
HERE = pathlib.Path(__file__).parent
BUILD = HERE.parents[2] / "build/{name}"
AWAY = str(HERE.parents[2] / "away/{name}")
class A(unittest.TestCase):
  def test_a(self):
"""
    return {**python_package(name, f"{head}    {lines}\n", pytest=False), f"src/{name}/tests/cases/one": ""}


ATTEMPTS = """import contextlib, ctypes
    with contextlib.suppress(OSError): os.chdir(AWAY + "/no_chdir")
    with contextlib.suppress(OSError): os.remove(AWAY + "/no_remove")
    with contextlib.suppress(OSError): os.rename(AWAY + "/no_rename", AWAY + "/to")
    with contextlib.suppress(OSError): os.rmdir(AWAY + "/no_rmdir")
    with contextlib.suppress(OSError): os.link(AWAY + "/no_link", AWAY + "/to")
    with contextlib.suppress(OSError): os.truncate(AWAY + "/no_truncate", 0)
    with contextlib.suppress(OSError): ctypes.CDLL(AWAY + "/no_CDLL")
    with contextlib.suppress(OSError): os.mkdir(AWAY + "/yes_mkdir")
    with contextlib.suppress(OSError): os.close(os.open(AWAY + "/yes_open", os.O_CREAT | os.O_EXCL))
    with contextlib.suppress(OSError): os.symlink("x", AWAY + "/yes_symlink")
    with contextlib.suppress(OSError): os.readlink(AWAY + "/yes_readlink")
"""
"""Calls that fail, with names of what is not there, or is there."""


def test_results_of_failed_calls_are_inputs(forge: Forge, tree: Tree) -> None:
    names = re.findall(r"(?:no|yes)_\w+", ATTEMPTS)
    files = {path: text for name in names for path, text in script(name.lower(), ATTEMPTS).items()}
    files |= {f"away/{name.lower()}/{each}": "" for name in names for each in names if each.startswith("yes")}
    root = tree(files)
    passed(forge, root)
    for name in names:
        path = root / "away" / name.lower() / name
        path.unlink() if path.exists() else path.touch()
    found = remarks(run(forge, root))
    assert {name for name in names if f"/{name}' has" not in found[name.lower()]} == set()


CHANGES: dict[str, tuple[str, Callable[[Path], object], str]] = {
    "source": ("src/source/source/__init__.py", lambda path: path.write_text("VALUE = 2\n"), FAILURES),
    "case": (
        "src/case/tests/test_case.py",
        lambda path: path.write_text(f"{path.read_text()}\n"),
        "has changed",
    ),
    "new_test": (
        "src/new_test/tests/test_q.py",
        lambda path: path.write_text("def test_q(): pass"),
        "/tests'",
    ),
    "data": ("src/data/tests/data/number.txt", lambda path: path.write_text("2\n"), FAILURES),
    "mode": ("src/mode/tests/data/number.txt", lambda path: path.chmod(0o600), "has changed"),
    "removed": ("src/removed/tests/data/number.txt", lambda path: path.unlink(), FAILURES),
    "missed": ("src/missed/tests/broken", lambda path: path.touch(), FAILURES),
    "listed": ("src/listed/tests/cases/two", lambda path: path.touch(), FAILURES),
    "result": ("build/result/pytest.xml", lambda path: path.unlink(), "has disappeared"),
    "edited": ("build/edited/pytest.xml", lambda path: path.write_text("<testsuite/>"), "has changed"),
    "touched": ("src/touched/tests/data/number.txt", os.utime, "cached"),
    "other": ("src/other/resource/other", os.utime, "cached"),
}
"""By packages, of which one file each is changed, with the remark on the next test."""


def test_tests_rerun_if_files_that_they_read_change(forge: Forge, tree: Tree) -> None:
    root = tree({path: text for name in CHANGES for path, text in python(name).items()})
    passed(forge, root)
    for path, apply, _ in CHANGES.values():
        apply(root / path)
    found = remarks(forge("test", "--cached", cwd=root, env=PLAIN))
    assert {name: CHANGES[name][2] in found[name] for name in CHANGES} == dict.fromkeys(CHANGES, True), found
    # Failures are never cached.
    again = remarks(run(forge, root))
    failed = {name for name, (_, _, remark) in CHANGES.items() if remark == FAILURES}
    assert {name for name, remark in again.items() if remark != "cached"} == failed


def test_settings_and_fixtures_outside_the_package_are_inputs(forge: Forge, root: Path) -> None:
    (root / "pytest.ini").write_text("[pytest]\n")
    assert why(run(forge, root)).endswith("pytest.ini' has appeared")
    assert why(run(forge, root)) == "cached"
    (root / "src/conftest.py").write_text("X = 1\n")
    assert why(run(forge, root)).endswith("conftest.py' has appeared")


def test_changed_options_rerun_the_tests(forge: Forge, root: Path) -> None:
    for words in (("--pytest-args", "-q"), ("--python-testing", "unittest")):
        assert why(run(forge, root, *words)) == "tests ran: the command of the tests has changed"
    ran = forge("test", "--cached", "--retest-until-fail", "1", cwd=root, env=PLAIN)
    assert "all tests run: '--cached' has no effect with '--retest-until-fail'" in ran.err
    assert "cached" not in ran.out


def test_variables_are_inputs_regardless_of_how_they_are_read(forge: Forge, root: Path) -> None:
    assert "with test failures" in run(forge, root, env={"MY_MODE": "bad"}).out
    passed(forge, root, MY_MODE="good")
    assert why(run(forge, root)) == "tests ran: the environment variable 'MY_MODE' has changed"


def test_session_variables_times_and_unrelated_files_are_not_inputs(forge: Forge, root: Path) -> None:
    env: dict[str, str | None] = {"SHLVL": "7", "SSH_TTY": "/dev/pts/9", "WINDOWID": "1", "OLDPWD": "/"}
    assert why(run(forge, root, env=env)) == "cached"
    os.utime(root / "src/p/tests/data/number.txt")
    (root / "src/README.md").write_text("new")
    for cache in (root / "src/p/p/__pycache__", root / "src/p/tests/__pycache__"):
        shutil.rmtree(cache, ignore_errors=True)
    assert why(run(forge, root)) == "cached"


def test_replays_are_marked_everywhere(forge: Forge, root: Path) -> None:
    suites = ET.parse(root / "build/p/pytest.xml").iter("testsuite")
    marks = [suite.findall("properties/property[@name='cached']") for suite in suites]
    assert [len(found) for found in marks] == [1]
    ran = forge("test", "--cached", "--json", cwd=root, env=PLAIN)
    events = [json.loads(line) for line in ran.out.splitlines()]
    (finished,) = (event for event in events if event["event"] == "Finished")
    assert finished["cache"] == "cached"
    assert events[-1]["cached"] == ["p"]
    assert events[-1]["tests"] == {"tests": 4, "errors": 0, "failures": 0, "skipped": 0}
    assert not [event for event in events if event["event"] == "StepStarted"]
    assert (root / "build/p/colcon_test.rc").read_text() == "0\n"


def test_only_cached_runs_are_replayed_and_option_files_can_enable_them(forge: Forge, root: Path) -> None:
    assert forge("test", cwd=root, env=PLAIN).code == 0
    assert "pytest.xml' has changed" in why(run(forge, root))
    (root / "forge.toml").write_text("[test]\ncached = true\n")
    assert "  1 package cached\n" in forge("test", cwd=root, env=PLAIN).out
    assert "cached" not in forge("test", "--no-cached", cwd=root, env=PLAIN).out


NOT_RECORDED = {
    "the network": ("import socket; socket.socket().close()", "they use the network"),
    "a host": ("import socket; socket.getaddrinfo('localhost', 1)", "they use the network"),
    "a host, as getent": ("import socket; socket.gethostbyname_ex('localhost')", "they use the network"),
    "an address": ("import socket; socket.getnameinfo(('127.0.0.1', 1), 0)", "they use the network"),
    "a device": ("open('/dev/zero').close(); open('/dev/kmsg', 'w').close()", "they use /dev/kmsg"),
    "a server": (
        "import contextlib, socket\n"
        "    with contextlib.suppress(OSError): socket.socket(socket.AF_UNIX).connect('/run/none')",
        "they use /run/none",
    ),
    "a message to a server": (
        "import contextlib, socket\n"
        "    with contextlib.suppress(OSError):\n"
        "        socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM).sendto(b'x', '/run/none')",
        "they use /run/none",
    ),
    "a queue": ("import ctypes; ctypes.CDLL(None).mq_open(b'/none', 0)", "they use a message queue"),
    "a semaphore": ("import ctypes; ctypes.CDLL(None).sem_open(b'/none', 0)", "they use a semaphore"),
    "a file elsewhere": ("(HERE.parent / 'out.txt').write_text('x')", "outside of the build folder"),
    "a temporary file of its own": (
        "(HERE.parent / 'out.txt').write_text('x'); (HERE.parent / 'out.txt').unlink()",
        "outside of the build folder",
    ),
    "what was replaced": (
        "import shutil; folder = BUILD / f'{BUILD.name}.egg-info'; shutil.rmtree(folder); folder.mkdir()",
        "which existed before",
    ),
    "a pipe": ("(BUILD / 'pipe').unlink(missing_ok=True); os.mkfifo(BUILD / 'pipe')", "they leave"),
    "what was built": ("(BUILD / 'install.log').open('a').close()", "install.log', which existed before"),
    "names beside what it left": (
        "os.listdir(BUILD / '.'); (BUILD / 'o').touch()",
        "and list its folder",
    ),
    "a program that stays": (
        "import subprocess; quiet = subprocess.DEVNULL\n"
        "    subprocess.Popen(['sleep', '20'], start_new_session=True, stdout=quiet, stderr=quiet)",
        "is still running",
    ),
    "a static program": ("import subprocess; subprocess.run([HERE / 'static'], check=True)", "be observed"),
    "a file that changes": ("os.utime(HERE / 'cases/one'); (HERE / 'cases/one').read_text()", "meanwhile"),
}


def test_nondeterministic_tests_are_not_recorded(forge: Forge, tree: Tree) -> None:
    names = {kind.replace(" ", "_").replace(",", ""): kind for kind in NOT_RECORDED}
    files: dict[str, str] = {"static.c": "int main(void) { return 0; }\n"}
    for name, kind in names.items():
        files |= script(name, NOT_RECORDED[kind][0])
    root = tree(files)
    for name in names:
        program = root / "src" / name / "tests/static"
        subprocess.run(["gcc", "-static", "-o", program, root / "static.c"], check=True)
    assert forge("build", cwd=root).code == 0
    assert {*remarks(run(forge, root)).values()} == {"tests ran: no run is recorded"}
    found = remarks(run(forge, root))
    for name, kind in names.items():
        assert found[name].startswith("tests ran: the last run cannot be replayed: ")
        assert NOT_RECORDED[kind][1] in found[name]


def test_failures_and_skipped_tests_are_never_cached(forge: Forge, built: Tree) -> None:
    root = built(python("p", "import pytest\n@pytest.mark.skip\ndef test_a(): pass\n"))
    run(forge, root)
    assert why(run(forge, root)) == "tests ran: the last run cannot be replayed: no test ran"
    test = root / "src/p/tests/test_p.py"
    test.write_text("def test_a(): assert 0\n")
    for _ in range(2):
        ran = run(forge, root, "--return-code-on-test-failure")
        assert ran.code == 1
        assert why(ran) == "with test failures"
    test.write_text("def test_a(): pass\n")
    passed(forge, root)


def test_leftovers_of_tests_are_removed_before_the_next_run(forge: Forge, tree: Tree) -> None:
    """So that this run begins as the one before it, also if that failed."""
    test = """import os, pathlib
BUILD = pathlib.Path(__file__).parents[3] / "build/p"
def test_a():
    assert not (BUILD / "count").exists()
    (BUILD / "count").write_text("1")
    (BUILD / "out").mkdir()
    (BUILD / "out/more").write_text("1")
    (BUILD / "link").symlink_to("nowhere")
    os.link(BUILD / "count", BUILD / "hard")
    open(BUILD / "new", "x").close()
    assert os.environ.get("MODE") != "bad"
"""
    root = tree(python("p", test))
    passed(forge, root)
    passed(forge, root, MODE="good")
    assert "with test failures" in run(forge, root, env={"MODE": "bad"}).out
    passed(forge, root)
    (root / "build/p/out/more").unlink()
    assert why(run(forge, root)).endswith("out/more' has disappeared")
    assert why(run(forge, root)) == "cached"


def test_resource_limits_are_inputs(forge: Forge, root: Path) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_CORE)
    resource.setrlimit(resource.RLIMIT_CORE, (4096 if soft != 4096 else 0, hard))
    try:
        assert why(run(forge, root)) == "tests ran: this machine has changed"
    finally:
        resource.setrlimit(resource.RLIMIT_CORE, (soft, hard))


def test_runner_state_of_earlier_runs_is_discarded(forge: Forge, tree: Tree) -> None:
    """With '--lf', pytest would otherwise run the test that failed last, and this would count as all."""
    root = tree(python("p", "def test_a(): pass\ndef test_b(): assert 0\n"))
    (root / "src/p/setup.cfg").write_text("[tool:pytest]\naddopts = --lf\n")
    assert forge("build", cwd=root).code == 0
    run(forge, root)
    (root / "src/p/tests/test_p.py").write_text("def test_a(): pass\ndef test_b(): pass\n")
    assert "  2 tests, 0 errors, 0 failures" in run(forge, root).out
    assert "  2 tests, 0 errors, 0 failures" in run(forge, root).out


def test_unittest_packages_are_cached_with_their_dependencies(forge: Forge, built: Tree) -> None:
    test = "import unittest\nimport q\nclass A(unittest.TestCase):\n    def test_a(self): assert q.VALUE\n"
    files = {**python_package("p", test, pytest=False), **python_package("q", "", pytest=False)}
    depends = manifest_text("p", "<depend>q</depend>", build_type="ament_python")
    root = built({**files, "src/p/package.xml": depends})
    select = ("--packages-select", "p")
    run(forge, root, *select)
    assert why(run(forge, root, *select)) == "cached"
    (root / "src/q/q/__init__.py").write_text("VALUE = 2\n")
    assert why(run(forge, root, *select)) == "cached"  # as long as it is not built
    assert forge("build", cwd=root).code == 0
    assert why(run(forge, root, *select)) == "tests ran: the package 'q' has changed"
    installed = next(root.glob("install/q/lib/python*/site-packages/q/__init__.py"))
    assert why(run(forge, root, *select)) == "cached"
    installed.write_text("VALUE = 0\n")
    assert "with test failures" in run(forge, root, *select).out


LISTS = """cmake_minimum_required(VERSION 3.18)
project(c C)
find_package(ament_cmake REQUIRED)
find_package(ament_cmake_pytest REQUIRED)
add_executable(unit unit.c)
ament_add_test(unit COMMAND $<TARGET_FILE:unit> GENERATE_RESULT_FOR_RETURN_CODE_ZERO)
ament_add_pytest_test(more more.py)
add_test(NAME plain COMMAND ${CMAKE_COMMAND} -E compare_files a b WORKING_DIRECTORY ${CMAKE_SOURCE_DIR})
ament_package()
"""
UNIT = """#include <stdio.h>
int main(void) {
  int number = 0;
  FILE *file = fopen("%s/number.txt", "r");
  return file && fscanf(file, "%%d", &number) == 1 ? number != 1 : 2;
}
"""


def test_ament_cmake_packages_are_cached_with_another_result_folder(
    forge: Forge, tree: Tree, tmp_path: Path
) -> None:
    base = ("--test-result-base", "results")
    folder = tmp_path / "src/c"
    depends = [f"<depend>ament_cmake{each}</depend>" for each in ("", "_pytest")]
    files = {"CMakeLists.txt": LISTS, "unit.c": UNIT % folder, "more.py": "def test_more(): pass\n"}
    files |= {"package.xml": manifest_text("c", *depends), "a": "", "b": "", "number.txt": "1\n"}
    root = tree({f"src/c/{name}": text for name, text in files.items()})
    assert forge("build", *base, cwd=root).code == 0

    def tested(*words: str) -> tuple[str, str]:
        ran = forge("test", "--cached", *base, *words, cwd=root, env=PLAIN)
        found = counted_results(root / "results")
        assert words or f"  {found}\n" in ran.out
        return why(ran), found

    assert tested()[0] == "tests ran: no run is recorded"
    assert tested() == ("cached", "3 tests, 0 errors, 0 failures, 0 skipped")
    (junit,) = (root / "results").rglob("unit.xml")
    assert len(ET.parse(junit).findall(".//property[@name='cached']")) == 1
    assert tested() == ("cached", "3 tests, 0 errors, 0 failures, 0 skipped")
    for name in ("a", "b"):
        (folder / name).write_text("same")
    assert tested()[0].endswith(("a' has changed", "b' has changed"))
    assert tested()[0] == "cached"
    assert tested("--ctest-args", "-R", "plain")[0] == "tests ran: the command of the tests has changed"
    assert tested("--ctest-args", "-R", "plain")[0] == "cached"
    assert tested()[0] == "tests ran: the command of the tests has changed"
    (folder / "number.txt").write_text("2\n")
    assert tested()[0] == "with test failures"
    (folder / "number.txt").write_text("1\n")
    (folder / "unit.c").write_text("int main(void) { return 1; }\n")
    assert forge("build", *base, cwd=root).code == 0
    assert tested()[0] == "with test failures"


def test_a_timeout_is_not_a_pass(forge: Forge, built: Tree) -> None:
    slow = (
        "add_test(NAME a COMMAND ${CMAKE_COMMAND} -E sleep 5)\nset_tests_properties(a PROPERTIES TIMEOUT 0.2)"
    )
    root = built(cmake_package("c", slow, "add_test(NAME b COMMAND ${CMAKE_COMMAND} -E true)"))
    for _ in range(2):
        assert why(run(forge, root)) == "with test failures"


def test_an_edit_during_a_test_run_is_detected(forge: Forge, built: Tree) -> None:
    test = """import pathlib, time
HERE = pathlib.Path(__file__).parent
def test_a():
    data = HERE / "data/number.txt"
    assert data.read_text() == "1\\n"
    (HERE.parents[2] / "build/p/started").touch()
    while data.read_text() != "2\\n":
        time.sleep(0.01)
"""
    root = built(python("p", test))
    wait = "until [ -e build/p/started ]; do sleep 0.05; done; echo 2 > src/p/tests/data/number.txt"
    with subprocess.Popen(["sh", "-c", wait], cwd=root):
        assert "with test failures" not in run(forge, root).out
    assert "with test failures" in run(forge, root).out


def test_tests_are_observed_only_on_request(forge: Forge, built: Tree) -> None:
    root = built(python("p", "import os\ndef test_a(): assert 'FORGE_OBSERVER_LOG' not in os.environ\n"))
    assert "0 failures" in forge("test", cwd=root, env=PLAIN).out


def test_temporary_files_are_removed(forge: Forge, root: Path, tmp_path: Path) -> None:
    folder = tmp_path / "temporary"
    folder.mkdir()
    run(forge, root, "--pytest-args", "-v", env={"TMPDIR": str(folder)})
    assert list(folder.iterdir()) == []
    assert list((root / "build/p/.forge_test").glob("observed/*")) == []
