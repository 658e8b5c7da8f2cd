"""The Python modules that packages of ROS need, in an environment of the underlay."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from forge.base.errors import HostError, Problem
from forge.plugins.fetch.lock import Lock

REQUIREMENTS = {
    "python3-argcomplete": "argcomplete",
    "python3-catkin-pkg": "catkin-pkg",
    "python3-catkin-pkg-modules": "catkin-pkg",
    "python3-empy": "empy==3.3.4",  # the generators of Humble and Jazzy do not support empy 4
    "python3-importlib-metadata": "importlib-metadata",
    "python3-importlib-resources": "importlib-resources",
    "python3-lark-parser": "lark",
    "python3-lxml": "lxml",
    "python3-netifaces": "netifaces",
    "python3-numpy": "numpy",
    "python3-packaging": "packaging",
    "python3-pkg-resources": "setuptools<80",
    "python3-psutil": "psutil",
    "python3-setuptools": "setuptools<80",  # Humble's packages do not support setuptools 80
    "python3-typeguard": "typeguard",
    "python3-yaml": "PyYAML",
}
"""The distributions on PyPI of rosdep's keys."""


def prepare_interpreter(folder: Path, lock: Lock, variables: Mapping[str, str]) -> str:
    """Return an interpreter with the modules of the lock's keys, in an environment of the underlay.

    Without such keys, it is `python3` on PATH. Raises HostError if the modules cannot be installed.
    """
    python = shutil.which("python3", path=variables.get("PATH")) or sys.executable
    requirements = sorted({REQUIREMENTS[key] for key in lock.keys if key in REQUIREMENTS})
    if not requirements:
        return python
    environment = folder / "venv"
    own_python = environment / "bin/python"
    stamp = environment / "requirements.txt"
    text = "".join(f"{each}\n" for each in requirements)
    if stamp.is_file() and stamp.read_text() == text:
        return str(own_python)
    uv = shutil.which("uv", path=variables.get("PATH"))
    create = [uv, "venv", "--allow-existing", "--python", python] if uv else [python, "-m", "venv"]
    install = [uv, "pip", "install", "--python", own_python] if uv else [own_python, "-m", "pip", "install"]
    print(f"installing {', '.join(requirements)} in '{environment}'", file=sys.stderr, flush=True)
    for command in ([*create, environment], [*install, "--quiet", *requirements]):
        done = subprocess.run(
            [str(word) for word in command], env=dict(variables), capture_output=True, text=True, check=False
        )
        if done.returncode:
            lines = [line for line in done.stderr.splitlines() if line.strip()]
            raise HostError(
                Problem(f"cannot install Python modules of ROS: {lines[-1] if lines else command[0]}")
            )
    stamp.write_text(text)
    return str(own_python)
