"""Packages for which the results of the compiler probe may be used, and packages for which not."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from forge.toolchain.compiler_probe import usual_project

if TYPE_CHECKING:
    from pathlib import Path

    from tests.conftest import Tree


@pytest.mark.parametrize(
    "text",
    [
        "project(x)",
        "# a remark (\ncmake_minimum_required(VERSION 3.18)\n#[[ a\nlong ]]project(x C)\nset(CMAKE_X y)",
        "cmake_minimum_required(VERSION 3.18)\nset(version 1)\nPROJECT(x LANGUAGES CXX)",
    ],
)
def test_usual_packages(tree: Tree, text: str) -> None:
    assert usual_project(tree({"CMakeLists.txt": text}))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "set(CMAKE_CXX_COMPILER clang++)\nproject(x)",
        "set(CMAKE_TOOLCHAIN_FILE y)\nproject(x)",
        "include(toolchain.cmake)\nproject(x)",
        "set(x ${y})\nproject(x)",
        "if(X)\nproject(x)\nendif()",
        "project(${name})",
        "set(ENV{CXX} clang++)\nproject(x)",
        "set(x y CACHE STRING [[)]])\nproject(x)",
    ],
)
def test_packages_that_may_want_something_else(tree: Tree, text: str) -> None:
    assert not usual_project(tree({"CMakeLists.txt": text}))


def test_a_folder_without_lists(tmp_path: Path) -> None:
    assert not usual_project(tmp_path)
