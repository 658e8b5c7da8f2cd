"""Determines which system and Python packages are installed."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection

DPKG_STATUS = Path("/var/lib/dpkg/status")

_PARAGRAPH = re.compile(r"^(Package|Status|Provides): (.*)$", re.MULTILINE)
_PIP = r"""import importlib.metadata as m, re, sys
have = {re.sub("[-_.]+", "-", d.metadata["Name"] or "").lower() for d in m.distributions()}
plain = lambda name: re.sub("[-_.]+", "-", re.split("[<>=!~ ]", name)[0]).lower()
print(*(name for name in sys.argv[1:] if plain(name) in have), sep="\n")
"""


def installed_names(manager: str, names: Collection[str], python: str) -> frozenset[str]:
    """Return the names that are installed according to a package manager; empty if it is unknown."""
    if manager == "apt":
        return frozenset(names) & _in_dpkg(DPKG_STATUS)
    if manager == "dnf" and shutil.which("rpm"):
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
    try:
        text = status.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return frozenset()
    found: set[str] = set()
    for paragraph in text.split("\n\n"):
        fields = dict(_PARAGRAPH.findall(paragraph))
        if fields.get("Status", "").endswith(" installed"):
            provided = (word.split()[0] for word in fields.get("Provides", "").split(",") if word.strip())
            found.update((fields["Package"], *provided))
    return frozenset(found)


def _succeeds(*argv: str) -> bool:
    return not subprocess.run(argv, capture_output=True, check=False, stdin=subprocess.DEVNULL).returncode
