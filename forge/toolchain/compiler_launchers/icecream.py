"""Queries the farm of icecc from its scheduler's telnet interface."""

from __future__ import annotations

import re
import socket
import time
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.errors import Problem
from forge.toolchain.compiler_launchers.farms import HostPool

if TYPE_CHECKING:
    from collections.abc import Mapping

CONFIGURATION = Path("/etc/icecc/icecc.conf")
"""Debian's configuration file with the name of the scheduler."""

_PORT = 8765
"""The scheduler's default port; the telnet interface uses the next one."""
_PATIENCE_SECONDS = 3.0
_NAMED = re.compile(r'^\s*ICECC_SCHEDULER_HOST="?([^"\s#]+)', re.MULTILINE)
# A host that accepts no remote jobs has port 0.
_NODE = re.compile(r"^ \S+ \((\S+):[1-9]\d*\) \[.*\] .*\bjobs=\d+/(\d+)\b", re.MULTILINE)
_HOW = "set ICECC_SCHEDULER to HOST or HOST:PORT, or set the number of jobs with --jobs"


def icecc_farm(
    variables: Mapping[str, str], configuration: Path = CONFIGURATION
) -> tuple[HostPool, Problem | None]:
    """Return the farm that icecc would use, and a problem if it is unknown."""
    scheduler = variables.get("ICECC_SCHEDULER") or variables.get("USE_SCHEDULER") or _named(configuration)
    if not scheduler:
        message = "unknown icecc scheduler: the number of jobs does not include its hosts"
        return HostPool(), Problem(message, hint=_HOW)
    host, _, port = scheduler.partition(":")
    try:
        output, here = _asked(host, (int(port) if port else _PORT) + 1)
    except (OSError, ValueError, OverflowError) as error:
        message = f"cannot query the hosts of icecc's scheduler '{scheduler}': {error}"
        return HostPool(), Problem(message, hint=_HOW)
    return read_nodes(output, here), None


def read_nodes(text: str, here: str) -> HostPool:
    """Parse the scheduler's list of hosts; `here` is the address of this machine, which is excluded."""
    limits = [int(limit) for address, limit in _NODE.findall(text) if address != here and int(limit)]
    return HostPool(len(limits), sum(limits))


def _named(configuration: Path) -> str:
    try:
        found = _NAMED.search(configuration.read_text(encoding="utf-8", errors="replace"))
    except OSError:
        return ""
    return found[1] if found else ""


def _asked(host: str, port: int) -> tuple[str, str]:
    """Return the scheduler's list of hosts, and our address as seen by the scheduler."""
    end = time.monotonic() + _PATIENCE_SECONDS
    with socket.create_connection((host, port), _PATIENCE_SECONDS) as talk:
        talk.sendall(b"listcs\nquit\n")
        output = b""
        while more := talk.recv(1 << 16):
            output += more
            left = end - time.monotonic()
            if left <= 0:
                raise TimeoutError("timed out")
            talk.settimeout(left)
        return output.decode(errors="replace"), talk.getsockname()[0]
