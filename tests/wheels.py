"""A Python package to install with `python -m forge.cli.install_wheel`, and what it installs."""

import subprocess
import sys
from pathlib import Path

from forge.cli.install_wheel import main

SITE = "lib/python3/site-packages"

SETUP = {
    "src/talk/setup.cfg": "[install]\ninstall_scripts=$base/lib/talk\n",
    "src/talk/setup.py": """from setuptools import setup
setup(name="talk", version="0.1.0", packages=["talk"],
      data_files=[("share/talk/launch", ["launch/talk.launch.py"])],
      entry_points={"console_scripts": ["hello = talk.hello:main"]})
""",
    "src/talk/talk/__init__.py": "",
    "src/talk/talk/hello.py": "def main():\n    print('hello from talk')\n",
    "src/talk/talk/old.py": "",
    "src/talk/launch/talk.launch.py": "# a launch file\n",
}


def setup_py(code: str = "", arguments: str = "") -> dict[str, str]:
    """Return the package with more code and arguments in its setup.py."""
    text = SETUP["src/talk/setup.py"].replace("      entry_points", f"      {arguments}\n      entry_points")
    return SETUP | {"src/talk/setup.py": f"import os, sys\nfrom setuptools import Command\n{code}\n{text}"}


def install(root: Path, *options: str, python: str = sys.executable) -> int:
    """Install the package talk below root/install with an interpreter."""
    return main(
        [
            str(root / "src/talk"),
            *("--package", "talk", "--build", str(root / "build/talk"), "--prefix", str(root / "install")),
            *("--python", python, "--site-packages", SITE, *options),
        ]
    )


def files(folder: Path) -> set[str]:
    """Return the files below a folder, metadata left out."""
    found = (p.relative_to(folder).as_posix() for p in folder.rglob("*") if not p.is_dir())
    return {name for name in found if "-info/" not in name}


def hello(root: Path) -> str:
    """Run the installed console script."""
    argv = [str(root / "install/lib/talk/hello")]
    env = {"PYTHONPATH": str(root / "install" / SITE), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(argv, env=env, check=True, capture_output=True, text=True).stdout
