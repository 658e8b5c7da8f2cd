"""The farm behind icecc: its hosts as the scheduler names them to whoever connects by telnet."""

from __future__ import annotations

import re
import socket
import time
from pathlib import Path
from typing import TYPE_CHECKING

from forge.errors import Problem
from forge.launching.farms import Farm

if TYPE_CHECKING:
    from collections.abc import Mapping

CONFIGURATION = Path("/etc/icecc/icecc.conf")
"""Where Debian's packages keep the name of the scheduler."""

_PORT = 8765
"""Where a scheduler listens; the next port is for people."""
_PATIENCE_SECONDS = 3.0
_NAMED = re.compile(r'^\s*ICECC_SCHEDULER_HOST="?([^"\s#]+)', re.MULTILINE)
# A host that takes no jobs of others listens nowhere: its port is 0.
_NODE = re.compile(r"^ \S+ \((\S+):[1-9]\d*\) \[.*\] .*\bjobs=\d+/(\d+)\b", re.MULTILINE)
_HOW = "name it in ICECC_SCHEDULER, as HOST or HOST:PORT, or say how many jobs there may be: --jobs"


def icecc_farm(
    variables: Mapping[str, str], configuration: Path = CONFIGURATION
) -> tuple[Farm, Problem | None]:
    """Return the farm that icecc would use, and why that is not known, if so."""
    scheduler = variables.get("ICECC_SCHEDULER") or variables.get("USE_SCHEDULER") or _named(configuration)
    if not scheduler:
        message = "nothing names icecc's scheduler, so what its hosts can take adds no jobs"
        return Farm(), Problem(message, hint=_HOW)
    host, _, port = scheduler.partition(":")
    try:
        said, here = _asked(host, (int(port) if port else _PORT) + 1)
    except (OSError, ValueError, OverflowError) as error:
        message = f"icecc's scheduler '{scheduler}' does not say which hosts there are: {error}"
        return Farm(), Problem(message, hint=_HOW)
    return read_nodes(said, here), None


def read_nodes(text: str, here: str) -> Farm:
    """Return the farm in what a scheduler prints; `here` is this machine, counted already."""
    limits = [int(limit) for address, limit in _NODE.findall(text) if address != here and int(limit)]
    return Farm(len(limits), sum(limits))


def _named(configuration: Path) -> str:
    try:
        found = _NAMED.search(configuration.read_text(encoding="utf-8", errors="replace"))
    except OSError:
        return ""
    return found[1] if found else ""


def _asked(host: str, port: int) -> tuple[str, str]:
    """Return what the scheduler prints of its hosts, and the address by which it sees us."""
    end = time.monotonic() + _PATIENCE_SECONDS
    with socket.create_connection((host, port), _PATIENCE_SECONDS) as talk:
        talk.sendall(b"listcs\nquit\n")
        said = b""
        while more := talk.recv(1 << 16):
            said += more
            left = end - time.monotonic()
            if left <= 0:
                raise TimeoutError("timed out")
            talk.settimeout(left)
        return said.decode(errors="replace"), talk.getsockname()[0]
