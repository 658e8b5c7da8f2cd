"""What a machine of the cluster is like; asked of workers, of the scheduler and of the client itself."""

from __future__ import annotations

import hashlib
import os
import platform
import socket
from pathlib import Path

from forge import __version__
from forge.cluster.model import Traits
from forge.digests import source_files


def traits_of(programs: tuple[tuple[str, str], ...] = ()) -> Traits:
    """Return what is to be the same everywhere: forge, Python, and each program by name and path."""
    version = ".".join(platform.python_version_tuple()[:2])
    return Traits(
        f"{__version__} ({_own_digest()})", version, tuple((name, _said(path)) for name, path in programs)
    )


def host_name() -> str:
    """Return what people call this machine."""
    return socket.gethostname()


def sees(probe: str, content: str) -> bool:
    """Tell if a file that the client wrote is here, too, under the same path."""
    try:
        return Path(probe).read_text(encoding="utf-8") == content
    except (OSError, ValueError):
        return False


def _own_digest() -> str:
    """Return a few digits that tell this forge from others of its version."""
    whole = hashlib.sha256()
    home = Path(__file__).parents[1]
    for path in source_files(str(home), "embedded"):
        if path.endswith(".py"):
            whole.update(os.path.relpath(path, home).encode() + Path(path).read_bytes())
    return whole.hexdigest()[:8]


def _said(path: str) -> str:
    try:
        return f"{os.path.realpath(path)} {hashlib.sha256(Path(path).read_bytes()).hexdigest()}"
    except OSError:
        return ""
