"""Files that are saved while a build runs."""

import shutil

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text

pytestmark = pytest.mark.needs("cmake")

_FIRST = """cmake_minimum_required(VERSION 3.18)
project(first NONE)
if(EXISTS "${CMAKE_CURRENT_SOURCE_DIR}/../../save")
  file(WRITE "${CMAKE_CURRENT_SOURCE_DIR}/../second/text.txt" "new")
endif()
"""
_SECOND = """cmake_minimum_required(VERSION 3.18)
project(second NONE)
install(FILES text.txt DESTINATION share/second)
"""


def test_sources_saved_during_the_build_are_not_cached(forge: Forge, tree: Tree) -> None:
    root = tree(
        {
            "src/first/package.xml": manifest_text("first", build_type="cmake"),
            "src/first/CMakeLists.txt": _FIRST,
            "src/second/package.xml": manifest_text("second", "<depend>first</depend>", build_type="cmake"),
            "src/second/CMakeLists.txt": _SECOND,
            "src/second/text.txt": "old",
            "save": "",
        }
    )
    build = ("build", "--cache", str(root / "cache"))
    installed = root / "install/second/share/second/text.txt"
    assert forge(*build, cwd=root).code == 0
    assert installed.read_text(encoding="utf-8") == "new"
    (root / "save").unlink()
    (root / "src/second/text.txt").write_text("old", encoding="utf-8")
    for folder in ("build", "install"):
        shutil.rmtree(root / folder)
    assert forge(*build, cwd=root).code == 0
    assert installed.read_text(encoding="utf-8") == "old"
