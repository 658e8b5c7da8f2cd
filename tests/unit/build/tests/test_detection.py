"""Tests of a package are detected without running code."""

import pytest

from forge.build.tests.recipes import has_ctests, requirements_of_tests
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
def test_metadata_that_requires_pytest_is_recognized(tree: Tree, name: str, text: str) -> None:
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
def test_packages_without_a_test_declaration_do_not_use_pytest(tree: Tree, name: str, text: str) -> None:
    assert requirements_of_tests(tree({name: text})) == frozenset()


def test_ctest_runs_if_a_test_is_added_or_a_file_included(tree: Tree) -> None:
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
