"""Packages with only a setup.py or pyproject.toml."""

import json
from pathlib import Path

import pytest

from forge.workspace.discovery import discover
from forge.workspace.identification import identify
from forge.workspace.model import Workspace
from forge.workspace.overrides import Overrides
from tests.conftest import Forge, Tree

CMAKE = "cmake_minimum_required(VERSION 3.10)\nproject({} NONE)\n"
SETUP = "from setuptools import setup\nsetup({})\n"


def walked(root: Path) -> Workspace:
    return discover(root, ["."], {}, overrides=Overrides({}, {}))


@pytest.mark.parametrize(
    ("files", "name"),
    [
        ({"setup.py": SETUP.format("name='p'")}, "p"),
        ({"setup.py": SETUP.format(""), "setup.cfg": "[metadata]\nname = q"}, "q"),
        ({"setup.py": SETUP.format(""), "pyproject.toml": "[project]\nname='r'"}, "r"),
        ({"pyproject.toml": "[project]\nname='p'"}, "p"),
        ({"pyproject.toml": "[build-system]\nrequires=[]", "setup.cfg": "[metadata]\nname=s"}, "s"),
        (
            {
                "CMakeLists.txt": CMAKE.format("c"),
                "setup.py": SETUP.format("name='p'"),
                "colcon.pkg": "type: python",
            },
            "p",
        ),
    ],
)
def test_the_first_file_with_a_name_wins(tree: Tree, files: dict[str, str], name: str) -> None:
    (package,) = walked(tree({f"x/{file}": text for file, text in files.items()})).packages.values()
    assert (package.name, package.type, package.path) == (name, "python", Path("x"))


@pytest.mark.parametrize(
    "files",
    [
        {"setup.py": "print()"},
        {"pyproject.toml": "[tool.x]"},
        {"setup.py": "("},
        {"setup.py": SETUP.format("name='p'"), "colcon.pkg": "name: other"},
        {"pyproject.toml": "["},
    ],
)
def test_folders_that_are_not_packages_are_recognized(tree: Tree, files: dict[str, str]) -> None:
    assert not walked(tree({f"x/{file}": text for file, text in files.items()})).packages


def test_a_computed_project_name_is_replaced_by_the_folder_name(tree: Tree, forge: Forge) -> None:
    ran = forge("list", cwd=tree({"one/setup.py": SETUP.format("name=compute()")}))
    assert ran.out == "one\tone\t(python)\n"
    assert "one/setup.py: warning: the project name is not a literal" in ran.err


@pytest.mark.parametrize(
    "name",
    ["../x", "/x", "a/b", "..", ".", ".git", "-rf", "a b", "a\nb", "$(x)", "a'b", 'a"b', "x" * 300],
)
@pytest.mark.parametrize("where", ["setup.py", "pyproject.toml", "setup.cfg"])
def test_invalid_package_names_are_rejected(name: str, where: str, tmp_path: Path) -> None:
    texts = {
        "setup.py": f"from setuptools import setup\nsetup(name={name!r})\n",
        "pyproject.toml": f"[project]\nname = {json.dumps(name)}\n",
        "setup.cfg": "[metadata]\nname = " + name.replace("\n", "\n ") + "\n",
    }
    (tmp_path / where).write_text(texts[where])
    if where == "setup.cfg":
        (tmp_path / "pyproject.toml").write_text("")
    names = [path.name for path in tmp_path.iterdir()]
    found = identify(tmp_path, Path(), names, {}, Overrides())
    assert found.package is None
    assert "invalid package name" in found.problems[0].message


def test_a_broken_pyproject_is_reported_with_its_path(tree: Tree) -> None:
    workspace = walked(tree({"x/pyproject.toml": "["}))
    (problem,) = workspace.problems
    assert str(problem.location) == "x/pyproject.toml"
