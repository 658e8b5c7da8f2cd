"""`forge add`: dependencies are written where a person would write them, and nothing else changes."""

from pathlib import Path

import pytest

from forge.plugins.fetch.add import with_dependencies
from tests.conftest import Forge, Tree
from tests.packages import manifest_text

MANIFEST = manifest_text(
    "hello", "<!-- <depend>old</depend> -->", "<depend>rclcpp</depend>", "<test_depend>t</test_depend>"
)
CMAKE = """\
cmake_minimum_required(VERSION 3.22)
project(hello)
find_package(ament_cmake REQUIRED)
find_package(rclcpp  # (for nodes)
  REQUIRED)
ament_package()
"""


def test_new_dependencies_follow_those_of_their_kind(forge: Forge, tree: Tree) -> None:
    root = tree({"src/hello/package.xml": MANIFEST, "src/hello/CMakeLists.txt": CMAKE})
    ran = forge("add", "std_msgs", "rclcpp", cwd=root)
    assert (ran.code, ran.err) == (0, "")
    expected = MANIFEST.replace(
        "<depend>rclcpp</depend>\n", "<depend>rclcpp</depend>\n  <depend>std_msgs</depend>\n"
    )
    assert (root / "src/hello/package.xml").read_text() == expected
    assert "added std_msgs to" in ran.out
    assert "package.xml already has rclcpp" in ran.out
    assert "find_package(std_msgs REQUIRED)" in ran.out
    assert (root / "src/hello/CMakeLists.txt").read_text() == CMAKE


def test_find_package_is_added_after_the_last_one(forge: Forge, tree: Tree) -> None:
    root = tree({"src/hello/package.xml": MANIFEST, "src/hello/CMakeLists.txt": CMAKE})
    assert forge("add", "std_msgs", "--cmake", cwd=root).code == 0
    expected = CMAKE.replace("  REQUIRED)\n", "  REQUIRED)\nfind_package(std_msgs REQUIRED)\n")
    assert (root / "src/hello/CMakeLists.txt").read_text() == expected


def test_the_package_is_chosen_by_the_current_folder(forge: Forge, tree: Tree) -> None:
    other = MANIFEST.replace("hello", "other")
    root = tree({"src/hello/package.xml": MANIFEST, "src/other/package.xml": other})
    ran = forge("add", "std_msgs", cwd=root)
    assert ran.code == 2
    assert "there are 2 packages\nhint: name one with '--package'" in ran.err
    assert forge("add", "std_msgs", "--test", cwd=root / "src/other").code == 0
    assert "<test_depend>std_msgs</test_depend>" in (root / "src/other/package.xml").read_text()
    assert forge("add", "std_msgs", "--exec", "--package", "hello", cwd=root).code == 0
    assert "<exec_depend>std_msgs</exec_depend>" in (root / "src/hello/package.xml").read_text()


@pytest.mark.parametrize(
    ("manifest", "tag", "expected"),
    [
        ("<package>\n\t<run_depend>a</run_depend>\n</package>", "depend",
         "<package>\n\t<run_depend>a</run_depend>\n\t<build_depend>x</build_depend>\n\t<run_depend>x</run_depend>\n</package>"),
        ('<package format="3">\r\n  <depend>a</depend>\r\n</package>', "depend",
         '<package format="3">\r\n  <depend>a</depend>\r\n  <depend>x</depend>\r\n</package>'),
        ('<package format="3">\n  <export/>\n</package>\n', "test_depend",
         '<package format="3">\n  <test_depend>x</test_depend>\n  <export/>\n</package>\n'),
        ('<package format="3">\n  <depend>x</depend>\n</package>', "test_depend", None),
        ('<package format="3"><depend condition="$A == 1">x</depend>\n</package>', "depend",
         '<package format="3"><depend condition="$A == 1">x</depend>\n  <depend>x</depend>\n</package>'),
    ],
)  # fmt: skip
def test_text_around_the_element_is_kept(manifest: str, tag: str, expected: str | None) -> None:
    text, added = with_dependencies(manifest.encode(), Path("package.xml"), ["x"], tag)
    assert text == (expected or manifest)
    assert added == (("x",) if expected else ())
