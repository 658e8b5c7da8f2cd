"""Packages without a package.xml build."""

from pathlib import Path

import pytest

from tests.conftest import Forge, Tree

ENV = {"PYTHONPATH": str(Path(__file__).parents[3])}
CMAKE = "cmake_minimum_required(VERSION 3.10)\nproject({} NONE)\n"
SETUP = "from setuptools import setup\nsetup({})\n"


@pytest.mark.needs("cmake")
def test_plain_packages_build_and_their_scripts_are_on_the_path(tree: Tree, forge: Forge) -> None:
    root = tree(
        {
            "src/c/CMakeLists.txt": CMAKE.format("c")
            + "message(STATUS ${WORD})\ninstall(FILES h.sh DESTINATION share/c)\n",
            "src/c/h.sh": "export FROM_HOOK=1\n",
            "src/c/colcon.pkg": "cmake-args: [-DWORD=said]\nhooks: [share/c/h.sh]\n",
            "src/p/setup.py": SETUP.format(
                "name='p', py_modules=['p'], install_requires=['c'], "
                "entry_points={'console_scripts': ['p=p:main']}"
            ),
            "src/p/p.py": "def main(): print('hello')\n",
        }
    )
    ran = forge("build", "--event-handlers", "console_direct+", cwd=root, env=ENV)
    assert (ran.code, ran.err) == (0, "")
    assert "-- said" in ran.out
    assert (root / "install/p/bin/p").is_file()
    assert "source;share/c/h.sh" in (root / "install/c/share/c/package.dsv").read_text()
    assert "0 packages finished, 2 packages unchanged" in forge("build", cwd=root, env=ENV).out
