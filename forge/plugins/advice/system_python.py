"""Commands that install modules for the Python of Debian, Fedora and similar systems."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

from forge.toolchain.python_modules import DEBIAN, RED_HAT, families, os_release

_USUAL_NAMES = frozenset({"coverage", "numpy", "pytest", "pytest_cov", "setuptools", "wheel"})
_OTHER_NAMES = {
    "catkin_pkg": {"apt": "catkin-pkg", "dnf": "catkin_pkg"},
    "cv2": {"apt": "opencv", "dnf": "opencv"},
    "em": {"apt": "empy", "dnf": "empy"},
    "lark": {"apt": "lark", "dnf": "lark-parser"},
    "yaml": {"apt": "yaml", "dnf": "pyyaml"},
}
"""Package names on Debian, Fedora and similar systems, without the prefix 'python3-'."""
_SYSTEM = (Path("/usr/bin"), Path("/bin"))


def system_command(
    python: Path, modules: Sequence[str], words: str, system: Mapping[str, str] | None = None
) -> str:
    """Return the shell command that installs modules for the interpreter of the system, '' for others.

    It needs system packages, because pip refuses to install into it; other modules may have a package of the
    usual name, else a virtual environment is needed, with `words` for pip. `system` are the fields of
    os-release, by default this machine's.
    """
    manager = _package_manager(python, system)
    if not manager:
        return ""
    usual = {name: name.lower().replace("_", "-") for name in modules}
    names = (_OTHER_NAMES.get(name, {}).get(manager, usual[name]) for name in modules)
    packages = shlex.join(f"python3-{name}" for name in names)
    command = f"{'' if os.geteuid() == 0 else 'sudo '}{manager} install {packages}"
    if _USUAL_NAMES.union(_OTHER_NAMES).issuperset(modules):
        return command
    activated = f"{shlex.quote(str(python))} -m venv --system-site-packages .venv && . .venv/bin/activate"
    return f"{command}; if there is no such package: {activated} && pip install {words}"


def _package_manager(python: Path, system: Mapping[str, str] | None) -> str:
    """Return the package manager of the system's own interpreter, '' for others."""
    try:
        # The system has packages for one version only.
        is_default = python.parent in _SYSTEM and python.samefile(python.with_name("python3"))
    except OSError:
        return ""
    kin = families(os_release() if system is None else system) if is_default else ()
    return "apt" if not DEBIAN.isdisjoint(kin) else "" if RED_HAT.isdisjoint(kin) else "dnf"
