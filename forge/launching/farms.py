"""The farms behind distcc and icecc: how many hosts there are besides this one, and jobs that they take."""

from __future__ import annotations

import re
import subprocess
from typing import TYPE_CHECKING

from forge.errors import Problem
from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

_PATIENCE_SECONDS = 10
_USUAL_LIMIT = 4
"""How many jobs distcc gives a host whose entry does not say it."""
_HERE = re.compile(r"localhost(/\d+)?$")
_LIMIT = re.compile(r"/(\d+)")


@frozen
class Farm:
    """Machines that compile for this one, and how many jobs they take together."""

    hosts: int = 0
    slots: int = 0


def distcc_farm(program: Path, variables: Mapping[str, str]) -> tuple[Farm, Problem | None]:
    """Return the farm that distcc would use, and what is wrong with it, if anything is.

    distcc itself is asked: so its files and variables count in its order, and what it finds by zeroconf.
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
        return Farm(), Problem(f"distcc does not say which hosts it has: {error}", hint=_HOW)
    farm = read_hosts(asked.stdout.decode(errors="replace"))
    if not farm.hosts:
        return farm, Problem("distcc knows no host besides this one, so all is compiled here", hint=_HOW)
    return farm, None


_HOW = "name hosts in DISTCC_HOSTS or ~/.distcc/hosts; `distcc --show-hosts` shows what distcc makes of them"


def read_hosts(text: str) -> Farm:
    """Return the farm that a list of distcc's hosts means, one entry a line.

    The word localhost is this machine itself, whose processors are counted elsewhere; 127.0.0.1 is a host.
    """
    limits = [_limit(entry) for entry in text.split() if not _HERE.match(entry) and not _is_option(entry)]
    return Farm(len(limits), sum(limits))


def _is_option(entry: str) -> bool:
    return entry.startswith(("--", "+"))


def _limit(entry: str) -> int:
    """Return the limit in HOST[:PORT][/LIMIT], HOST[/LIMIT][:PORT] or [USER]@HOST[/LIMIT][:COMMAND]."""
    place = entry.partition(",")[0]
    if "@" in place:
        place = re.sub(r"(\[[^]]*\]|[^]:]*):.*", r"\1", place)
    found = _LIMIT.search(place)
    return int(found[1]) if found else _USUAL_LIMIT
