"""Single tests by name on the command line, and those that failed in the last run."""

from pathlib import Path

import pytest

from tests.conftest import Forge
from tests.testable import CASES, GTEST, built_once, failed_tests, restored, run_forge, save

pytestmark = pytest.mark.needs("cmake")


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = built_once(tmp_path_factory.mktemp("cases") / "ws", CASES)
    run_forge(root, "test")
    save(root, "tested")
    return root


@pytest.fixture
def root(workspace: Path) -> Path:
    """Return the built workspace."""
    return restored(workspace)


@pytest.fixture
def tested(workspace: Path) -> Path:
    """Return the built workspace after all its tests have run."""
    return restored(workspace, "tested")


@pytest.mark.parametrize(
    ("words", "counts", "names"),
    [
        ("p::Math.adds", "1 test, 0 errors, 1 failure", ["p: Math.adds"]),
        ("p::Math.subtracts", "1 test, 0 errors, 0 failures", []),
        ("p::Math", "2 tests, 0 errors, 1 failure", ["p: Math.adds"]),
        ("p::math::Other.fails", "1 test, 0 errors, 1 failure", ["p: Other.fails"]),
        ("p::math", "5 tests, 0 errors, 2 failures", ["p: Math.adds", "p: Other.fails"]),
        (
            "p::plain p::Math.adds",
            "6 tests, 0 errors, 3 failures",
            ["p: Math.adds", "p: Other.fails", "p: plain"],
        ),
        ("p::good", "1 test, 0 errors, 0 failures", []),
        ("p::Param.below p::Typed.size", "2 tests, 0 errors, 0 failures", []),
        ("p", "7 tests, 0 errors, 3 failures", ["p: Math.adds", "p: Other.fails", "p: plain"]),
        ("y::tests.test_y.test_value[2]", "1 test, 0 errors, 1 failure", ["y: tests.test_y.test_value[2]"]),
        ("y::tests/test_y.py::test_good", "1 test, 0 errors, 0 failures", []),
        ("y::test_good p::good", "2 tests, 0 errors, 0 failures", []),
        (
            "u::tests.test_u.Values.test_bad",
            "1 test, 0 errors, 1 failure",
            ["u: tests.test_u.Values.test_bad"],
        ),
        ("u::test_good", "1 test, 0 errors, 0 failures", []),
        ("y::tests/test_y.py", "4 tests, 0 errors, 1 failure", ["y: tests.test_y.test_value[2]"]),
        ("y::test_value[2]", "1 test, 0 errors, 1 failure", ["y: tests.test_y.test_value[2]"]),
        ("u::tests/test_u.py", "2 tests, 0 errors, 1 failure", ["u: tests.test_u.Values.test_bad"]),
        (
            "u::tests/test_u.py::Values::test_bad",
            "1 test, 0 errors, 1 failure",
            ["u: tests.test_u.Values.test_bad"],
        ),
    ],
)
def test_a_single_test_is_run_by_its_name(
    forge: Forge, tested: Path, words: str, counts: str, names: list[str]
) -> None:
    ran = forge("test", *words.split(), cwd=tested)
    assert ran.code == 0, ran.err
    assert counts in ran.out, ran.out
    assert failed_tests(ran) == names


def test_cases_and_suites_stay_known_until_a_full_run(forge: Forge, tested: Path) -> None:
    root = tested
    assert forge("test", "p::Math.adds", cwd=root).code == 0
    assert forge("test", "p::Math.typing_error", cwd=root).code == 2
    assert "1 test, 0 errors, 0 failures" in forge("test", "p::Math.subtracts", cwd=root).out
    assert "1 test, 0 errors, 1 failure" in forge("test", "p::Other", cwd=root).out
    assert "1 test, 0 errors, 0 failures" in forge("test", "p::size", cwd=root).out
    (root / "src/p/gtest.sh").write_text(GTEST.replace("Typed/1.size", ""))
    forge("test", "p", cwd=root)
    assert "'p' has no test 'size'" in forge("test", "p::size", cwd=root).err


def test_a_crashed_program_is_repeated_as_a_whole(forge: Forge, root: Path) -> None:
    result = '<testsuite name="p"><testcase classname="p.p" name="math"><failure/></testcase></testsuite>'
    (root / "src/p/gtest.sh").write_text(f"echo '{result}' > $1\nkill -9 $$\n")
    for words in (["p"], ["p::math"], ["--last-failed"]):
        ran = forge("test", *words, cwd=root)
        assert "p: math" in failed_tests(ran), ran.out
        assert "GTEST_FILTER" not in ran.out


def test_last_failed_runs_all_tests_after_a_crash_or_an_interrupt(forge: Forge, root: Path) -> None:
    tests = root / "src/y/tests/test_y.py"
    text = tests.read_text()
    tests.write_text(f"{text}\n\ndef test_crashes():\n    import os\n\n    os._exit(9)\n")
    forge("test", "y", cwd=root)
    tests.write_text(text)
    assert failed_tests(forge("test", "y", "--last-failed", cwd=root)) == ["y: tests.test_y.test_value[2]"]
    (root / "build/p/colcon_test.rc").write_text("SIGINT\n")
    assert "Starting >>> p" in forge("test", "--last-failed", cwd=root).out
    (root / "build/p/colcon_test.rc").write_text("SIGINT\n")
    assert "Starting >>> p" not in forge("test", "--packages-select-test-failures", cwd=root).out


def test_last_failed_reruns_tests_until_they_pass(forge: Forge, tested: Path) -> None:
    root = tested
    ran = forge("test", "--last-failed", cwd=root)
    assert len(failed_tests(ran)) == 5
    (root / "src/p/fixed").touch()
    forge("test", "p::Math.adds", "p::Other.fails", cwd=root)
    assert "0 packages finished" in forge("test", "p", "--last-failed", cwd=root).out
    ran = forge("test", "--last-failed", cwd=root)
    assert failed_tests(ran) == ["u: tests.test_u.Values.test_bad", "y: tests.test_y.test_value[2]"]
    assert "2 tests, 0 errors, 2 failures" in ran.out


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("p::goood", "error: 'p' has no test 'goood'\nhint: did you mean 'good'?\n"),
        (
            "p::xyz",
            "hint: its tests are 'math', 'plain', 'good'; tests inside of these programs are known after",
        ),
        ("p::", "error: 'p::' does not name a test\n"),
        ("q::x", "error: no package named 'q' in the workspace\n"),
    ],
)
def test_a_name_without_a_test_is_an_error(forge: Forge, root: Path, word: str, message: str) -> None:
    ran = forge("test", word, cwd=root)
    assert (ran.code, message in ran.err) == (2, True), ran.err


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("y::tests.test_y.test_none", "no test of 'y' has such a name"),
        ("y::tests/test_y.py::test_none", "no test of 'y' has such a name"),
        ("y::tests/test_none.py", "no test of 'y' has such a name"),
        ("y::tests.test_y.test_value[5]", "no test of 'y' has such a name"),
        ("u::tests.test_u.Values.test_none", "no test of 'u' has such a name"),
        ("u::tests.test_u.None", "no test of 'u' has such a name"),
        ("y::-x", "'y::-x' does not name a test"),
    ],
)
def test_a_node_that_pytest_does_not_find_is_an_error(
    forge: Forge, root: Path, word: str, message: str
) -> None:
    ran = forge("test", word, "--return-code-on-test-failure", cwd=root)
    assert (ran.code, f"error: {message}\n" in ran.err) == (2, True), ran.err


def test_last_failed_runs_all_tests_of_unittest_after_a_failed_import(forge: Forge, root: Path) -> None:
    file = root / "src/u/tests/test_u.py"
    text = file.read_text()
    file.write_text(f"import no_such_module\n{text}")
    assert "1 error" in forge("test", "u", cwd=root).out
    file.write_text(text)
    assert failed_tests(forge("test", "--last-failed", cwd=root)) == ["u: tests.test_u.Values.test_bad"]


def test_a_failed_import_is_a_failure(forge: Forge, root: Path) -> None:
    (root / "src/y/tests/conftest.py").write_text("import no_such_module\n")
    ran = forge("test", "y::tests.test_y.test_value", cwd=root)
    assert (ran.code, "has such a name" in ran.err) == (1, False), ran.err


def test_a_parameter_may_be_written_in_any_alphabet(forge: Forge, root: Path) -> None:
    tests = root / "src/y/tests/test_y.py"
    tests.write_text(
        "import pytest\n\n\n@pytest.mark.parametrize('v', ['\u00fc', '[b] c'])\n"
        "def test_value(v):\n    assert 0\n"
    )
    forge("test", "y", cwd=root)
    for word in ("tests.test_y.test_value[\u00fc]", "test_value[\u00fc]", "test_value[[b] c]"):
        assert "1 test, 0 errors, 1 failure" in forge("test", f"y::{word}", cwd=root).out


def test_a_named_test_that_does_not_run_is_an_error(forge: Forge, root: Path) -> None:
    ran = forge("test", "y::test_missing", "p::good", cwd=root)
    assert (ran.code, "1 test, 0 errors, 0 failures" in ran.out) == (2, True), ran.out
    message = "error: no test of 'y' has such a name\nhint: all tests of the package: forge test y\n"
    assert ran.err.endswith(message)


def test_renamed_tests_do_not_prevent_rerunning_others(forge: Forge, root: Path) -> None:
    tests = root / "src/y/tests/test_y.py"
    tests.write_text(f"{tests.read_text()}\n\ndef test_old():\n    assert 0\n")
    forge("test", "y", "u", "p", cwd=root)
    in_unittest = root / "src/u/tests/test_u.py"
    in_unittest.write_text(in_unittest.read_text().replace("test_bad", "test_worse"))
    tests.write_text(tests.read_text().replace("test_old", "test_new"))
    lists = root / "src/p/CMakeLists.txt"
    lists.write_text(lists.read_text().replace("NAME plain", "NAME fancy"))
    forge("build", cwd=root)
    ran = forge("test", "--last-failed", cwd=root)
    in_u = ["u: tests.test_u.Values.test_worse"]
    in_y = ["y: tests.test_y.test_value[2]", "y: tests.test_y.test_new"]
    assert failed_tests(ran) == ["p: Math.adds", "p: Other.fails", *in_u, *in_y]


def test_an_inherited_failed_test_is_rerun(forge: Forge, root: Path) -> None:
    tests = root / "src/y/tests"
    (tests / "base.py").write_text("class Base:\n    def test_inherited(self):\n        assert 0\n")
    (tests / "test_x.py").write_text("from .base import Base\n\n\nclass TestOfIt(Base):\n    pass\n")
    for words in (["y"], ["--last-failed"]):
        assert "y: tests.test_x.TestOfIt.test_inherited" in failed_tests(forge("test", *words, cwd=root))


def test_parameters_may_contain_colons(forge: Forge, root: Path) -> None:
    tests = root / "src/y/tests/test_y.py"
    tests.write_text(
        "import pytest\n\n\n@pytest.mark.parametrize('v', ['a::b', 'c d'])\n"
        "def test_value(v):\n    assert v == 'c d'\n"
    )
    forge("test", "y", cwd=root)
    for words in (["--last-failed"], ["y::tests.test_y.test_value[a::b]"]):
        ran = forge("test", *words, cwd=root)
        assert failed_tests(ran) == ["y: tests.test_y.test_value[a::b]"], ran.out
