"""Detected compilers are used only by packages that cannot choose others."""

import pytest

from forge.plugins.compiler_probe.probe import usual_project
from tests.conftest import Tree


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("cmake_minimum_required(VERSION 3.18)\nproject(x CXX)\ninclude(y)", ("x", "CXX")),
        ("set(own 1)\nPROJECT(x)", ("x",)),
        ("#[[\ninclude(y)\n]]\nproject(x # a comment\n  LANGUAGES NONE)", ("x", "LANGUAGES", "NONE")),
        ("include(y)\nproject(x)", None),
        ("set(CMAKE_CXX_COMPILER x)\nproject(x)", None),
        ("set(ENV{CXX} x)\nproject(x)", None),
        ("set(own ${other})\nproject(x)", None),
        ("if(x)\nproject(x)\nendif()", None),
        ("project(${name})", None),
        ("# $(MAKE) selects another generator\nproject(x)", None),
        ("", None),
    ],
)
def test_only_plain_commands_may_precede_project(
    text: str, words: tuple[str, ...] | None, tree: Tree
) -> None:
    assert usual_project(tree({"CMakeLists.txt": text})) == words
