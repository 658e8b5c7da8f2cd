"""Determine the properties of a machine of the cluster, on workers and on the client."""

from __future__ import annotations

import hashlib
import os
import platform
import socket
from pathlib import Path

from forge import __version__
from forge.base.layout import PACKAGE
from forge.build.inputs.fingerprints import source_files
from forge.execution.dask.model import Traits


def traits_of(programs: tuple[tuple[str, str], ...] = ()) -> Traits:
    """Return the properties that must be equal on all machines: forge, Python, and programs by name."""
    version = ".".join(platform.python_version_tuple()[:2])
    return Traits(
        f"{__version__} ({_own_digest()})",
        version,
        tuple((name, _program_identity(path)) for name, path in programs),
    )


def host_name() -> str:
    """Return the host name of this machine."""
    return socket.gethostname()


def shares_file(probe: str, content: str) -> bool:
    """Return True if a file written by the client exists here under the same path."""
    try:
        return Path(probe).read_text(encoding="utf-8") == content
    except (OSError, ValueError):
        return False


def _own_digest() -> str:
    """Return a short digest of forge's own source files."""
    digest = hashlib.sha256()
    for path in source_files(str(PACKAGE), "embedded"):
        if path.endswith(".py"):
            digest.update(os.path.relpath(path, PACKAGE).encode() + Path(path).read_bytes())
    return digest.hexdigest()[:8]


def _program_identity(path: str) -> str:
    try:
        return f"{os.path.realpath(path)} {hashlib.sha256(Path(path).read_bytes()).hexdigest()}"
    except OSError:
        return ""
