"""Provides forge's setuptools to interpreters without one, or without one that can build wheels.

Examples are fresh virtual environments, and Ubuntu's Python without python3-wheel.
"""

from __future__ import annotations

import subprocess
import sys
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path

_PROBE = """import importlib.util, os, sys
sys.path = [entry for entry in sys.path if entry]
home, other = (
    os.path.dirname(found.origin) if (found := importlib.util.find_spec(name)) and found.origin else ""
    for name in ("setuptools", "wheel")
)
able = home and (other or os.path.exists(home + "/command/bdist_wheel.py"))
print("%d.%d.%d" % sys.version_info[:3], "wheels" if able else "setuptools" if home else "nothing")
"""
_NEEDED = ("setuptools", "pkg_resources", "_distutils_hack", "setuptools-*.dist-info")


def setuptools_path(python: str, folder: Path, *, wheels: bool) -> Path | None:
    """Return a PYTHONPATH folder with forge's setuptools; None if it is not needed or not compatible.

    It is needed by an interpreter without setuptools, or for `wheels` without one that builds them.
    """
    if Path(python).parent == Path(sys.executable).parent:
        return None
    asked = subprocess.run(
        (python, "-c", _PROBE), capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL
    )
    version, _, word = asked.stdout.strip().partition(" ")
    own = find_spec("setuptools")
    if word not in ({"nothing", "setuptools"} if wheels else {"nothing"}) or own is None or not own.origin:
        return None
    home, required = Path(own.origin).parent, "<0"
    with suppress(PackageNotFoundError):
        required = distribution("setuptools").metadata["Requires-Python"] or ""
    from packaging.specifiers import SpecifierSet

    if not (SpecifierSet(required).contains(version) and (home / "command/bdist_wheel.py").is_file()):
        return None
    folder.mkdir(parents=True, exist_ok=True)
    for pattern in _NEEDED:
        for path in home.parent.glob(pattern):
            link = folder / path.name
            link.unlink(missing_ok=True)
            link.symlink_to(path)
    return folder
