"""Checks which modules an interpreter has, suggests commands to install others, and provides setuptools."""

from __future__ import annotations

import importlib.util
import shlex
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from forge.base.errors import HostError, Problem
from forge.base.extensions import OPTIONS, own_plugin
from forge.base.own_environment import has_no_pip
from forge.toolchain.interpreter import ask_python, is_own

_MISSING = "import importlib.util as u, sys; print(*(n for n in sys.argv[1:] if not u.find_spec(n)))"

_SETUPTOOLS = """import importlib.util, os, sys
sys.path = [entry for entry in sys.path if entry]
home, other = (
    os.path.dirname(found.origin) if (found := importlib.util.find_spec(name)) and found.origin else ""
    for name in ("setuptools", "wheel")
)
able = home and (other or os.path.exists(home + "/command/bdist_wheel.py"))
print("%d.%d.%d" % sys.version_info[:3], "wheels" if able else "setuptools" if home else "nothing")
"""
_FILES_OF_SETUPTOOLS = ("setuptools", "pkg_resources", "_distutils_hack", "setuptools-*.dist-info")

_ON_INDEX = {"cv2": "opencv-python", "em": "empy<4", "pytest_cov": "pytest-cov", "yaml": "PyYAML"}
"""Distributions on PyPI whose names differ from those of their modules."""
DEBIAN = frozenset({"debian", "ubuntu", "linuxmint", "pop", "raspbian", "zorin", "elementary"})
RED_HAT = frozenset({"fedora", "rhel", "centos", "rocky", "almalinux", "ol", "openeuler", "amzn"})


def os_release() -> dict[str, str]:
    """Return the fields of os-release; empty if the file is missing."""
    import platform

    try:
        return platform.freedesktop_os_release()
    except OSError:
        return {}


def families(fields: Mapping[str, str]) -> tuple[str, ...]:
    """Return the ids of the system and of those in its ID_LIKE."""
    return (fields.get("ID", "linux").lower(), *fields.get("ID_LIKE", "").lower().split())


def require_modules(python: Path, names: Iterable[str]) -> None:
    """Raise HostError with the modules that an interpreter lacks and how to install them."""
    if missing := missing_modules(python, names):
        raise HostError(missing_modules_problem(python, missing))


def missing_modules_problem(python: Path, modules: Iterable[str]) -> Problem:
    """Return a problem for modules that the build needs and an interpreter lacks."""
    names = list(modules)
    return Problem(
        f"'{python}' lacks modules required by the build: {', '.join(map(repr, names))}",
        hint=install_command(python, names),
    )


def install_command(python: Path, modules: Sequence[str]) -> str:
    """Return the shell command that installs modules for an interpreter; environments of uv lack pip."""
    words = " ".join(shlex.quote(_ON_INDEX.get(name, name)) for name in modules)
    program = shlex.quote(str(python))
    advice = own_plugin(OPTIONS, "advice-system-python")
    if advice and (command := advice.system_command(python, modules, words)):
        return str(command)
    if has_no_pip(python.parent.parent):
        return f"uv pip install --python {program} {words}"
    return f"{program} -m pip install {words}"


def missing_modules(python: Path, names: Iterable[str]) -> list[str]:
    """Return the modules that an interpreter lacks; raises HostError if it does not run."""
    if is_own(python):
        return [name for name in names if importlib.util.find_spec(name) is None]
    return ask_python(python, _MISSING, *names).split()


def setuptools_path(python: str, folder: Path, *, wheels: bool) -> Path | None:
    """Return a PYTHONPATH folder with forge's setuptools; None if it is not needed or not compatible.

    It is needed by an interpreter without setuptools, or, for `wheels`, without one that can build them, such
    as Ubuntu's Python without python3-wheel.
    """
    if Path(python).parent == Path(sys.executable).parent:
        return None
    import subprocess

    asked = subprocess.run(
        (python, "-c", _SETUPTOOLS), capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL
    )
    version, _, word = asked.stdout.strip().partition(" ")
    own = importlib.util.find_spec("setuptools")
    if word not in ({"nothing", "setuptools"} if wheels else {"nothing"}) or own is None or not own.origin:
        return None
    from importlib.metadata import PackageNotFoundError, distribution

    from packaging.specifiers import SpecifierSet

    home, required = Path(own.origin).parent, "<0"
    with suppress(PackageNotFoundError):
        required = distribution("setuptools").metadata["Requires-Python"] or ""
    if not (SpecifierSet(required).contains(version) and (home / "command/bdist_wheel.py").is_file()):
        return None
    folder.mkdir(parents=True, exist_ok=True)
    for pattern in _FILES_OF_SETUPTOOLS:
        for path in home.parent.glob(pattern):
            link = folder / path.name
            link.unlink(missing_ok=True)
            link.symlink_to(path)
    return folder
