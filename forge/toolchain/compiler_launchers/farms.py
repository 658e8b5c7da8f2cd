"""The farms of distcc and icecc: the number of remote hosts and their job slots."""

from __future__ import annotations

import re
import subprocess
from typing import TYPE_CHECKING

from forge.base.errors import Problem
from forge.base.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

_PATIENCE_SECONDS = 10
_USUAL_LIMIT = 4
"""distcc's default number of jobs per host."""
_HERE = re.compile(r"localhost(/\d+)?$")
_LIMIT = re.compile(r"/(\d+)")


@frozen
class HostPool:
    """Remote machines that compile for this one, and their total job slots."""

    hosts: int = 0
    slots: int = 0


def distcc_farm(program: Path, variables: Mapping[str, str]) -> tuple[HostPool, Problem | None]:
    """Return the farm that distcc would use, and a problem if there is one.

    Runs distcc itself, which respects its configuration files, variables and zeroconf.
    """
    try:
        asked = subprocess.run(
            [program, "--show-hosts"],
            env=dict(variables),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_PATIENCE_SECONDS,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return HostPool(), Problem(f"cannot determine the hosts of distcc: {error}", hint=_HOW)
    host_pool = read_hosts(asked.stdout.decode(errors="replace"))
    if not host_pool.hosts:
        return host_pool, Problem(
            "distcc has no remote hosts, so that all compilations run on this machine", hint=_HOW
        )
    return host_pool, None


_HOW = "list hosts in DISTCC_HOSTS or ~/.distcc/hosts; `distcc --show-hosts` shows the result"


def read_hosts(text: str) -> HostPool:
    """Parse distcc's list of hosts, one entry per line.

    The word localhost stands for this machine, whose processors are counted elsewhere; 127.0.0.1 is a remote
    host.
    """
    limits = [_limit(entry) for entry in text.split() if not _HERE.match(entry) and not _is_option(entry)]
    return HostPool(len(limits), sum(limits))


def _is_option(entry: str) -> bool:
    return entry.startswith(("--", "+"))


def _limit(entry: str) -> int:
    """Return the limit in HOST[:PORT][/LIMIT], HOST[/LIMIT][:PORT] or [USER]@HOST[/LIMIT][:COMMAND]."""
    address = entry.partition(",")[0]
    if "@" in address:
        address = re.sub(r"(\[[^]]*\]|[^]:]*):.*", r"\1", address)
    found = _LIMIT.search(address)
    return int(found[1]) if found else _USUAL_LIMIT
