"""One build at a time in a build folder; what a killed one left running is ended first.

A forge that is killed cannot end the programs that it started: they would go on writing into the folders
of the next build. They carry the folder's path in their environment, by which they are found.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import signal
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

LOCK = ".forge_lock"
VARIABLE = "FORGE_BUILD_FOLDER"
"""What the programs of a build have in their environment: the folder, by its absolute path."""

_PATIENCE_SECONDS = 5.0
_PROCESSES = Path("/proc")


@contextlib.contextmanager
def occupied(build: Path) -> Iterator[None]:
    """Hold a build folder, waiting for another forge that does; the lock goes with the process.

    Raises OSError when the folder cannot be written to.
    """
    descriptor = os.open(build / LOCK, os.O_RDWR | os.O_CREAT, 0o666)
    with os.fdopen(descriptor, "r+", encoding="utf-8") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            sys.stderr.write(f"waiting for process {lock.read() or '?'}, which builds in '{build}'\n")
            fcntl.flock(lock, fcntl.LOCK_EX)
        lock.seek(0)
        if lock.read():
            end_leftovers(build)
        _say(lock.fileno(), str(os.getpid()))
        try:
            yield
        finally:
            _say(lock.fileno(), "")


def end_leftovers(build: Path) -> None:
    """End the programs that an earlier forge started for a build folder; where /proc is, else nothing."""
    mark = f"{VARIABLE}={build}".encode(errors="surrogateescape")
    deadline = time.monotonic() + _PATIENCE_SECONDS
    while (found := _processes_with(mark)) and time.monotonic() < deadline:
        for process in found:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.kill(process, signal.SIGKILL)
        time.sleep(0.01)


def _processes_with(mark: bytes) -> list[int]:
    """Return the other processes that have an environment with this entry; ended ones have none."""
    found = []
    for path in _PROCESSES.glob("[0-9]*/environ"):
        with contextlib.suppress(OSError):
            if mark in path.read_bytes().split(b"\0") and path.parent.name != str(os.getpid()):
                found.append(int(path.parent.name))
    return found


def _say(descriptor: int, text: str) -> None:
    os.ftruncate(descriptor, 0)
    os.pwrite(descriptor, text.encode(), 0)
