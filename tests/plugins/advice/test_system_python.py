"""Modules of the system's Python are system packages."""

import os
from pathlib import Path

import pytest

from forge.plugins.advice.system_python import system_command

PYTHON = Path("/usr/bin/python3")
SUDO = "" if os.geteuid() == 0 else "sudo "


@pytest.mark.needs("/usr/bin/python3")
@pytest.mark.parametrize(
    ("system", "modules", "command"),
    [
        ({"ID": "ubuntu", "ID_LIKE": "debian"}, ["numpy", "em"], "apt install python3-numpy python3-empy"),
        ({"ID": "mint", "ID_LIKE": "ubuntu debian"}, ["pytest"], "apt install python3-pytest"),
        ({"ID": "openEuler"}, ["numpy", "yaml"], "dnf install python3-numpy python3-pyyaml"),
        ({"ID": "rocky", "ID_LIKE": "rhel centos fedora"}, ["numpy"], "dnf install python3-numpy"),
    ],
)
def test_system_pythons_get_a_system_package_command(
    system: dict[str, str], modules: list[str], command: str
) -> None:
    """pip refuses to install into it."""
    assert system_command(PYTHON, modules, " ".join(modules), system) == SUDO + command


@pytest.mark.needs("/usr/bin/python3")
def test_system_pythons_get_a_virtual_environment_command_for_other_modules() -> None:
    """The hint includes the package with the usual name, which may exist."""
    assert system_command(PYTHON, ["numpy", "Foo_Bar"], "numpy Foo_Bar", {"ID": "debian"}) == (
        f"{SUDO}apt install python3-numpy python3-foo-bar; if there is no such package: "
        "/usr/bin/python3 -m venv --system-site-packages .venv && . .venv/bin/activate "
        "&& pip install numpy Foo_Bar"
    )


def test_other_interpreters_get_no_system_package_command() -> None:
    assert not system_command(PYTHON, ["numpy"], "numpy", {"ID": "plan9"})
    assert not system_command(Path("/usr/bin/python3.0"), ["numpy"], "numpy", {"ID": "debian"})
