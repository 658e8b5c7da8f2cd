"""What the build of a Python package read outside of the package is as good a reason as its own files.

Each case is built, changed and built again; what is installed then is what a clean build installs.
"""

import shutil
import subprocess
import venv
from collections.abc import Mapping
from pathlib import Path

import pytest
import setuptools

from tests.conftest import Forge, Tree, Variables
from tests.evolving import differences, look
from tests.packages import manifest_text

pytestmark = pytest.mark.slow

SETUP = """import glob, os, subprocess, sys
from setuptools import Extension, setup
here = os.path.dirname(os.path.abspath(__file__))
version = "1"
data = [("share/talk", ["package.xml"])]
more = {{}}
{lines}
setup(name="talk", version=version, packages=["talk"], data_files=data, **more)
"""
EXTENSION = """#include <Python.h>
#include "size.h"
static struct PyModuleDef talk = {PyModuleDef_HEAD_INIT, "talk.fast", 0, SIZE, 0};
PyMODINIT_FUNC PyInit_fast(void) { return PyModule_Create(&talk); }
"""


def package(*lines: str, **files: str) -> dict[str, str]:
    """Return a package whose setup.py has some lines more."""
    return {
        "src/talk/package.xml": manifest_text("talk", build_type="ament_python"),
        "src/talk/setup.py": SETUP.format(lines="\n".join(lines)),
        "src/talk/talk/__init__.py": "",
        **files,
    }


class Workspace:
    """A workspace that is built again and again, with the same options and variables."""

    def __init__(
        self, root: Path, forge: Forge, *options: str, env: Variables | None = None, first: bool = True
    ) -> None:
        """Build it, for the first time if so, and see that there is nothing more to do."""
        self.root = root
        self._forge = forge
        self._options = options
        self._env = env
        if first:
            assert self.build() == "not built yet"
        assert self.build() == ""

    def build(self) -> str:
        """Build, and return why the package was built, or '' for a fresh one."""
        ran = self._forge("build", "--explain", *self._options, cwd=self.root, env=self._env)
        assert ran.code == 0, ran.err
        said = (
            line.removeprefix("talk: build, ") for line in ran.out.splitlines() if line.startswith("talk: ")
        )
        return next(said, "")

    def is_as_clean(self) -> None:
        """Hold what is installed against what a clean build installs."""
        actual = look(self.root / "install")
        for name in ("build", "install", "log"):
            shutil.rmtree(self.root / name)
        self.build()
        assert differences(actual, look(self.root / "install")) == []

    def change(self, files: Mapping[str, str | None]) -> str:
        """Write or remove files and build, which leaves nothing to do; return why it was built."""
        for name, text in files.items():
            path = self.root / name
            if text is None:
                path.unlink()
            else:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text, encoding="utf-8")
        why = self.build()
        assert self.build() == ""
        return why


READERS = {
    "opened": 'version = open("../../VERSION").read().strip()',
    "in_another_folder": 'os.chdir("../.."); version = open("VERSION").read().strip(); os.chdir(here)',
    "imported": 'sys.path.insert(0, "../../shared"); from version import version',
    "copied": 'data.append(("share/talk", ["../../VERSION"]))',
    "by_a_program": 'version = subprocess.check_output(["cat", "../../VERSION"], text=True).strip()',
    "by_python": 'version = subprocess.check_output([sys.executable, "ask.py"], text=True).strip()',
    "by_a_fork": (
        "if not os.fork():\n"
        '    open("talk/v.txt", "w").write(open("../../VERSION").read()); os._exit(0)\n'
        "os.wait()\n"
        "version = open('talk/v.txt').read().strip(); os.remove('talk/v.txt')"
    ),
}
"""Lines of setup.py by the name of a package."""


def test_external_files_read_by_setup_py_are_inputs(tree: Tree, built: Tree, forge: Forge) -> None:
    def version(number: str) -> dict[str, str]:
        return {"VERSION": f"{number}\n", "shared/version.py": f"version = '{number}'\n"}

    files = version("1.0")
    for name, reader in READERS.items():
        ask = {"src/talk/ask.py": "print(open('../../VERSION').read())"}
        for path, text in package(reader, **ask).items():
            for word in ("<name>{}<", 'name="{}"', "share/{}"):
                text = text.replace(word.format("talk"), word.format(name))
            files[path.replace("src/talk/", f"src/{name}/")] = text
    root = built(files)
    assert f"{len(READERS)} packages unchanged" in forge("build", cwd=root).out
    tree(version("2.0"))
    ran = forge("build", "--explain", cwd=root)
    for name in READERS:
        assert f"{name}: build, 'VERSION' " in ran.out or f"{name}: build, 'shared/version." in ran.out
    actual = look(root / "install")
    for name in ("build", "install"):
        shutil.rmtree(root / name)
    assert forge("build", cwd=root).code == 0
    assert differences(actual, look(root / "install")) == []


def test_missing_files_and_modules_and_globs_are_inputs(tree: Tree, forge: Forge) -> None:
    readers = (
        "try:\n    exec(open('../../local.py').read())\nexcept FileNotFoundError: pass",
        "try:\n    from helper import version\nexcept ImportError: pass",
        'data.append(("share/talk/shared", sorted(glob.glob("../../shared/*.yaml"))))',
    )
    root = tree(package(*readers, **{"lib/other.py": "", "shared/a.yaml": "1"}))
    workspace = Workspace(root, forge, env={"PYTHONPATH": str(root / "lib")})
    assert workspace.change({"local.py": "version = '7'"})
    assert workspace.change({"shared/b.yaml": "2"})
    assert workspace.change({"shared/a.yaml": "3"})
    assert workspace.change(distribution("1.1"))
    workspace.is_as_clean()
    assert workspace.change({"local.py": None})
    assert workspace.change({"shared/a.yaml": None})
    shutil.rmtree(root / "lib")
    assert workspace.change({"lib/other.py": ""})
    workspace.is_as_clean()


def test_an_external_version_file_in_pyproject_is_an_input(tree: Tree, forge: Forge) -> None:
    pyproject = """[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"
[project]
name = "talk"
dynamic = ["version"]
[tool.hatch.version]
path = "../../shared/version.py"
"""
    files = package(**{"src/talk/pyproject.toml": pyproject, "shared/version.py": "__version__ = '1.0'\n"})
    del files["src/talk/setup.py"]
    workspace = Workspace(tree(files), forge)
    assert workspace.change({"shared/version.py": "__version__ = '2.0'\n"})
    workspace.is_as_clean()


def test_the_users_setuptools_configuration_is_an_input(
    tree: Tree, forge: Forge, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is followed as by colcon, and a change of it is noticed."""
    root = tree(package() | {"src/talk/tool": "#!/usr/bin/python\n"})
    setup = root / "src/talk/setup.py"
    setup.write_text(setup.read_text().replace("setup(", "setup(scripts=['tool'], ", 1))
    one, two = root / "home/.pydistutils.cfg", root / "other.cfg"
    one.parent.mkdir()
    monkeypatch.setenv("HOME", str(one.parent))

    def first_line() -> str:
        assert forge("build", cwd=root).code == 0
        (tool,) = root.glob("install/talk/bin/tool")
        return tool.read_text().partition("\n")[0]

    for python in ("/bin/one", "/bin/two"):
        one.write_text(f"[build_scripts]\nexecutable = {python}\n")
        assert first_line() == f"#!{python}"
    two.write_text("[build_scripts]\nexecutable = /bin/three\n")
    monkeypatch.setenv("DIST_EXTRA_CONFIG", str(two))
    assert first_line() == "#!/bin/three"


def test_a_shorter_sources_manifest_causes_a_rebuild(tree: Tree, forge: Forge) -> None:
    """Setuptools would keep what its earlier list of sources named."""
    more = "more = {'include_package_data': True}"
    data = {"src/talk/talk/a.txt": "1", "src/talk/talk/b.txt": "2"}
    workspace = Workspace(
        tree(package(more, **data, **{"src/talk/MANIFEST.in": "recursive-include talk *"})), forge
    )
    assert workspace.change({"src/talk/MANIFEST.in": "include talk/a.txt"})
    assert not list(workspace.root.glob("install/**/b.txt"))
    workspace.is_as_clean()


ASKS = """version = subprocess.check_output(
    [sys.executable, "-c", "import helper; print(helper.version)"], text=True).strip()
"""
"""A line of setup.py."""


def distribution(version: str, *modules: str) -> dict[str, str]:
    """Return an installed distribution as files below lib/."""
    record = "".join(f"helper/{name}.py,sha256={version},9\n" for name in ("__init__", *modules))
    info = f"lib/helper-{version}.dist-info"
    return {
        "lib/helper/__init__.py": f"version = {version!r}\n"
        + "".join(f"from . import {m}\n" for m in modules),
        **{f"lib/helper/{name}.py": f"version = {version!r}\n" for name in modules},
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: helper\nVersion: {version}\n",
        f"{info}/RECORD": f"{record}helper-{version}.dist-info/METADATA,,\n",
    }


@pytest.mark.parametrize(
    ("reader", "modules"),
    [
        ("from helper import version", 0),
        ("import importlib.metadata; version = importlib.metadata.version('helper')", 20),
        (ASKS, 20),
    ],
    ids=["import", "metadata", "child"],
)
def test_an_upgraded_distribution_causes_a_rebuild(
    reader: str, modules: int, tree: Tree, forge: Forge
) -> None:
    names = [f"part{number}" for number in range(modules)]
    root = tree(package(reader, **distribution("1.0", *names)))
    workspace = Workspace(root, forge, env={"PYTHONPATH": str(root / "lib")})
    shutil.rmtree(root / "lib")
    assert workspace.change(distribution("1.1", *names))
    workspace.is_as_clean()


def test_a_different_setuptools_causes_a_rebuild(tree: Tree, forge: Forge) -> None:
    """One that lacks it is lent forge's own, until it has one."""
    root = tree(package())
    venv.create(root / "venv")
    (site,) = root.glob("venv/lib/python*/site-packages")
    workspace = Workspace(root, forge, "--python", str(root / "venv/bin/python3"))
    home = Path(setuptools.__file__).parent
    for path in (home, *home.parent.glob("setuptools-*.dist-info"), home.parent / "_distutils_hack"):
        shutil.copytree(path, site / path.name)
    assert workspace.build()
    assert workspace.build() == ""
    (info,) = site.glob("setuptools-*.dist-info")
    version = setuptools.__version__
    metadata = (info / "METADATA").read_text(encoding="utf-8")
    (info / "METADATA").write_text(metadata.replace(f"Version: {version}", "Version: 99.0"), encoding="utf-8")
    info.rename(site / "setuptools-99.0.dist-info")
    assert workspace.build()
    workspace.is_as_clean()


@pytest.mark.needs("gcc", "clang")
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_external_headers_and_libraries_of_extensions_are_inputs(
    compiler: str, tree: Tree, forge: Forge
) -> None:
    line = """more = {"ext_modules": [Extension("talk.fast", ["fast.c"], include_dirs=[
        os.path.join(here, "../../first"), os.path.join(here, "../../second")])]}"""
    files = {"src/talk/fast.c": EXTENSION, "second/size.h": '#define SIZE "one"\n', "first/other.h": ""}
    root = tree(package(line, **files))
    workspace = Workspace(root, forge, env={"CC": compiler, "LDSHARED": f"{compiler} -shared"})
    assert workspace.change({"second/size.h": '#define SIZE "two"\n'})
    assert workspace.change({"first/size.h": '#define SIZE "the first on the path"\n'})
    workspace.is_as_clean()


@pytest.mark.needs("gcc")
def test_external_static_libraries_of_extensions_are_inputs(tree: Tree, forge: Forge) -> None:
    code = EXTENSION.replace('#include "size.h"', "extern const char size[];").replace("SIZE", "size")
    line = """more = {"ext_modules": [Extension("talk.fast", ["fast.c"],
        library_dirs=[os.path.join(here, "../../lib")], libraries=["size"])]}"""
    root = tree(package(line, **{"src/talk/fast.c": code}))

    def library(text: str) -> None:
        (root / "lib").mkdir(exist_ok=True)
        (root / "size.c").write_text(f'const char size[] = "{text}";\n')
        subprocess.run(["gcc", "-fPIC", "-c", "size.c", "-o", "size.o"], cwd=root, check=True)
        (root / "lib/libsize.a").unlink(missing_ok=True)
        subprocess.run(["ar", "rcsD", "lib/libsize.a", "size.o"], cwd=root, check=True)

    library("one")
    workspace = Workspace(root, forge)
    library("two")
    assert workspace.change({})
    workspace.is_as_clean()


def test_edits_are_visible_through_links_and_new_modules_are_built(tree: Tree, forge: Forge) -> None:
    files = {"src/talk/talk/a.py": "a = 1\n", "src/talk/talk/b.py": "a = 1\n"}
    workspace = Workspace(tree(package(**files)), forge, "--symlink-install")
    (installed,) = workspace.root.glob("install/talk/lib/python*/site-packages/talk/a.py")
    (workspace.root / "src/talk/talk/a.py").write_text("a = 2\n", encoding="utf-8")
    assert installed.read_text(encoding="utf-8") == "a = 2\n"
    workspace.build()
    workspace.change({"src/talk/talk/c.py": "a = 3\n"})
    workspace.is_as_clean()
    workspace.change({"src/talk/talk/a.py": None})
    workspace.is_as_clean()


def test_files_written_into_sources_cause_no_endless_rebuilds(built: Tree, forge: Forge) -> None:
    """The first build changes the sources, as the second one finds; that leaves them as they were."""
    root = built(package("open('talk/made.py', 'w').write('made = 1')"))
    assert "'talk/made.py' was added" in forge("build", "--explain", cwd=root).out
    workspace = Workspace(root, forge, first=False)
    shutil.rmtree(root / "build")
    assert workspace.build() == "not built yet"
    assert workspace.build() == ""
