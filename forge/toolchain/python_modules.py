"""Checks which modules an interpreter has, and tells the command that installs missing ones."""

from __future__ import annotations

import importlib.util
import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.errors import HostError, Problem
from forge.base.own_environment import has_no_pip
from forge.toolchain.interpreter import ask_python, is_own
from forge.toolchain.os_release import DEBIAN, RED_HAT, families, os_release

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

_TRAITS = """import importlib.metadata as m, importlib.util as u, os, sys, sysconfig
print("version=%d.%d.%d" % sys.version_info[:3])
header = sysconfig.get_path("include") + "/Python.h"
os.path.exists(header) and print("header=" + header)
for name in sys.argv[1:]:
    u.find_spec(name) and print(name + "=there")
try:
    print("setuptools=" + m.version("setuptools"))
except m.PackageNotFoundError:
    pass
"""
_MISSING = "import importlib.util as u, sys; print(*(n for n in sys.argv[1:] if not u.find_spec(n)))"

_ON_INDEX = {"cv2": "opencv-python", "em": "empy<4", "pytest_cov": "pytest-cov", "yaml": "PyYAML"}
"""Distributions on PyPI that have another name than their module."""
_DISTRIBUTIONS: Mapping[str, tuple[str, str]] = {
    "catkin_pkg": ("python3-catkin-pkg", "python3-catkin_pkg"),
    "coverage": ("python3-coverage", "python3-coverage"),
    "cv2": ("python3-opencv", "python3-opencv"),
    "em": ("python3-empy", "python3-empy"),
    "lark": ("python3-lark", "python3-lark-parser"),
    "numpy": ("python3-numpy", "python3-numpy"),
    "pytest": ("python3-pytest", "python3-pytest"),
    "pytest_cov": ("python3-pytest-cov", "python3-pytest-cov"),
    "setuptools": ("python3-setuptools", "python3-setuptools"),
    "wheel": ("python3-wheel", "python3-wheel"),
    "yaml": ("python3-yaml", "python3-pyyaml"),
}
"""The packages of Debian and Fedora, and of systems like them, that contain a module."""
_SYSTEM = (Path("/usr/bin"), Path("/bin"))


def require_modules(python: Path, names: Iterable[str]) -> None:
    """Raise HostError with the modules that an interpreter lacks and how to install them."""
    missing = missing_modules(python, names)
    if missing:
        raise HostError(missing_modules_problem(python, missing))


def missing_modules_problem(python: Path, modules: Iterable[str]) -> Problem:
    """Return a problem for modules that the build needs and an interpreter lacks."""
    names = list(modules)
    return Problem(
        f"'{python}' lacks modules required by the build: {', '.join(map(repr, names))}",
        hint=install_command(python, names),
    )


def install_command(python: Path, modules: Sequence[str], system: Mapping[str, str] | None = None) -> str:
    """Return the shell command that installs modules for an interpreter.

    The interpreter of Debian, Fedora and systems like them has packages of the system, since pip refuses to
    install into it; for other modules, they may have a package of the usual name, else a virtual environment
    is needed. All others have pip, except for environments made by uv. `system` are the fields of os-release,
    by default this machine's.
    """
    column, manager = _manager(python, system)
    words = " ".join(shlex.quote(_ON_INDEX.get(name, name)) for name in modules)
    program = shlex.quote(str(python))
    if manager:
        sudo = "" if os.geteuid() == 0 else "sudo "
        usual = {name: (f"python3-{name.lower().replace('_', '-')}",) * 2 for name in modules}
        names = ({**usual, **_DISTRIBUTIONS}[name][column] for name in modules)
        command = f"{sudo}{manager} install {shlex.join(names)}"
        if all(name in _DISTRIBUTIONS for name in modules):
            return command
        activated = f"{program} -m venv --system-site-packages .venv && . .venv/bin/activate"
        return f"{command}; if there is no such package: {activated} && pip install {words}"
    if has_no_pip(python.parent.parent):
        return f"uv pip install --python {program} {words}"
    return f"{program} -m pip install {words}"


def interpreter_properties(python: Path, names: Iterable[str]) -> Mapping[str, str]:
    """Return properties of an interpreter; raises HostError if it does not run.

    The keys are 'version'; 'header', if C extensions can be compiled; 'setuptools', its version; and the
    names of those modules in `names` that exist.
    """
    return dict(line.split("=", 1) for line in ask_python(python, _TRAITS, *names).splitlines())


def missing_modules(python: Path, names: Iterable[str]) -> list[str]:
    """Return the modules that an interpreter lacks; raises HostError if it does not run."""
    if is_own(python):
        return [name for name in names if importlib.util.find_spec(name) is None]
    return ask_python(python, _MISSING, *names).split()


def _manager(python: Path, system: Mapping[str, str] | None) -> tuple[int, str]:
    """Return the package manager for the system's own interpreter with its column above, '' for others."""
    if python.parent not in _SYSTEM or not _is_default(python):
        return 0, ""
    kin = families(os_release() if system is None else system)
    return (0, "apt") if not DEBIAN.isdisjoint(kin) else (1, "" if RED_HAT.isdisjoint(kin) else "dnf")


def _is_default(python: Path) -> bool:
    """Tell whether this is the version for which the system has packages."""
    try:
        return python.samefile(python.with_name("python3"))
    except OSError:
        return False
