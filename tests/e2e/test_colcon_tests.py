"""forge and colcon test the same packages and read the same results.

docs/reference/from-colcon.md lists what is meant to differ.
"""

import random
import re
from collections.abc import Iterator
from pathlib import Path
from xml.sax.saxutils import quoteattr

import pytest

from tests.conftest import Forge, Ran, Tree
from tests.packages import manifest_text
from tests.peers import ROS, Colcon, colcon_in
from tests.snippets import ROOT
from tests.testable import PYTEST, UNITTEST, cmake_package, python_package

pytestmark = [pytest.mark.slow, pytest.mark.needs("colcon", "cmake", "ctest", "ninja")]

AMENT = """cmake_minimum_required(VERSION 3.18)
project(a_test NONE)
find_package(ament_cmake REQUIRED)
if(BUILD_TESTING)
  ament_add_test(good COMMAND true GENERATE_RESULT_FOR_RETURN_CODE_ZERO)
  ament_add_test(bad COMMAND false)
endif()
ament_package()
"""


@pytest.fixture(scope="module")
def colcon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Colcon]:
    with colcon_in(tmp_path_factory.mktemp("home")) as running:
        yield running


def without_times(ran: Ran) -> list[str]:
    return [re.sub(r"\d{8}-\d{4}|\[[\d.]+s\]", "", line) for line in ran.out.splitlines()]


def results(root: Path) -> set[str]:
    """Return the files that tests left, whenever that was, and colcon's notes."""
    names = {path.relative_to(root).as_posix() for path in root.glob("build/*/**/*") if path.is_file()}
    kept = {name for name in names if re.search(r"\.xml$|/TAG$|colcon_test\.rc$", name)}
    return {re.sub(r"\d{8}-\d{4}", "STAMP", name) for name in kept if "wheel" not in name}


def notes(root: Path) -> dict[str, str]:
    return {path.parent.name: path.read_text() for path in root.glob("build/*/colcon_test.rc")}


def test_both_tools_run_the_same_tests_with_the_same_results(
    colcon: Colcon, forge: Forge, tree: Tree
) -> None:
    root = tree(
        {
            **cmake_package("c_bad", "add_test(good true)", 'add_test(bad "false")'),
            **cmake_package("c_good", "add_test(good true)", needs="<depend>c_bad</depend>"),
            **cmake_package("c_none"),
            **python_package("p_test", PYTEST.format(name="p_test"), pytest=True),
            **python_package("p_none", "", pytest=True),
            "src/a_test/package.xml": manifest_text("a_test", "<depend>ament_cmake</depend>"),
            "src/a_test/CMakeLists.txt": AMENT,
        }
    )
    assert forge("build", cwd=root, env={**ROS, "PYTHONPATH": str(ROOT)}).code == 0
    ours = forge("test", cwd=root, env=ROS)
    assert ours.code == 0, ours.err
    our_files, our_notes = results(root), notes(root)
    our_sums = forge("test-result", "--all", "--verbose", cwd=root)
    forge("test-result", "--delete-yes", cwd=root)

    theirs = colcon("test", cwd=root)
    assert theirs.code == 0
    assert (results(root), notes(root)) == (our_files, our_notes)
    for said in ("finished", "had test failures", "failed:"):
        assert [line for line in without_times(ours) if said in line] == [
            line for line in without_times(theirs) if said in line
        ]
    their_sums = colcon("test-result", "--all", cwd=root)
    # Each tool reads the other's results as its own.
    assert without_times(forge("test-result", "--all", "--verbose", cwd=root)) == without_times(our_sums)
    assert our_sums.code == their_sums.code == 1
    # What ament's tests leave twice is counted once; the files together are what colcon sums up.
    their_sum = without_times(their_sums)[-1].partition(": ")[2]
    assert f"Files: {their_sum} " in our_sums.out


def test_unittest_results_exist_where_colcon_fails(colcon: Colcon, forge: Forge, tree: Tree) -> None:
    root = tree(python_package("u_test", UNITTEST.format(name="u_test"), pytest=False))
    assert forge("build", cwd=root, env={**ROS, "PYTHONPATH": str(ROOT)}).code == 0
    assert colcon("test", cwd=root).code == 1
    assert forge("test", cwd=root, env=ROS).code == 0
    assert notes(root) == {"u_test": "test failures\n"}


def test_ament_results_are_written_to_the_given_folder(forge: Forge, tree: Tree) -> None:
    root = tree(
        {
            "src/a_test/package.xml": manifest_text("a_test", "<depend>ament_cmake</depend>"),
            "src/a_test/CMakeLists.txt": AMENT,
        }
    )
    option = ("--test-result-base", "results")
    assert forge("build", *option, cwd=root, env={**ROS, "PYTHONPATH": str(ROOT)}).code == 0
    assert forge("test", *option, cwd=root, env=ROS).code == 0
    ran = forge("test-result", *option, cwd=root)
    assert ran.out.endswith("\nSummary: 2 tests, 0 errors, 1 failure, 0 skipped\n")
    assert (root / "results/a_test/bad.xml").is_file()
    assert (root / "results/a_test/Testing/TAG").is_file()


def test_results_survive_a_rebuild(colcon: Colcon, forge: Forge, tree: Tree) -> None:
    copy = "copy ${CMAKE_SOURCE_DIR}/r ${CMAKE_BINARY_DIR}/s/r.xml"
    write = f"add_test(NAME w COMMAND ${{CMAKE_COMMAND}} -E {copy})"
    root = tree(
        {
            **cmake_package("c", 'add_test(NAME bad COMMAND sh -c "exit 1")', write),
            "src/c/r": '<testsuite tests="1" failures="0"/>',
            **python_package("p", PYTEST.format(name="p"), pytest=True),
            **python_package("u", UNITTEST.format(name="u"), pytest=False),
        }
    )
    variables = {**ROS, "PYTHONPATH": str(ROOT)}
    edited = [root / path for path in ("src/c/CMakeLists.txt", "src/p/p/__init__.py", "src/u/u/__init__.py")]
    assert forge("build", cwd=root, env=variables).code == 0
    forge("test", cwd=root, env=ROS)
    before = {path: path.read_bytes() for path in root.glob("build/*/**/*.xml")}
    assert len(before) == 4
    for options in ([], ["--force"], ["--cmake-clean-cache"], ["--cmake-args", "-DA=1"]):
        for path in edited:
            path.write_text(f"{path.read_text()}# edited\n")
        assert forge("build", *options, cwd=root, env=variables).code == 0
        assert {path: path.read_bytes() for path in before} == before
    for path in edited:
        path.write_text(f"{path.read_text()}(\n")
    assert forge("build", "--continue-on-error", cwd=root, env=variables).code == 1
    for options in ([], ["--all"], ["--verbose"]):
        ours = forge("test-result", *options, cwd=root)
        theirs = colcon("--log-base", "/dev/null", "test-result", *options, cwd=root)
        assert (ours.code, ours.out.partition("Skipped:")[0]) == (theirs.code, theirs.out), options
        assert ours.code == 1


@pytest.mark.parametrize("seed", range(25))
def test_both_tools_read_all_result_formats_equally(
    colcon: Colcon, forge: Forge, tree: Tree, seed: int
) -> None:
    root = tree(dict(random_results(random.Random(seed))))
    for options in ([], ["--all"], ["--verbose"], ["--all", "--verbose"], ["--result-files-only"]):
        ours = forge("test-result", *options, cwd=root)
        theirs = colcon("--log-base", "/dev/null", "test-result", *options, cwd=root)
        assert (ours.code, ours.out) == (theirs.code, theirs.out), options


def random_results(chance: random.Random) -> Iterator[tuple[str, str]]:
    """Yield result files, odd ones among them."""
    yield "build/.built_by", "colcon"
    for number in range(chance.randint(1, 6)):
        home = f"build/p{number}"
        for name in chance.sample(["pytest", "a.gtest", "sub/b", ".hidden/c", "test_results/d.xunit"], 3):
            text = random_junit(chance)
            # What is no result in the place of pytest's is an error for forge, and nothing for colcon.
            no_result = name == "pytest" and text == "<html/>"
            yield f"{home}/{name}.xml", random_suite(chance) if no_result else text
        if chance.random() < 0.5:
            yield f"{home}/Testing/TAG", "20260101-0000\nExperimental\n"
            yield f"{home}/Testing/20260101-0000/Test.xml", random_ctest(chance)
            yield f"{home}/Testing/20250101-0000/Test.xml", random_ctest(chance)


def random_junit(chance: random.Random) -> str:
    """Return a JUnit file, or some other XML."""
    kind = chance.random()
    if kind < 0.1:
        return "<html/>"
    suites = "".join(random_suite(chance) for _ in range(chance.randint(1, 3)))
    return f"<testsuites>{suites}</testsuites>" if kind < 0.6 else random_suite(chance)


def random_suite(chance: random.Random) -> str:
    """Return a suite with cases; it may count more than it has, as in real life."""
    cases = "".join(random_case(chance) for _ in range(chance.randint(0, 3)))
    counts = {"tests": cases.count("<testcase") + chance.randint(0, 3)}
    for name, tag in (("failures", "<failure"), ("errors", "<error"), ("skipped", "<skipped")):
        counts[name] = cases.count(tag) + chance.choice([0, 0, 1, 2])
    for name in chance.sample(["skip", "disabled"], chance.randint(0, 2)):
        counts[name] = chance.choice([0, 1, 2])
    attributes = " ".join(f'{name}="{count}"' for name, count in counts.items())
    return f'<testsuite name="s" {attributes}>{cases}</testsuite>'


def random_case(chance: random.Random) -> str:
    """Return a case with messages of several lines, or none."""
    told = {
        name: chance.choice(["x.y", "test & more", "a <b>"])
        for name in chance.sample(["classname", "name", "file", "line"], chance.randint(0, 4))
    }
    if "line" in told:
        told["line"] = str(chance.randint(1, 99))
    attributes = " ".join(f"{name}={quoteattr(value)}" for name, value in told.items())
    parts = chance.sample(
        [
            f"<failure message={quoteattr(chance.choice(TEXTS))}>text</failure>",
            f"<error message={quoteattr(chance.choice(TEXTS))}/>",
            "<error/>",
            "<skipped/>",
            "<system-out>\nsaid\n\nmore \n</system-out>",
            "<system-err>wrong</system-err>",
        ],
        chance.randint(0, 4),
    )
    return f"<testcase {attributes}>{''.join(parts)}</testcase>"


TEXTS = ["one", "one\ntwo\n", "\n\n  indented\nlines", ""]


def random_ctest(chance: random.Random) -> str:
    tests = "".join(
        f'<Test Status="{chance.choice(["passed", "failed", "notrun", "odd"])}"><Name>c{number}</Name>'
        f"<Results><Measurement><Value>{chance.choice(TEXTS)}</Value></Measurement></Results></Test>"
        for number in range(chance.randint(0, 3))
    )
    return f'<Site BuildName="x"><Testing><StartDateTime/>{tests}</Testing></Site>'
