"""Hints name the command that adds packages to the environment in which forge was installed."""

import shlex
import sys

import pytest

from forge.base.own_environment import extra_command, install_beside_forge
from tests.conftest import Tree

RECEIPT = """[tool]
requirements = [
    {{ name = "ros-forge", {source} }},
    {{ name = "fsspec", specifier = ">=2023.1" }},
]
entrypoints = [
    {{ name = "forge", install-path = "/home/me/.local/bin/forge", from = "ros-forge" }},
]
"""


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ('extras = ["cmake"], directory = "/home/me/my forge"', "'/home/me/my forge[cmake]'"),
        ('extras = ["cmake", "lsp"], editable = "/src/forge"', "--editable '/src/forge[cmake,lsp]'"),
        ('path = "/wheels/ros_forge-0.1.0-py3-none-any.whl"', "/wheels/ros_forge-0.1.0-py3-none-any.whl"),
        ('extras = ["cmake"], git = "https://h/f"', "'ros-forge[cmake] @ git+https://h/f'"),
        ('git = "https://h/f?rev=main"', "'ros-forge @ git+https://h/f@main'"),
        ('url = "https://h/f.whl"', "'ros-forge @ https://h/f.whl'"),
        ('extras = ["cmake"], specifier = "==0.1.0"', "'ros-forge[cmake]==0.1.0'"),
        ('extras = ["cmake"]', "'ros-forge[cmake]'"),
    ],
)
def test_uv_commands_keep_earlier_requirements(tree: Tree, source: str, expected: str) -> None:
    """Otherwise, `uv tool install` would remove extras and install another forge."""
    prefix = tree({"ros-forge/uv-receipt.toml": RECEIPT.format(source=source)}) / "ros-forge"
    command = install_beside_forge("pygls<3,>=2", prefix=prefix)
    assert command == f"uv tool install --with 'fsspec>=2023.1' --with 'pygls<3,>=2' {expected}"


def test_pipx_injects_into_the_environment_of_forge(tree: Tree) -> None:
    prefix = tree({"venvs/ros-forge/pipx_metadata.json": "{}"}) / "venvs/ros-forge"
    assert install_beside_forge("pygls<3,>=2", prefix=prefix) == "pipx inject ros-forge 'pygls<3,>=2'"


def test_virtual_environments_get_a_pip_or_uv_command(tree: Tree) -> None:
    root = tree({"pip/pyvenv.cfg": "home = /usr/bin\n", "uv/pyvenv.cfg": "home = /usr/bin\nuv = 0.9.1\n"})
    python = shlex.quote(sys.executable)
    assert install_beside_forge("a", prefix=root / "pip") == f"{python} -m pip install a"
    assert install_beside_forge("a", prefix=root / "uv") == f"uv pip install --python {python} a"


@pytest.mark.parametrize(
    ("extra", "package"),
    [
        ("cmake", "cmake"),
        ("cross", "ziglang"),
        ("dask", "distributed"),
        ("lsp", "pygls"),
        ("remote", "fsspec"),
        ("rosdep", "rosdep"),
    ],
)
def test_an_extra_is_expanded_to_its_requirements(extra: str, package: str) -> None:
    """The name of forge itself might lead to another project on a package index."""
    command = extra_command(extra)
    assert "ros-forge" not in command.replace(sys.executable, "")
    words = shlex.split(command)
    assert sum(word.startswith(package) for word in words) == 1
    assert not any(word.startswith(("jinja2", "lark")) for word in words)
