"""What the measurements were made on, and with which versions."""

import os
import platform
import re
import shutil
import subprocess
from importlib.metadata import version
from pathlib import Path

from forge import __version__

_CHECKOUT = Path(__file__).parents[2]
_TOOLS = ("cmake", "g++")


def described() -> dict[str, str]:
    """Return the facts that a reader of figures asks for."""
    return {
        "processor": _processor(),
        "processors": str(len(os.sched_getaffinity(0))),
        "memory": _memory(),
        "system": f"{_distribution()}, Linux {platform.release().partition('-')[0]}",
        "Python": platform.python_version(),
        "numpy": version("numpy"),
        **{tool: _first_line(tool) for tool in _TOOLS if shutil.which(tool)},
        "forge": f"{__version__}, {_commit()}",
    }


def _processor() -> str:
    names = re.findall(
        r"^model name\s*:\s*(.+)$", Path("/proc/cpuinfo").read_text(encoding="utf-8"), re.MULTILINE
    )
    return names[0] if names else platform.machine()


def _memory() -> str:
    found = re.search(r"^MemTotal:\s*(\d+)", Path("/proc/meminfo").read_text(encoding="utf-8"), re.MULTILINE)
    return f"{int(found[1]) / 1e6:.0f} GB" if found else "unknown"


def _distribution() -> str:
    try:
        return platform.freedesktop_os_release()["PRETTY_NAME"]
    except OSError:
        return platform.system()


def _first_line(tool: str) -> str:
    said = subprocess.run([tool, "--version"], check=True, capture_output=True, text=True).stdout
    return said.partition("\n")[0]


def _commit() -> str:
    """Return the commit of this checkout, and whether it was changed since."""
    try:
        asked = subprocess.run(
            ["git", "describe", "--always", "--dirty", "--exclude=*"],
            cwd=_CHECKOUT, check=True, capture_output=True, text=True,
        )  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return "of unknown commit"
    return f"commit {asked.stdout.strip()}"
