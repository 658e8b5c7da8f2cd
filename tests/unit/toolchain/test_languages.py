"""Which CMake files enable C++."""

from __future__ import annotations

from dataclasses import replace

import pytest

from forge.toolchain.programs import any_enables_cxx, enables_cxx
from tests.conftest import Tree
from tests.packages import package


@pytest.mark.parametrize(
    "text",
    [
        "project(x)",
        "project(x VERSION 1.2)",
        'PROJECT(x VERSION 1 DESCRIPTION "A C library" HOMEPAGE_URL https://x.org)',
        "project(x C CXX)",
        "project(x LANGUAGES\n  CXX)",
        "project(x LANGUAGES C CUDA)",
        "project(x ${languages})",
        "project(x C)\nenable_language(CXX OPTIONAL)",
    ],
)
def test_projects_that_enable_cxx_are_recognized(text: str) -> None:
    assert enables_cxx(text)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "project(x C)",
        'project(x DESCRIPTION "of (two)" LANGUAGES C)',
        "project(x NONE)",
        "project(x C)  # project(y)",
        'project(x VERSION 1 DESCRIPTION "With CXX" LANGUAGES C ASM)\nenable_language(Fortran OPTIONAL)',
    ],
)
def test_projects_without_cxx_are_recognized(text: str) -> None:
    assert not enables_cxx(text)


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        ({"CMakeLists.txt": "project(x C)", "sub/CMakeLists.txt": "add_library(y y.c)"}, False),
        ({"CMakeLists.txt": "project(x C)", "sub/CMakeLists.txt": "project(y CXX)"}, True),
        ({"CMakeLists.txt": "project(x C)", "cmake/more.cmake": "enable_language(CXX)"}, True),
        ({"CMakeLists.txt": "add_library(y y.c)"}, True),
        ({"CMakeLists.txt": "project(x NONE)"}, False),
        ({}, False),
    ],
)
def test_languages_are_searched_in_all_cmake_files_of_a_package(
    tree: Tree, files: dict[str, str], expected: bool
) -> None:
    found = replace(package("x", build_type="cmake"), path=tree(files))
    assert any_enables_cxx([found]) == expected
