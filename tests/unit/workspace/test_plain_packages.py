"""Packages without a package.xml: metadata from CMake and Python files, and what names a package first."""

from pathlib import Path

import pytest

from forge.workspace.cmake_text import cmake_dependencies, project_name
from forge.workspace.discovery import discover
from forge.workspace.model import DependencyKind, Package, Workspace
from forge.workspace.overrides import Overrides
from forge.workspace.python_metadata import read_pyproject, read_setup_cfg, read_setup_py
from tests.conftest import Forge, Tree
from tests.packages import manifest_text

CMAKE = "cmake_minimum_required(VERSION 3.10)\nproject({} NONE)\n"
SETUP = "from setuptools import setup\nsetup({})\n"


def walked(root: Path, **overrides: dict[str, dict[str, str]]) -> Workspace:
    return discover(
        root, ["."], {}, overrides=Overrides(overrides.get("by_name", {}), overrides.get("by_path", {}))
    )


def only(root: Path) -> Package:
    (package,) = walked(root).packages.values()
    return package


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("project(a)", "a"),
        ('PROJECT ( "a-b_1" VERSION 1 LANGUAGES C )', "a-b_1"),
        ("# project(no)\nproject(yes)", "yes"),
        ('message("# no comment") project(a)', "a"),
        ("project(${NAME})", ""),
        ("project(\n  a\n)", "a"),
        ("", None),
    ],
)
def test_the_first_literal_project_name_is_used(text: str, name: str | None) -> None:
    assert project_name(text) == name


def test_only_literal_find_package_names_are_dependencies() -> None:
    text = (
        'find_package(a REQUIRED)\nfind_package(${b})\n# find_package(c)\nFind_Package( "d" )\n'
        "pkg_check_modules(P REQUIRED QUIET e>=1 f)\npkg_search_module(Q g=2)\n"
    )
    assert cmake_dependencies([text]) == {"a", "d", "e", "f", "g"}


def test_variables_in_setup_py_are_resolved() -> None:
    facts = read_setup_py(
        "import os\nname: str = 'x'\nversion = os.environ['V']\n"
        "setuptools.setup(name=name, version=version, "
        "install_requires=['a>=1', 'b[extra]; python_version>\"3\"', f()],\n"
        "  tests_require='c', setup_requires=('d',), extras_require={'test': ['e'], 'docs': ['f']},\n"
        "  maintainer='M, N', maintainer_email='m@x.co, n@x.co', **more)\n"
    )
    assert facts is not None
    assert (facts.name, facts.version) == ("x", "")
    assert [(d.name, *d.kinds) for d in facts.dependencies] == [
        ("d", DependencyKind.BUILD),
        ("a", DependencyKind.EXEC),
        ("b", DependencyKind.EXEC),
        ("c", DependencyKind.TEST),
        ("e", DependencyKind.TEST),
    ]
    assert [person.email for person in facts.maintainers] == ["m@x.co", "n@x.co"]
    assert read_setup_py("print('no setup')") is None


def test_setup_cfg_is_read_without_running_code() -> None:
    facts = read_setup_cfg(
        "[metadata]\nname = x\nversion = attr: x.VERSION\nauthor = A\nauthor-email = a@x.co\n"
        "[options]\ninstall_requires = a>=1; b\n[options.extras_require]\ntest =\n  # why\n  c # note\n"
    )
    assert (facts.name, facts.version) == ("x", "")
    assert [d.name for d in facts.dependencies] == ["a", "b", "c"]
    assert facts.maintainers[0].name == "A"
    assert read_setup_cfg("no section").name is None


def test_pyproject_is_a_package_only_with_a_project() -> None:
    assert read_pyproject({"tool": {"ruff": {}}}) is None
    assert read_pyproject({"build-system": {"requires": []}}) is None
    poetry = read_pyproject({"tool": {"poetry": {"name": "x", "version": "1"}}})
    assert poetry is not None
    assert poetry.name == "x"
    facts = read_pyproject(
        {
            "project": {
                "name": "x",
                "version": "1",
                "dependencies": ["a"],
                "authors": [{"name": "A", "email": "a@x.co"}, {"name": "B"}],
                "optional-dependencies": {"tests": ["b"]},
            },
            "build-system": {"requires": ["c"]},
        }
    )
    assert facts is not None
    assert [d.name for d in facts.dependencies] == ["c", "a", "b"]
    assert [person.name for person in facts.maintainers] == ["A"]


@pytest.mark.parametrize(
    ("files", "name", "type_"),
    [
        ({"CMakeLists.txt": CMAKE.format("c")}, "c", "cmake"),
        ({"CMakeLists.txt": CMAKE.format("c"), "setup.py": SETUP.format("name='p'")}, "c", "cmake"),
        ({"CMakeLists.txt": CMAKE.format("c"), "pyproject.toml": "[project]\nname='p'"}, "c", "cmake"),
        ({"package.xml": manifest_text("m"), "CMakeLists.txt": CMAKE.format("c")}, "m", "ros.ament_cmake"),
        ({"CMakeLists.txt": CMAKE.format("c"), "colcon.pkg": "name: other"}, "other", "cmake"),
        ({"package.xml": manifest_text("m"), "colcon.pkg": "name: other"}, "other", "ros.ament_cmake"),
        ({"package.xml": manifest_text("m"), "colcon.pkg": "type: ros.cmake"}, "m", "ros.cmake"),
        (
            {
                "package.xml": manifest_text("m"),
                "CMakeLists.txt": CMAKE.format("c"),
                "colcon.pkg": "type: cmake",
            },
            "c",
            "cmake",
        ),
        (
            {"AMENT_IGNORE": "", "CMakeLists.txt": CMAKE.format("c"), "colcon.pkg": "type: cmake"},
            "c",
            "cmake",
        ),
    ],
)
def test_the_first_source_with_both_type_and_name_wins(
    tree: Tree, files: dict[str, str], name: str, type_: str
) -> None:
    package = only(tree({f"x/{file}": text for file, text in files.items()}))
    assert (package.name, package.type, package.path) == (name, type_, Path("x"))


@pytest.mark.parametrize(
    "files",
    [
        {"AMENT_IGNORE": "", "CMakeLists.txt": CMAKE.format("c")},
        {"manifest.xml": "", "CMakeLists.txt": CMAKE.format("c")},
        {"CMakeLists.txt": "project(Project)\ncatkin_workspace()\n"},
        {
            "CMakeLists.txt": CMAKE.format("c"),
            "setup.py": SETUP.format(""),
            "setup.cfg": "[metadata]\nname = q",
        },
        {"colcon.pkg": "type: cmake"},
        {"colcon.pkg": "name: x"},
        {"colcon.pkg": "type: ros.cmake"},
        {"package.xml": "<package/>", "CMakeLists.txt": CMAKE.format("c")},
    ],
)
def test_folders_that_are_not_packages_are_recognized(tree: Tree, files: dict[str, str]) -> None:
    assert not walked(tree({f"x/{file}": text for file, text in files.items()})).packages


def test_dependencies_are_read_from_all_cmake_files_of_the_package(tree: Tree) -> None:
    root = tree(
        {
            "x/CMakeLists.txt": CMAKE.format("x") + "find_package(a)\nfind_package(x)",
            "x/cmake/more.cmake": "find_package(b)",
            "x/sub/CMakeLists.txt": "find_package(c)",
            "x/.git/no.cmake": "find_package(d)",
            "x/venv/pyvenv.cfg": "",
            "x/venv/lib/no.cmake": "find_package(d)",
            "x/node_modules/y/no.cmake": "find_package(d)",
        }
    )
    assert only(root).manifest.names(frozenset({DependencyKind.BUILD})) == ("a", "b", "c")


def test_a_computed_project_name_is_replaced_by_the_folder_name(tree: Tree, forge: Forge) -> None:
    root = tree(
        {
            "two/CMakeLists.txt": "project(${X})",
            "three/CMakeLists.txt": "# no project at all",
        }
    )
    ran = forge("list", cwd=root)
    assert ran.out == "three\tthree\t(cmake)\ntwo\ttwo\t(cmake)\n"
    assert "two/CMakeLists.txt: warning: the project name is not a literal" in ran.err
    assert "three" not in ran.err


def test_meta_files_can_name_folders_and_conflicts_are_reported(tree: Tree) -> None:
    root = tree(
        {
            "x/CMakeLists.txt": CMAKE.format("c"),
            "y/CMakeLists.txt": CMAKE.format("d"),
            "x/colcon.pkg": "name: a",
        }
    )
    real = str((root / "x").resolve())
    workspace = walked(root, by_path={real: {"name": "b"}}, by_name={"a": {"type": "cmake"}})
    assert workspace.packages.keys() == {"a", "d"}
    assert [note.message for note in workspace.notes] == [
        "the name 'a' in colcon.pkg overrides 'b' in a *.meta file"
    ]
