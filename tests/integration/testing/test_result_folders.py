"""Only test results are replaced and deleted in folders for test results."""

from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.integration.test_folder_marks import everything
from tests.packages import write_files
from tests.testable import built_once, cmake_package, python_package, restored

PASSES = "def test_a(): pass"
GOOD = 'add_test(NAME good COMMAND ${CMAKE_COMMAND} -E echo "well")'
JUNIT = '<testsuites><testsuite tests="1"><testcase classname="{}.test.x" name="x"/></testsuite></testsuites>'


@pytest.fixture(scope="module")
def built_workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build packages with tests of three frameworks."""
    packages = {
        **cmake_package("c", GOOD),
        **python_package("p", PASSES, pytest=True),
        **python_package("u", PASSES, pytest=False),
    }
    return built_once(tmp_path_factory.mktemp("results") / "ws", packages)


@pytest.fixture
def workspace(built_workspace: Path) -> Path:
    """Return the workspace as it was built."""
    return restored(built_workspace)


@pytest.mark.parametrize(
    ("name", "way"),
    [
        ("p/pytest.xml", "forge.toml"),
        ("p/unittest.xml", "option"),
        ("u/pytest.xml", "option"),
        ("u/unittest.xml", "link"),
        ("c/Testing/TAG", "option"),
        ("c/Testing/20240101-0000/mine", "link"),
        ("c/test_results/c/mine.xml", "option"),
    ],
)
def test_results_do_not_replace_user_files(forge: Forge, workspace: Path, name: str, way: str) -> None:
    text = JUNIT.format("mine") if name.endswith("pytest.xml") else "mine"
    root = write_files(workspace, {f"results/{name}": text})
    if way == "link":
        (root / "link").symlink_to("results")
    if way == "forge.toml":
        (root / "forge.toml").write_text("[test]\ntest-result-base = 'results'\n")
    words = {"link": ("--test-result-base", "link"), "option": ("--test-result-base", "results")}
    before = everything(root)
    ran = forge("test", *words.get(way, ()), cwd=root)
    assert (ran.code, everything(root)) == (2, before), ran.out + ran.err
    assert "--test-result-base" in ran.err
    assert name.split("/")[1] in ran.err


def test_result_folders_are_recognized(forge: Forge, workspace: Path) -> None:
    """Folders of forge have a marker, which stays without a build folder; colcon's contain its results."""
    root = write_files(
        workspace,
        {
            "results/c/mine": "mine",
            "results/p/mine.xml": "mine",
            "results/p/pytest.xml": JUNIT.format("p"),
            "results/c/Testing/TAG": "20240101-0000\nExperimental\n",
            "results/c/Testing/20240101-0000/Test.xml": "<Site/>",
        },
    )
    for _ in range(2):
        ran = forge("test", "--test-result-base", "results", cwd=root)
        assert ran.code == 0, ran.out + ran.err
        assert "2 tests, 0 errors" in ran.out
    assert [(root / f"results/{name}").read_text() for name in ("c/mine", "p/mine.xml")] == ["mine"] * 2


def test_results_are_found_without_a_build_folder(forge: Forge, tree: Tree) -> None:
    root = tree({"results/p/pytest.xml": JUNIT.format("p")})
    ran = forge("test-result", "--test-result-base", "results", cwd=root)
    assert (ran.code, ran.out) == (0, "Summary: 1 test, 0 errors, 0 failures, 0 skipped\n")
    ran = forge("test-result", cwd=root)
    assert ran.code == 2
    assert "'build' does not exist" in ran.err


def test_only_test_results_are_deleted(forge: Forge, workspace: Path) -> None:
    """Outside of marked folders, only results at the usual paths are deleted, and none in sources."""
    forge("test", "--test-result-base", "results", cwd=workspace)
    mine = ("docs/junit.xml", "src/p/pytest.xml", "src/p/test_results/p/x.xml", "src/p/test/data.xml")
    theirs = ("results/p/more.xml", "build/p/more.xml")
    root = write_files(workspace, {name: JUNIT.format("p") for name in (*mine, *theirs, "old/p/pytest.xml")})
    for base in ("docs", "src", "src/p", "results", "build", "old", "."):
        ran = forge("test-result", "--delete-yes", "--test-result-base", base, cwd=root)
        assert ran.code == 0
        assert [name for name in mine if not (root / name).is_file()] == []
        assert ("kept" in ran.err) == (base in {"docs", "src", "src/p", "."})
    left = {str(path.relative_to(root)) for path in root.rglob("*.xml")} - {*mine}
    assert not [name for name in left if name.startswith(("results", "old")) or "pytest" in name]
    assert not (root / "build/p/more.xml").exists()
