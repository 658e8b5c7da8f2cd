"""forge in an environment of its own, as `uv tool install` and pipx make it, with another python3 on PATH.

The workspace belongs to the python3 on PATH: it runs the installed programs, and is asked what is installed.
"""

import json
import os
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.conftest import Tree
from tests.packages import manifest_text

SETUP = """from setuptools import setup
setup(
    name="talk",
    version="1",
    packages=["talk"],
    data_files=[("share/talk", ["package.xml"]), ("lib/talk", ["by_env"])],
    entry_points={"console_scripts": ["by_entry_point = talk:main"]},
)
"""
CODE = "import sys\n\n\ndef main():\n    print(sys.prefix)\n"
BY_ENV = "#!/usr/bin/env python3\nimport sys\nprint(sys.prefix)\n"
RULES = "of_the_tool: {'*': {pip: {packages: [of-the-tool]}}}\nours: {'*': {pip: {packages: [ours]}}}\n"
METADATA = "Metadata-Version: 2.1\nName: {}\nVersion: 1\n"


class Machine(NamedTuple):
    """A workspace, the environment of forge as a tool, and the python3 on PATH with an environment of it."""

    root: Path
    tool: Path
    system: Path

    def forge(self, *argv: str) -> str:
        """Return what a command line prints, with nothing active and nothing sourced."""
        path = os.pathsep.join((f"{self.system}/bin", f"{self.tool}/bin", "/usr/bin", "/bin"))
        ran = subprocess.run(
            (self.tool / "bin/forge", *argv),
            cwd=self.root,
            env={"PATH": path, "HOME": str(self.root.parent), "FORGE_CACHE": ""},
            capture_output=True,
            text=True,
            check=False,
        )
        assert ran.returncode == 0, ran.stderr
        return ran.stdout


def made(root: Path, package: str) -> Path:
    """Make a virtual environment in which one package is installed."""
    venv.create(root, symlinks=True)
    site = site_packages(root)
    (site / f"{package}-1.dist-info").mkdir()
    (site / f"{package}-1.dist-info/METADATA").write_text(METADATA.format(package))
    return root


def site_packages(root: Path) -> Path:
    """Return the folder for packages of an environment."""
    return Path(sysconfig.get_path("purelib", vars={"base": str(root), "platbase": str(root)}))


@pytest.fixture
def machine(tree: Tree) -> Machine:
    root = tree(
        {
            "ws/src/talk/package.xml": manifest_text(
                "talk",
                "<exec_depend>of_the_tool</exec_depend><exec_depend>ours</exec_depend>",
                build_type="ament_python",
            ),
            "ws/src/talk/setup.py": SETUP,
            "ws/src/talk/setup.cfg": "[install]\ninstall_scripts=$base/lib/talk\n",
            "ws/src/talk/talk/__init__.py": CODE,
            "ws/src/talk/by_env": BY_ENV,
            "ws/rules.yaml": RULES,
        }
    )
    tool, system = made(root / "tools/ros-forge", "of_the_tool"), made(root / "system", "ours")
    (tool / "uv-receipt.toml").write_text("[tool]\n")
    libraries = (str(Path(__file__).parents[2]), *(path for path in sys.path if "site-packages" in path))
    (site_packages(tool) / "forge.pth").write_text("\n".join(libraries))
    program = f"#!{tool}/bin/python\nimport sys\nfrom _ros_forge import main\nsys.exit(main())\n"
    tree({"tools/ros-forge/bin/forge": program})
    return Machine(root / "ws", tool, system)


def test_every_command_uses_the_python_of_the_workspace(machine: Machine) -> None:
    python = f"{machine.system}/bin/python3"
    assert json.loads(machine.forge("info", "--json"))["python"]["path"] == python
    machine.forge("build")
    program = machine.root / "install/talk/lib/talk/by_entry_point"
    assert program.read_text().splitlines()[0] == f"#!{python}"
    for name in ("by_entry_point", "by_env"):
        assert machine.forge("run", "talk", name).strip() == str(machine.system)
    listed = machine.forge("deps", "--rosdep-file", "rules.yaml")
    assert f"{python} -m pip install of-the-tool" in listed
    assert "ours" not in listed
    assert f"python: {python} ({sys.version_info.major}.{sys.version_info.minor}, " in machine.forge("info")
