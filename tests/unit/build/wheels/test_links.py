"""Installed files of a Python package are links to its sources."""

from forge.build.wheels.install_wheel import WheelInstall, link_to_sources
from tests.conftest import Tree


def test_a_copy_in_a_virtual_environment_is_not_a_source(tree: Tree) -> None:
    """As after `pip install .` in a virtual environment within the package."""
    root = tree(
        {
            "p/setup.py": "",
            "p/p/mine.py": "X = 1\n",
            "p/venv/pyvenv.cfg": "",
            "p/venv/lib/python3.11/site-packages/p/mine.py": "X = 1\n",
            "p/node_modules/p/mine.py": "X = 1\n",
            "install/p/mine.py": "X = 1\n",
        }
    )
    installed = root / "install/p/mine.py"
    options = WheelInstall(root / "p", "p", root / "build", root / "install", "python3", "site")
    link_to_sources(options, "", [installed])
    assert installed.is_symlink()
    assert installed.resolve() == root / "p/p/mine.py"
