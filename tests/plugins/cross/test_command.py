"""`--target`: rejected combinations, similar names, and Python packages."""

import sys

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text

SETUP = """\
from setuptools import Distribution, setup
class Compiled(Distribution):
    def has_ext_modules(self):
        return True
setup(name="quick", version="1", packages=["quick"], distclass=Compiled)
"""
QUICK = {
    "src/quick/package.xml": manifest_text("quick", build_type="ament_python"),
    "src/quick/setup.py": SETUP,
    "src/quick/quick/__init__.py": "",
}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--sysroot", "x"), "--sysroot has no effect without --target"),
        (("--toolchain-file", "x"), "--toolchain-file has no effect without --target"),
        (("--target-python", "3.10"), "--target-python has no effect without --target"),
        (("--target", "arm64", "--target-python", "2.7"), "expected a version such as '3.10', not '2.7'"),
        (("--target", "x/y"), "'x/y' is not the name of a platform"),
    ],
)
def test_options_without_effect_are_rejected(
    tree: Tree, forge: Forge, words: tuple[str, ...], message: str
) -> None:
    ran = forge("build", *words, cwd=tree(QUICK))
    assert (ran.code, message in ran.err) == (2, True)


def test_a_similar_target_is_suggested(tree: Tree, forge: Forge) -> None:
    ran = forge("build", "--target", "arm46", cwd=tree(QUICK))
    assert ran.code == 2
    assert "unknown target 'arm46'\nhint: did you mean 'arm64'? otherwise use one of " in ran.err


def test_a_native_build_imports_no_cross_compilation(
    tree: Tree, forge: Forge, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [name for name in sys.modules if name.startswith("forge.plugins.cross")]:
        monkeypatch.delitem(sys.modules, name)
    assert forge("build", "--dry-run", cwd=tree(QUICK)).code == 0
    assert not [name for name in sys.modules if name.startswith("forge.plugins.cross")]


def test_compiled_python_modules_are_rejected(tree: Tree, forge: Forge) -> None:
    """They would be for this machine; pure packages are installed for the target's Python."""
    plain = {
        "src/plain/package.xml": manifest_text("plain", build_type="ament_python"),
        "src/plain/setup.py": "from setuptools import setup\nsetup(name='plain', packages=['plain'])\n",
        "src/plain/plain/__init__.py": "",
    }
    root = tree({**QUICK, **plain, "own.cmake": ""})
    words = ("--target", "arm64", "--toolchain-file", "own.cmake", "--target-python", "3.10")
    ran = forge("build", *words, "--continue-on-error", cwd=root)
    assert ran.code == 1
    assert f"{root}/src/quick: error: compiled modules cannot be built for 'aarch64-linux-gnu'\n" in ran.err
    site = "install/aarch64-linux-gnu/plain/lib/python3.10/site-packages"
    assert (root / site / "plain/__init__.py").is_file()
