"""Packages with other build backends than setuptools, with real backends."""

import shutil

import pytest

from tests.conftest import Tree
from tests.wheels import SETUP, SITE, files, hello, install

pytestmark = pytest.mark.usefixtures("own_environment")

PROJECT = {
    "src/talk/pyproject.toml": """[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"
[project]
name = "talk"
version = "0.1.0"
[project.scripts]
hello = "talk.hello:main"
""",
    "src/talk/talk/__init__.py": "",
    "src/talk/talk/hello.py": "def main():\n    print('hello from hatch')\n",
}


def test_intermediate_files_of_a_backend_that_wraps_setuptools_are_not_in_the_sources(tree: Tree) -> None:
    backend = "[build-system]\nrequires = []\nbuild-backend = 'own'\nbackend-path = ['own']\n"
    options = {"build": "build_lib", "build_py": "build_lib", "bdist_wheel": "keep_temp = 1\nbdist_dir"}
    package = {
        **SETUP,
        "src/talk/pyproject.toml": backend,
        "src/talk/own/own.py": "from setuptools.build_meta import *\n",
        "src/talk/setup.cfg": "".join(f"[{command}]\n{name} = made\n" for command, name in options.items()),
    }
    root = tree(package)
    before = files(root / "src")
    assert install(root) == 0
    assert f"{SITE}/talk/old.py" in files(root / "install")
    assert {name for name in files(root / "src") if "__pycache__" not in name} == before
    (root / "src/talk/talk/old.py").unlink()
    shutil.rmtree(root / "install")
    assert install(root) == 0
    assert f"{SITE}/talk/old.py" not in files(root / "install")


def test_files_of_unknown_origin_are_linked_only_to_a_unique_source(tree: Tree) -> None:
    project = PROJECT["src/talk/pyproject.toml"]
    shared = """
[tool.hatch.build.targets.wheel.shared-data]
"cfg/one/c.yaml" = "share/talk/x/c.yaml"
"cfg/two/c.yaml" = "share/talk/y/c.yaml"
"cfg/two/d.yaml" = "share/talk/y/d.yaml"
"""
    alike = {f"src/talk/cfg/{name}.yaml": "same" for name in ("one/c", "two/c", "two/d")}
    root = tree(
        {**PROJECT, "src/talk/pyproject.toml": project + shared, **alike, "src/talk/other/__init__.py": ""}
    )
    assert install(root, "--link") == 0
    share, sources = root / "install/share/talk", root / "src/talk"
    assert [(share / name).is_symlink() for name in ("x/c.yaml", "y/c.yaml")] == [False, False]
    assert (share / "y/d.yaml").readlink() == sources / "cfg/two/d.yaml"
    assert (root / "install" / SITE / "talk/__init__.py").readlink() == sources / "talk/__init__.py"


def test_a_pyproject_with_its_own_backend_is_installed(tree: Tree) -> None:
    root = tree(PROJECT)
    assert install(root) == 0
    assert hello(root) == "hello from hatch\n"


def test_a_missing_build_backend_is_reported(tree: Tree, capsys: pytest.CaptureFixture[str]) -> None:
    root = tree({"src/talk/pyproject.toml": '[build-system]\nbuild-backend = "no_such.backend"\n'})
    assert install(root) == 2
    assert "the build backend 'no_such.backend' is not installed" in capsys.readouterr().err


def test_an_invalid_entry_point_of_another_backend_gives_one_error(
    tree: Tree, capfd: pytest.CaptureFixture[str]
) -> None:
    """With its line in pyproject.toml, or only the file if the line is computed."""
    project = PROJECT["src/talk/pyproject.toml"].replace("hello:main", "hello")
    root = tree(PROJECT | {"src/talk/pyproject.toml": project})
    assert install(root) == 0
    assert capfd.readouterr().err == (
        f"{root}/src/talk/pyproject.toml:8: warning: the entry point 'hello = talk.hello' lacks ':FUNCTION'\n"
        '    hello = "talk.hello"\n'
        "hint: write 'hello = talk.hello:main'\n"
    )


def test_packages_named_build_and_dist_are_linked(tree: Tree) -> None:
    """Even next to a copy that somebody built in the sources by hand."""
    every = {f"talk/{name}/__init__.py": f"# {name}\n" for name in ("build", "dist")}
    more = {f"src/talk/{name}": text for name, text in every.items()}
    more |= {f"src/talk/build/lib/{name}": text for name, text in every.items()}
    ignored = '\n[tool.hatch.build.targets.wheel]\npackages = ["talk"]\nignore-vcs = true\n'
    root = tree(PROJECT | {"src/talk/pyproject.toml": PROJECT["src/talk/pyproject.toml"] + ignored} | more)
    assert install(root, "--link") == 0
    for name in every:
        assert (root / "install" / SITE / name).readlink() == root / "src/talk" / name


def test_scripts_outside_the_prefix_are_rejected(tree: Tree, capfd: pytest.CaptureFixture[str]) -> None:
    root = tree(PROJECT | {"src/talk/setup.cfg": "[install]\ninstall_scripts=$base/../away\n"})
    assert install(root) == 2
    assert "outside the prefix" in capfd.readouterr().err
    assert not list(root.rglob("away"))
