"""Names of Python projects are compared as pip does (PEP 503); names of ROS packages are literal."""

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text

LIBRARY = {"src/z/pyproject.toml": '[project]\nname = "np.lib"\nversion = "1"\n'}
SETUP = "from setuptools import setup\nsetup(name='aa-user', {})\n"
USERS = {
    "pyproject": {
        "src/a/pyproject.toml": '[project]\nname = "aa-user"\nversion = "1"\ndependencies = ["Np_Lib>=0.1"]\n'
    },
    "setup.py": {"src/a/setup.py": SETUP.format("install_requires=['NP-lib[x]']")},
    "setup.cfg": {
        "src/a/setup.cfg": "[metadata]\nname = aa-user\n[options]\ninstall_requires =\n  np__lib\n",
        "src/a/setup.py": "from setuptools import setup\nsetup()\n",
    },
    "package.xml": {"src/a/package.xml": manifest_text("aa-user", "<depend>np_lib</depend>")},
}


@pytest.mark.parametrize("user", USERS)
def test_a_dependency_may_spell_a_project_differently(tree: Tree, forge: Forge, user: str) -> None:
    root = tree(LIBRARY | USERS[user])
    assert forge("list", "-t", "-n", cwd=root).out.split() == ["np.lib", "aa-user"]
    assert forge("list", "-n", "--packages-up-to", "aa-user", cwd=root).out.split() == ["aa-user", "np.lib"]
    assert forge("list", "-n", "--packages-above", "NP_lib", cwd=root).out.split() == ["aa-user", "np.lib"]


@pytest.mark.parametrize("option", ["select", "up-to", "start", "end"])
def test_an_option_may_spell_a_project_differently(tree: Tree, forge: Forge, option: str) -> None:
    root = tree(LIBRARY)
    ran = forge("list", "-n", f"--packages-{option}", "np-lib", cwd=root)
    assert (ran.out, ran.err) == ("np.lib\n", "")
    for leaving_out in ("--packages-skip", "--packages-ignore"):
        assert forge("list", "-n", leaving_out, "Np-Lib", cwd=root).out == ""


def test_an_exact_package_name_takes_precedence(tree: Tree, forge: Forge) -> None:
    root = tree(
        {
            **LIBRARY,
            "src/np-lib/package.xml": manifest_text("np_lib"),
            "src/b/package.xml": manifest_text("b", "<depend>np_lib</depend>"),
        }
    )
    assert forge("list", "-n", "--packages-up-to", "b", cwd=root).out.split() == ["b", "np_lib"]
    assert forge("list", "-n", "--packages-select", "np_lib", cwd=root).out.split() == ["np_lib"]


def test_names_of_ros_packages_must_match_exactly(tree: Tree, forge: Forge) -> None:
    root = tree(
        {
            "src/z/package.xml": manifest_text("z_lib", build_type="ament_python"),
            "src/z/setup.py": "",
            "src/a/package.xml": manifest_text("a", "<depend>z-lib</depend>"),
        }
    )
    assert forge("list", "-n", "--packages-up-to", "a", cwd=root).out.split() == ["a"]


def test_two_spellings_of_a_project_give_a_warning(tree: Tree, forge: Forge) -> None:
    root = tree(LIBRARY | {"src/y/pyproject.toml": '[project]\nname = "np_lib"\n'})
    ran = forge("list", "-n", cwd=root)
    assert ran.out.split() == ["np.lib", "np_lib"]
    assert "'np_lib' and 'np.lib' are the same Python project" in ran.err
