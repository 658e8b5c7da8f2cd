"""The operating system as rosdep names it, and its installed packages."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.files import text_or_nothing
from forge.base.frozen import frozen
from forge.toolchain.os_release import DEBIAN, RED_HAT, families

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

DPKG_STATUS = Path("/var/lib/dpkg/status")

_OTHER_FAMILIES = ("alpine", "arch", "gentoo", "opensuse")
"""Names in rosdep's files that stand for derived systems, too."""

_PARAGRAPH = re.compile(r"^(Package|Status|Provides): (.*)$", re.MULTILINE)
_PIP = r"""import importlib.metadata as m, re, sys
have = {re.sub("[-_.]+", "-", d.metadata["Name"] or "").lower() for d in m.distributions()}
plain = lambda name: re.sub("[-_.]+", "-", re.split("[<>=!~ ]", name)[0]).lower()
print(*(name for name in sys.argv[1:] if plain(name) in have), sep="\n")
"""


@frozen
class System:
    """An operating system: its name and version as in rosdep's files.

    `manager` is the package manager that ROS distributions publish packages for, empty if there is none.
    """

    name: str
    version: str
    manager: str


def system_of(fields: Mapping[str, str], asked: str | None = None) -> System:
    """Return the system described by /etc/os-release, or NAME:VERSION if given."""
    name, version = fields.get("ID", "linux").lower(), fields.get("VERSION_ID", "")
    kin = families(fields)
    if asked:
        name, _, version = asked.lower().partition(":")
        kin = (name,)
    elif not DEBIAN.isdisjoint(kin):
        codename = fields.get("UBUNTU_CODENAME") or fields.get("VERSION_CODENAME")
        version = codename or version
        # rosdep's files use codenames for versions of Ubuntu and Debian.
        name = name if name in {"debian", "ubuntu"} else "ubuntu" if "UBUNTU_CODENAME" in fields else "debian"
    elif not RED_HAT.isdisjoint(kin) and name not in {"fedora", "openeuler"}:
        name, version = "rhel", version.partition(".")[0]
    else:
        name = next((family for family in _OTHER_FAMILIES if family in kin), name)
    manager = "apt" if not DEBIAN.isdisjoint(kin) else "dnf" if not RED_HAT.isdisjoint(kin) else ""
    return System(name, version, manager)


def installed_names(manager: str, names: Collection[str], python: str) -> frozenset[str]:
    """Return the names that are installed according to a package manager; empty if it is unknown."""
    if manager == "apt":
        return frozenset(names) & _in_dpkg(DPKG_STATUS)
    if manager in {"dnf", "zypper"} and shutil.which("rpm"):
        return frozenset(name for name in names if _succeeds("rpm", "-q", "--whatprovides", name))
    if manager == "pip":
        asked = subprocess.run(
            (python, "-c", _PIP, *names),
            capture_output=True,
            text=True,
            check=False,
            stdin=subprocess.DEVNULL,
        )
        return frozenset(asked.stdout.splitlines()) & frozenset(names)
    return frozenset()


def _in_dpkg(status: Path) -> frozenset[str]:
    """Return the packages installed with dpkg, and what they provide."""
    found: set[str] = set()
    for paragraph in text_or_nothing(status).split("\n\n"):
        fields = dict(_PARAGRAPH.findall(paragraph))
        if fields.get("Status", "").endswith(" installed"):
            provided = (word.split()[0] for word in fields.get("Provides", "").split(",") if word.strip())
            found.update((fields["Package"], *provided))
    return frozenset(found)


def _succeeds(*argv: str) -> bool:
    return not subprocess.run(argv, capture_output=True, check=False, stdin=subprocess.DEVNULL).returncode
