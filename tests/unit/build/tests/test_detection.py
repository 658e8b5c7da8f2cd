"""The tests of a package, found without running them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from forge.build.tests.detection import has_ctests, inspect_tests, requirements_of_tests
from tests.packages import package

if TYPE_CHECKING:
    from tests.conftest import Tree


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("setup.py", "from setuptools import setup\nsetup(tests_require=['pytest'])"),
        ("setup.py", "import setuptools\nsetuptools.setup(tests_require='pytest>=3; python_version>\"3\"')"),
        ("setup.py", "setup(name=f(), extras_require={'test': ['pytest[x]', 3], 'other': ['no']})"),
        ("setup.cfg", "[options]\ntests_require =\n  a\n  PyTest ~= 7\n"),
        ("setup.cfg", "[options.extras_require]\ntesting = pytest; extra == 'x'\n"),
        ("pyproject.toml", "[project.optional-dependencies]\ntests = ['pytest-cov', 'pytest']\n"),
        ("pyproject.toml", "[dependency-groups]\ntest = ['pytest', {include-group = 'x'}]\n"),
    ],
)
def test_metadata_asks_for_pytest(tree: Tree, name: str, text: str) -> None:
    assert "pytest" in requirements_of_tests(tree({name: text}))


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("setup.py", "setup(tests_require=needs)"),
        ("setup.py", "setup(extras_require={'dev': ['pytest']})"),
        ("setup.py", "setup("),
        ("setup.cfg", "tests_require = pytest"),
        ("pyproject.toml", "[project"),
        ("README", "pytest"),
    ],
)
def test_nothing_is_asked_for(tree: Tree, name: str, text: str) -> None:
    assert requirements_of_tests(tree({name: text})) == frozenset()


def test_names_are_normalised(tree: Tree) -> None:
    assert requirements_of_tests(tree({"setup.py": "setup(tests_require=['Pytest_Cov>=1'])"})) == {
        "pytest-cov"
    }


def test_ctest_has_something_to_do_where_a_test_is_added_or_a_file_included(tree: Tree) -> None:
    root = tree(
        {
            "none/CTestTestfile.cmake": '# nothing\nsubdirs("a")\n',
            "deep/CTestTestfile.cmake": "subdirs(a)\n",
            "deep/a/CTestTestfile.cmake": 'subdirs("b c")\n',
            "deep/a/b c/CTestTestfile.cmake": 'add_test(x "true")\n',
            "found/CTestTestfile.cmake": 'include("/x/tests_include.cmake")\n',
        }
    )
    assert [has_ctests(root / name) for name in ("none", "deep", "found", "missing")] == [
        False,
        True,
        True,
        False,
    ]


@pytest.mark.parametrize(
    ("cache", "configuration"),
    [
        ("CMAKE_BUILD_TYPE:STRING=Debug\n", "Debug"),
        ("CMAKE_BUILD_TYPE:UNINITIALIZED=RelWithDebInfo", "RelWithDebInfo"),
        ("CMAKE_BUILD_TYPE:STRING=\n", "Release"),
        ("", "Release"),
    ],
)
def test_ctest_is_asked_for_the_configuration_that_was_built(
    tree: Tree, cache: str, configuration: str
) -> None:
    root = tree({"CMakeCache.txt": cache, "CTestTestfile.cmake": "add_test(x true)"})
    assert inspect_tests(package("p", build_type="cmake"), root, root).configuration == configuration
    assert inspect_tests(package("p", build_type="cmake"), root, root / "none").configuration == ""
