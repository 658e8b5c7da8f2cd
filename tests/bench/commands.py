"""The command lines that scenarios share: forge's and colcon's."""

import sys
from collections.abc import Mapping
from pathlib import Path

from tests.bench.peers import Peers

QUIET = ("--log-base", "/dev/null")
COLCON = "colcon"
COLCON_NINJA = "colcon, Ninja"
GENERATORS: Mapping[str, tuple[str, ...]] = {COLCON: (), COLCON_NINJA: ("--cmake-args", "-G", "Ninja")}
"""colcon as it comes uses Makefiles; forge takes Ninja unless it is told otherwise."""


def forge(*words: str) -> tuple[str, ...]:
    """Return the forge command beside this interpreter, else of its module, with `words`."""
    script = Path(sys.executable).with_name("forge")
    command = (str(script),) if script.is_file() else (sys.executable, "-m", "forge")
    return (*command, *words)


def forge_build(*words: str) -> tuple[str, ...]:
    """Return the command line of a build without a log."""
    return forge(*QUIET, "build", *words)


def colcon(peers: Peers, *words: str) -> tuple[str, ...]:
    """Return the command line of colcon without a log."""
    return (peers.colcon, *QUIET, *words)


def python(code: str) -> tuple[str, ...]:
    """Return the command line of a program in this interpreter."""
    return (sys.executable, "-c", code)
