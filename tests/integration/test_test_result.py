"""`forge test-result` prints results in colcon's format."""

import io
import json
import os
import shutil
import sys
from pathlib import Path

import pytest

from forge.testing.collecting import collect
from tests.conftest import Forge, Tree
from tests.testable import cmake_package

GOOD = '<testsuite name="a" tests="1" failures="0" errors="0" skipped="0"/>\n'
BAD = """<testsuite name="b" tests="2" failures="1" errors="0" skipped="0">
<testcase classname="b.test" name="no"><failure message="it is not"/></testcase></testsuite>
"""
RUN = """<Site><Testing><Test Status="failed"><Name>no</Name></Test>
<Test Status="passed"><Name>yes</Name></Test></Testing></Site>
"""


SKIPPED = """<testsuite name="s" tests="2" failures="0" skipped="2">
<testcase classname="a.test" name="why"><skipped message="no
camera"/></testcase><testcase classname="a.test" name="silent"><skipped/></testcase></testsuite>"""
_NOT_RUN = """<Test Status="notrun"><Name>{}</Name><Results><NamedMeasurement name="Completion Status">
<Value>{}</Value></NamedMeasurement><Measurement><Value>{}</Value></Measurement></Results></Test>"""
_TESTS = (("told", "SKIP_RETURN_CODE=77", "hi\nno lidar"), ("off", "Disabled", "Disabled"), ("odd", "", ""))
NOT_RUN = f"<Site><Testing>{''.join(_NOT_RUN.format(*test) for test in _TESTS)}</Testing></Site>"


@pytest.fixture
def results(tree: Tree) -> Path:
    """Return a folder with results of three packages, one of them ament's."""
    return tree(
        {
            "build/a/pytest.xml": GOOD,
            "build/b/unittest.xml": BAD,
            "build/b/CMakeFiles/other.xml": "<html/>",
            "build/b/.pytest_cache/hidden.xml": BAD,
            "build/c/Testing/TAG": "20260101-0000\nExperimental\n",
            "build/c/Testing/20260101-0000/Test.xml": RUN,
            "build/c/Testing/20250101-0000/Test.xml": RUN,
            "build/c/test_results/c/no.xunit.xml": BAD,
        }
    )


def test_failed_files_are_listed_and_the_summary_counts_all(forge: Forge, results: Path) -> None:
    ran = forge("test-result", cwd=results)
    assert ran.code == 1
    assert ran.err == ""
    assert ran.out == (
        "build/b/unittest.xml: 2 tests, 0 errors, 1 failure, 0 skipped\n"
        "build/c/test_results/c/no.xunit.xml: 2 tests, 0 errors, 1 failure, 0 skipped\n"
        "\nSummary: 6 tests, 0 errors, 2 failures, 0 skipped\n"
    )


def test_all_result_files_can_be_listed(forge: Forge, results: Path) -> None:
    ran = forge("test-result", "--all", "--verbose", cwd=results)
    assert ran.out.splitlines() == [
        "build/a/pytest.xml: 1 test, 0 errors, 0 failures, 0 skipped",
        "build/b/unittest.xml: 2 tests, 0 errors, 1 failure, 0 skipped",
        "- b.test no",
        "  <<< failure message",
        "    it is not",
        "  >>>",
        "build/c/Testing/20260101-0000/Test.xml: 1 test, 0 errors, 0 failures, 0 skipped",
        "build/c/test_results/c/no.xunit.xml: 2 tests, 0 errors, 1 failure, 0 skipped",
        "- b.test no",
        "  <<< failure message",
        "    it is not",
        "  >>>",
        "",
        "Summary: 6 tests, 0 errors, 2 failures, 0 skipped",
        "Files: 7 tests, 0 errors, 3 failures, 0 skipped (ament's tests twice, as CTest and JUnit results)",
    ]


def test_verbose_explains_skipped_tests(forge: Forge, tree: Tree) -> None:
    root = tree(
        {
            "build/a/pytest.xml": SKIPPED,
            "build/c/Testing/TAG": "20260101-0000\nExperimental\n",
            "build/c/Testing/20260101-0000/Test.xml": NOT_RUN,
        }
    )
    ran = forge("test-result", "--verbose", cwd=root)
    assert ran.out == (
        "Summary: 5 tests, 0 errors, 0 failures, 5 skipped\n"
        "Skipped:\n"
        "- a.test why: no camera\n"
        "- told: SKIP_RETURN_CODE=77, no lidar\n"
        "- off: Disabled\n"
    )
    assert "Skipped" not in forge("test-result", cwd=root).out


def test_only_paths_can_be_printed(forge: Forge, results: Path) -> None:
    ran = forge("test-result", "--result-files-only", cwd=results)
    assert (ran.code, ran.out) == (1, "build/b/unittest.xml\nbuild/c/test_results/c/no.xunit.xml\n")
    ran = forge("test-result", "--result-files-only", "--test-result-base", "build/a", cwd=results)
    assert (ran.code, ran.out) == (0, "")
    ran = forge("test-result", "--test-result-base", "build/a", cwd=results)
    assert (ran.code, ran.out) == (0, "Summary: 1 test, 0 errors, 0 failures, 0 skipped\n")


def test_results_can_be_printed_as_json(forge: Forge, results: Path) -> None:
    told = json.loads(forge("test-result", "--json", cwd=results).out)
    assert told["summary"] == {"tests": 6, "errors": 0, "failures": 2, "skipped": 0}
    assert told["results"][0]["path"] == "build/b/unittest.xml"
    assert told["results"][0]["cases"][0]["failures"] == ["it is not"]


def test_unreadable_results_are_errors(forge: Forge, tree: Tree) -> None:
    bomb = '<!DOCTYPE t [<!ENTITY a "b">]><testsuite tests="1" failures="0" name="&a;"/>'
    unknown = '<?xml version="1.0" encoding="klingon"?><testsuite tests="1" failures="0"/>'
    root = tree(
        {
            "build/a/bomb.xml": bomb,
            "build/a/torn.xml": "<testsuite tests=",
            "build/a/unknown.xml": unknown,
            "build/a/numbers.xml": '<testsuite tests="many" failures="0"/>',
            "build/a/test_results/a/empty.gtest.xml": "",
            "build/a/test_results/a/folder.xml/file": "",
            "build/a/test_results/a/other.xml": "<html/>",
            "build/a/test_results/a/within.xml": '<report><testsuite failures="1"/></report>',
            "build/b/pytest.xml": "<html/>",
            "build/b/Testing/TAG": "1\n",
            "build/b/Testing/1/Test.xml": "<html/>",
            "build/c/Testing/TAG": "1\n",
            "build/d/Testing/TAG": "",
            "build/d/Testing/1/Test.xml": "<html/>",
            "build/d/other.xml": "",
            "build/d/data.xml": "<html>",
        }
    )
    (root / "build/d/dangling.xml").symlink_to("nowhere")
    bad = ["a/bomb", "a/numbers", "a/test_results/a/empty.gtest", "a/test_results/a/folder", "a/torn"]
    bad += ["a/test_results/a/within", "a/unknown", "b/Testing/1/Test", "b/pytest"]
    paths = sorted((*(f"build/{name}.xml" for name in bad), "build/d/Testing/TAG"))
    ran = forge("test-result", cwd=root)
    lines = "".join(f"{path}: 1 test, 1 error, 0 failures, 0 skipped\n" for path in paths)
    assert (ran.code, ran.out) == (1, f"{lines}\nSummary: 10 tests, 10 errors, 0 failures, 0 skipped\n")
    assert "build/a/bomb.xml:1: error: not well-formed XML: document type declarations" in ran.err
    assert "build/a/unknown.xml:1: error: unknown encoding 'klingon'" in ran.err
    assert ran.err.count("error:") == 10
    assert "unknown encoding 'klingon'" in forge("test-result", "--verbose", cwd=root).out
    forge("test-result", "--delete-yes", cwd=root)
    assert (root / "build/a/torn.xml").exists()


ENCODINGS = ("utf-8-sig", "utf-16", "utf-32", "windows-1252", "gb18030")


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_results_are_decoded_by_their_declared_encoding(forge: Forge, tree: Tree, encoding: str) -> None:
    declared = encoding.removesuffix("-sig")
    case = '<testcase name="t"><failure message="93 °C"/></testcase>'
    text = f'<?xml version="1.0" encoding="{declared}"?><testsuite tests="1" failures="1">{case}</testsuite>'
    root = tree({"build/p/test_results/p/r.xml": ""})
    (root / "build/p/test_results/p/r.xml").write_bytes(text.encode(encoding))
    ran = forge("test-result", "--verbose", cwd=root)
    assert (ran.code, ran.err) == (1, "")
    assert "93 °C" in ran.out
    assert "Summary: 1 test, 0 errors, 1 failure" in ran.out


def test_results_in_a_linked_build_folder_count(forge: Forge, tree: Tree) -> None:
    """Such a link leads to another disk; links to folders that are not forge's are not followed."""
    root = tree({"disk/a/.forge/begun.json": "", "disk/a/pytest.xml": BAD, "other/pytest.xml": BAD})
    (root / "build").mkdir()
    (root / "build/a").symlink_to("../disk/a")
    (root / "build/other").symlink_to("../other")
    ran = forge("test-result", cwd=root)
    assert (ran.code, ran.out.splitlines()[0]) == (
        1,
        "build/a/pytest.xml: 2 tests, 0 errors, 1 failure, 0 skipped",
    )
    assert "Summary: 2 tests" in ran.out


def test_missing_results_are_a_warning(forge: Forge, tree: Tree) -> None:
    root = tree({"build/a/x": ""})
    ran = forge("test-result", cwd=root)
    assert (ran.code, ran.out) == (0, "Summary: 0 tests, 0 errors, 0 failures, 0 skipped\n")
    assert "warning: no test results in 'build'" in ran.err


def test_an_unreadable_folder_counts_as_an_error(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    root = tree({"build/p/test_results/p/r.xml": "<testsuite failures='1'/>"})
    folder = root / "build/p/test_results/p"
    folder.chmod(0)
    root.chmod(0o755)
    monkeypatch.chdir(root)
    user = os.geteuid()
    os.seteuid(user or 65534)
    try:
        found = collect(Path("build")).outcomes
    finally:
        os.seteuid(user)
        folder.chmod(0o755)
    assert [(outcome.path, outcome.counts.errors) for outcome in found] == [("build/p/test_results/p", 1)]
    assert "permission denied" in found[0].cases[0].errors[0].lower()


def test_a_folder_without_results_is_an_error(forge: Forge, tree: Tree) -> None:
    root = tree({"file": ""})
    assert forge("test-result", cwd=root).code == 2
    assert forge("test-result", "--test-result-base", "file", cwd=root).code == 2


def test_deleting_asks_for_confirmation(forge: Forge, results: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for answer, end in (("n\n", "Aborted\n"), ("", "Aborted\n"), ("what\ny\n", "Deleted 5 files\n")):
        monkeypatch.setattr(sys, "stdin", io.StringIO(answer))
        ran = forge("test-result", "--delete", cwd=results)
        assert ran.code == 0
        assert ran.out.startswith("- build/a/pytest.xml\n- build/b/unittest.xml\n- build/c/Testing/2026")
        assert "Delete these 5 files? [y/n] " in ran.out
        assert ran.out.endswith(end)
    assert (results / "build/b/CMakeFiles/other.xml").exists()
    assert forge("test-result", "--delete-yes", cwd=results).out == "No result files found to delete\n"


@pytest.mark.needs("cmake")
def test_results_of_removed_packages_do_not_count(forge: Forge, tree: Tree, built: Tree) -> None:
    names = ("stays", "goes", "moves", "ignored")
    root = built({path: text for name in names for path, text in cmake_package(name).items()})
    tree({"build/stays/a.xml": GOOD, "build/goes/a.xml": BAD, "build/moves/a.xml": GOOD})
    tree({"build/ignored/a.xml": BAD, "build/other/a.xml": GOOD})
    assert forge("test-result", cwd=root).code == 1
    shutil.rmtree(root / "src/goes")
    (root / "src/ignored/COLCON_IGNORE").touch()
    (root / "src/moves").rename(root / "moved")
    ran = forge("test-result", "--all", cwd=root)
    assert ran.code == 0
    assert [line.partition(":")[0] for line in ran.out.splitlines()[:3]] == [
        f"build/{name}/a.xml" for name in ("moves", "other", "stays")
    ]
    assert [line for line in ran.err.splitlines() if line.startswith("warning")] == [
        f"warning: ignoring results of '{name}', which is no longer in the workspace"
        for name in ("goes", "ignored")
    ]
