"""The tools that forge is measured beside: where each is, in which version, or how to get it."""

import re
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

CHECKOUT = Path(__file__).parents[2]
ENVIRONMENT = CHECKOUT / ".venv-peers"
"""A virtual environment of their own, which `make peers` makes."""

DEBIAN = CHECKOUT / ".debian-peers" / "usr"
"""Debian's packages, unpacked by `make debian-peers` and not installed: in /usr they would be an underlay."""

FROM_PYPI = ("colcon-common-extensions", "rosbags", "mcap-ros2-support")
_FROM_DEBIAN = {"rosidl": "share/rosidl_generator_cpp", "ament": "share/ament_cmake"}
_FAST_CDR = "include/fastcdr/Cdr.h"
_INSTALLED = Path("/usr")
_REMEDIES = {
    **dict.fromkeys(FROM_PYPI, "make peers"),
    **dict.fromkeys(_FROM_DEBIAN, "make debian-peers (needs apt-get and dpkg)"),
    "Fast-CDR": "make debian-peers, or apt-get install libfastcdr-dev",
    "ccache": "apt-get install ccache",
    "ninja": "pip install ninja",
    "make": "apt-get install make",
}
_ASK = """
import sys
from importlib import metadata
for name in sys.argv[1:]:
    try:
        print(name, metadata.version(name))
    except metadata.PackageNotFoundError:
        pass
"""
_DIGITS = re.compile(r"\d+(?:\.\d+)+")


@dataclass(frozen=True, slots=True)
class Peers:
    """What was found: versions by name, and the places of those that have one."""

    versions: Mapping[str, str]
    environment: Path
    debian: Path
    """The prefix of Debian's ament and rosidl."""
    fast_cdr: Path
    """The prefix of Fast-CDR, which may be installed, too."""

    def has(self, name: str) -> bool:
        """Tell if a peer is there."""
        return name in self.versions

    @property
    def colcon(self) -> str:
        """Return the program."""
        return str(self.environment / "bin" / "colcon")

    @property
    def python(self) -> str:
        """Return the interpreter that has the peers of Python."""
        return str(self.environment / "bin" / "python")

    def told(self) -> dict[str, str]:
        """Return each peer's version, or that it is missing and how to get it."""
        return {name: self.versions.get(name, f"missing: {remedy}") for name, remedy in _REMEDIES.items()}


def find_peers(environment: Path = ENVIRONMENT, debian: Path = DEBIAN) -> Peers:
    """Look for all peers."""
    fast_cdr = next((root for root in (debian, _INSTALLED) if (root / _FAST_CDR).is_file()), None)
    versions = {
        **_from_pypi(environment),
        **{
            name: _version_of(debian / path)
            for name, path in _FROM_DEBIAN.items()
            if (debian / path).is_dir()
        },
        **({"Fast-CDR": _fast_cdr_version(fast_cdr)} if fast_cdr else {}),
        **{tool: _said(tool) for tool in ("ccache", "ninja", "make") if shutil.which(tool)},
    }
    return Peers(versions, environment, debian, fast_cdr or _INSTALLED)


def _from_pypi(environment: Path) -> dict[str, str]:
    python = environment / "bin" / "python"
    if not python.exists():
        return {}
    asked = subprocess.run([python, "-c", _ASK, *FROM_PYPI], check=True, capture_output=True, text=True)
    return dict(line.split() for line in asked.stdout.splitlines())


def _version_of(share: Path) -> str:
    """Return the version that the package.xml of a ROS package says."""
    found = re.search(r"<version>([^<]+)</version>", (share / "package.xml").read_text(encoding="utf-8"))
    return found[1].strip() if found else "of unknown version"


def _fast_cdr_version(prefix: Path) -> str:
    """Return the version that its library's file name says."""
    libraries = sorted((prefix / "lib").rglob("libfastcdr.so.*.*"))
    return libraries[-1].name.partition(".so.")[2] if libraries else "of unknown version"


def _said(tool: str) -> str:
    """Return the version that a program says."""
    said = subprocess.run([tool, "--version"], check=True, capture_output=True, text=True).stdout
    found = _DIGITS.search(said)
    return found[0] if found else said.partition("\n")[0]
