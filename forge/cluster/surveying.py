"""What a machine of the cluster is like; asked of workers, of the scheduler and of the client itself."""

from __future__ import annotations

import os
import platform
import socket
from pathlib import Path

from forge import __version__
from forge.cluster.model import Traits


def traits_of(programs: tuple[tuple[str, str], ...] = ()) -> Traits:
    """Return what is to be the same everywhere: forge, Python, and each program by name and path."""
    version = ".".join(platform.python_version_tuple()[:2])
    return Traits(__version__, version, tuple((name, _said(path)) for name, path in programs))


def host_name() -> str:
    """Return what people call this machine."""
    return socket.gethostname()


def sees(probe: str, content: str) -> bool:
    """Tell if a file that the client wrote is here, too, under the same path."""
    try:
        return Path(probe).read_text(encoding="utf-8") == content
    except (OSError, ValueError):
        return False


def _said(path: str) -> str:
    try:
        return f"{os.path.realpath(path)} {Path(path).stat().st_size}"
    except OSError:
        return ""
