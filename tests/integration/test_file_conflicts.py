"""Two packages of a merged tree that install one file."""

import shutil

import pytest

from tests.conftest import Forge, Ran, Tree
from tests.packages import manifest_text

pytestmark = pytest.mark.needs("cmake")

CMAKE = """cmake_minimum_required(VERSION 3.18)
project({name} NONE)
install(FILES package.xml DESTINATION share/{name})
install(FILES words DESTINATION share/common)
"""
READER = """cmake_minimum_required(VERSION 3.18)
project(reader NONE)
file(GLOB names RELATIVE ${CMAKE_INSTALL_PREFIX}/share/common ${CMAKE_INSTALL_PREFIX}/share/common/*)
file(READ ${CMAKE_INSTALL_PREFIX}/share/common/words words)
file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/read "${names}: ${words}")
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/read DESTINATION share/reader)
"""
"""It reads the file that other packages install, and lists its folder."""
TOLD = (
    ": 'a' and 'b' install 'share/common/words' with different contents\n"
    "hint: the last one wins; rename the file in one of them, or build without '--merge-install'\n"
)


def needs(*names: str) -> str:
    return "".join(f"<depend>{name}</depend>" for name in names)


def build(forge: Forge, tree: Tree, words: dict[str, str], *options: str) -> Ran:
    """Build a package for each of the words, which it installs."""
    files = {}
    for name, text in words.items():
        files[f"src/{name}/package.xml"] = manifest_text(name, build_type="cmake")
        files[f"src/{name}/CMakeLists.txt"] = CMAKE.format(name=name)
        files[f"src/{name}/words"] = text
    return forge("build", "--executor", "sequential", *options, cwd=tree(files))


def test_identical_files_of_two_packages_are_not_a_conflict(forge: Forge, tree: Tree) -> None:
    assert build(forge, tree, {"a": "same", "b": "same"}, "--merge-install", "--strict").code == 0


def test_isolated_prefixes_have_no_conflicts(forge: Forge, tree: Tree) -> None:
    assert build(forge, tree, {"a": "one", "b": "two"}, "--strict").code == 0


def test_different_contents_give_a_warning_that_names_both_packages(forge: Forge, tree: Tree) -> None:
    """Whichever of them was built last."""
    ran = build(forge, tree, {"a": "one", "b": "two"}, "--merge-install")
    assert (ran.code, ran.err) == (0, f"warning{TOLD}")
    ran = build(forge, tree, {"a": "one", "b": "two"}, "--merge-install", "--force", "--packages-select", "a")
    assert (ran.code, ran.err) == (0, f"warning{TOLD}")
    assert build(forge, tree, {"a": "two", "b": "two"}, "--merge-install").err == ""


def test_strict_mode_makes_a_conflict_an_error_every_time(forge: Forge, tree: Tree) -> None:
    """Until somebody mends it."""
    for _ in range(3):
        ran = build(forge, tree, {"a": "one", "b": "two"}, "--merge-install", "--strict")
        assert (ran.code, ran.err) == (2, f"error{TOLD}")


@pytest.mark.parametrize("end", ["true", "false"], ids=["well", "failing"])
def test_a_file_may_move_to_a_concurrently_built_package(forge: Forge, tree: Tree, end: str) -> None:
    """The package that had it ends last, and neither removes nor restores it."""
    assert build(forge, tree, {"a": "one"}, "--merge-install").code == 0
    had = CMAKE.format(name="a").replace("install(FILES words", "# install(FILES words")
    slow = f"add_custom_target(slow ALL COMMAND sleep 1 COMMAND {end})\n"
    has = {"src/b/package.xml": manifest_text("b", build_type="cmake"), "src/b/words": "two"}
    root = tree({"src/a/CMakeLists.txt": had + slow, "src/b/CMakeLists.txt": CMAKE.format(name="b"), **has})
    ran = forge("build", "--merge-install", "--continue-on-error", "--parallel-workers", "2", cwd=root)
    assert ran.code == (end == "false")
    assert (root / "install/share/common/words").read_text() == "two"


def test_the_last_package_wins_after_earlier_ones_were_installed_at_the_same_time(
    forge: Forge, tree: Tree
) -> None:
    """Even if it depends on one of these, which is the same as before when installed again."""
    files = {}
    for name, needs, seconds in (("a", "", "1"), ("b", "", "0.5"), ("c", "<depend>a</depend>", "0")):
        slow = f"add_custom_target(slow ALL COMMAND sleep {seconds})\n"
        files[f"src/{name}/package.xml"] = manifest_text(name, needs, build_type="cmake")
        files[f"src/{name}/CMakeLists.txt"] = CMAKE.format(name=name) + slow
        files[f"src/{name}/words"] = name
    root = tree(files)
    assert forge("build", "--merge-install", "--parallel-workers", "2", cwd=root).code == 0
    assert (root / "install/share/common/words").read_text() == "c"


def test_after_the_winner_was_removed_the_next_package_installs_its_file_again(
    forge: Forge, tree: Tree
) -> None:
    files = {"a": "one", "b": "two", "c": "three"}
    build(forge, tree, files, "--merge-install")
    root = tree({})
    shutil.rmtree(root / "src/c")
    assert forge("clean", "stale", "--yes", cwd=root).code == 0
    assert forge("build", "--merge-install", cwd=root).code == 0
    assert (root / "install/share/common/words").read_text() == "two"


@pytest.mark.needs("gcc")
def test_a_package_that_read_the_file_of_another_owner_is_built_again(forge: Forge, tree: Tree) -> None:
    """The last owner was installed first, and its file is put in place after all packages were built."""
    files = {
        "src/reader/package.xml": manifest_text("reader", needs("a", "b"), build_type="cmake"),
        "src/reader/CMakeLists.txt": READER,
    }
    for name, seconds in (("a", "1"), ("b", "0")):
        slow = f"add_custom_target(slow ALL COMMAND sleep {seconds})\n"
        files[f"src/{name}/package.xml"] = manifest_text(name, build_type="cmake")
        files[f"src/{name}/CMakeLists.txt"] = CMAKE.format(name=name) + slow
        files[f"src/{name}/words"] = name
    root = tree(files)
    assert forge("build", "--merge-install", "--parallel-workers", "2", cwd=root).code == 0
    assert (root / "install/share/reader/read").read_text() == "words: b"
    ran = forge("build", "--merge-install", cwd=root)
    assert "0 packages finished, 3 packages unchanged" in ran.out + ran.err
