"""forge and colcon install the same files of Python packages that customise setuptools."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import Forge
from tests.e2e.test_colcon_installs import contents
from tests.packages import manifest_text
from tests.peers import Colcon

pytestmark = [pytest.mark.slow, pytest.mark.needs("colcon")]

SETUP = """import os, sys
from setuptools import Command, Extension, find_packages, setup
{code}
setup(name="NAME", version="0.1.0", packages=sorted({{"NAME", *find_packages()}}),
      data_files=[("share/ament_index/resource_index/packages", ["resource/NAME"]),
                  ("share/NAME", ["package.xml"])],
      entry_points={{"console_scripts": ["node = NAME.node:main"]}}, {arguments})
{after}
"""
CFG = "[install]\ninstall_scripts=$base/lib/NAME\n"
HOOK = """
import {module}
class Hook_{command}({module}.{command}):
    def run(self):
        super().run()
        with open(os.path.join(self.{folder}, "hook-{command}"), "w") as stream:
            stream.write(" ".join(str(value) for value in (self.{folder}, sys.prefix, sys.argv[1])))
"""


def setup(arguments: str = "", code: str = "", after: str = "", cfg: str = CFG) -> dict[str, str]:
    return {"setup.py": SETUP.format(code=code, arguments=arguments, after=after), "setup.cfg": cfg}


def hooks(**folders: str) -> dict[str, str]:
    """Return a package with commands of its own, which write into a folder that they know."""
    code = ""
    for command, folder in folders.items():
        tool = "distutils" if command == "install_data" else "setuptools"
        code += HOOK.format(module=f"{tool}.command.{command}", command=command, folder=folder)
    classes = ", ".join(f"'{command}': Hook_{command}" for command in folders)
    return setup(f"cmdclass={{{classes}}},", code)


PACKAGES: dict[str, dict[str, str]] = {
    "files": {
        **setup(
            "scripts=['tool', 'shell'], headers=['h.h'], include_package_data=True,",
            cfg=f"{CFG}[build_scripts]\nexecutable = /usr/bin/env python3\n"
            "[options.entry_points]\nplugins =\n  one = NAME.node\n",
        ),
        "tool": "#!/usr/bin/python -u\n",
        "shell": "#!/bin/sh\n",
        "h.h": "",
        "MANIFEST.in": "include NAME/a.txt\n",
        "NAME/a.txt": "",
        "NAME/b.txt": "",
    },
    "executable_option": setup("options={'build': {'executable': '/usr/bin/env python3'}},"),
    "folders": setup(
        "options={'install': {'install_lib': '$base/own', 'install_scripts': '$base/x'}},", cfg=""
    ),
    "folders_cfg": setup(cfg=f"{CFG}install_lib=$base/own\n"),
    "nothing": setup(cfg=""),
    "post_install": hooks(install="install_scripts"),
    "post_parts": hooks(
        install_lib="install_dir",
        install_data="install_dir",
        install_scripts="install_dir",
        install_egg_info="install_dir",
    ),
    "post_build": hooks(build_py="build_lib"),
    "post_info": hooks(egg_info="egg_info"),
    "own_command": setup(
        "cmdclass={'install': Hook, 'own': Own},",
        """
from setuptools.command.install import install
class Own(Command):
    user_options = []
    def initialize_options(self):
        self.install_dir = None
    def finalize_options(self):
        self.set_undefined_options("install", ("install_data", "install_dir"))
    def get_outputs(self):
        return [os.path.join(self.install_dir, "by_own_command")]
    def run(self):
        with open(self.get_outputs()[0], "w") as stream:
            stream.write(self.install_dir)
class Hook(install):
    sub_commands = [*install.sub_commands, ("own", lambda self: True)]
""",
    ),
    "twice": {**setup(after="setup(name='second', version='2', py_modules=['second'])"), "second.py": ""},
    "namespace": {
        **setup("namespace_packages=['NAMEs'],"),
        "NAMEs/__init__.py": "__import__('pkg_resources').declare_namespace(__name__)\n",
    },
    "extension": {
        **setup("ext_modules=[Extension('NAME.c', ['c.c'])],"),
        "c.c": """#include <Python.h>
static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, "c", 0, -1, 0};
PyMODINIT_FUNC PyInit_c(void) { return PyModule_Create(&module); }
""",
    },
    "extra_path": setup("extra_path='NAMEx',"),
    "other_name": {
        "setup.py": SETUP.format(code="", after="", arguments="").replace(
            'name="NAME"', 'name="Other.name-x"'
        ),
        "setup.cfg": CFG,
    },
}


@pytest.fixture(scope="module")
def colcon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Colcon]:
    home = str(tmp_path_factory.mktemp("home"))
    running = Colcon({"HOME": home, "AMENT_PREFIX_PATH": "", "COLCON_LOG_PATH": "/dev/null"})
    yield running
    running.end()


def test_install_trees_are_the_same(tmp_path: Path, colcon: Colcon, forge: Forge) -> None:
    for name, own in PACKAGES.items():
        every = {
            "package.xml": manifest_text(name, build_type="ament_python"),
            "resource/NAME": "",
            "NAME/__init__.py": "",
            "NAME/node.py": "def main():\n    pass\n",
        }
        for file, text in {**every, **own}.items():
            path = tmp_path / "src" / name / file.replace("NAME", name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text.replace("NAME", name))
    trees = []
    for home in (tmp_path / "ours", tmp_path / "theirs"):
        argv = ["build", "--build-base", f"{home}/build", "--install-base", f"{home}/install"]
        if home.name == "ours":
            ran = forge(*argv, "--python", colcon.python, cwd=tmp_path)
        else:
            ran = colcon(*argv, cwd=tmp_path)
        assert ran.code == 0, ran.err
        tree = {name: without_call(text) for name, text in contents(home / "install").items() if is_own(name)}
        trees.append(tree)
    assert trees[0].keys() == trees[1].keys()
    different = {name for name, text in trees[0].items() if text != trees[1][name]}
    assert different == set()


def is_own(name: str) -> bool:
    """Tell if setuptools installed a file; those of the tools are compared elsewhere."""
    of_tool = (
        name[0] == "."
        or "/package." in name
        or "/hook/" in name
        or "/colcon-core/" in name
        or "/" not in name
    )
    return not of_tool and not name.endswith(".so")


def without_call(text: str) -> str:
    """Return the first lines of a script: how it calls the function of an entry point differs."""
    return text.partition("python3\n")[0] if "sys.exit(" in text else text
