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

from forge.errors import ForgeError, Problem, WorkspaceError
from forge.files import naming

if TYPE_CHECKING:
    from collections.abc import Iterator

LOCK = ".forge_lock"
VARIABLE = "FORGE_BUILD_FOLDER"
"""What the programs of a build have in their environment: the folder, by its absolute path."""

_PATIENCE_SECONDS = 5.0
_GENTLE_SECONDS = 1.0
_PROCESSES = Path("/proc")


@contextlib.contextmanager
def occupied(build: Path, *, wait: bool = True) -> Iterator[None]:
    """Hold a build folder, waiting for another forge that does; the lock goes with the process.

    What is left by an interrupt, or by an error of ours, ends what was started there and changed its group.
    Raises WorkspaceError when another one holds it and nobody wants to wait, OSError when the folder cannot
    be written to.
    """
    descriptor = os.open(build / LOCK, os.O_RDWR | os.O_CREAT, 0o666)
    with os.fdopen(descriptor, "r+", encoding="utf-8") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = f"process {lock.read() or '?'}, which builds in '{build}'"
            if not wait:
                hint = "try again later, leave out '--no-wait', or choose another '--build-base'"
                raise WorkspaceError(Problem(f"this is held by {holder}", hint=hint)) from None
            sys.stderr.write(f"waiting for {holder}\n")
            fcntl.flock(lock, fcntl.LOCK_EX)
        lock.seek(0)
        if lock.read():
            end_leftovers(build)
        with naming(build / LOCK):
            _say(lock.fileno(), str(os.getpid()))
        try:
            yield
        except ForgeError:
            raise
        except BaseException:
            end_leftovers(build, gently=True)
            raise
        finally:
            with contextlib.suppress(OSError):
                _say(lock.fileno(), "")


def end_leftovers(build: Path, *, gently: bool = False) -> None:
    """End the programs that were started for a build folder; where /proc is, else nothing.

    `gently` they are asked first, and killed after a while.
    """
    mark = f"{VARIABLE}={build}".encode(errors="surrogateescape")
    begun = time.monotonic()
    asked: set[int] = set()
    while (found := _processes_with(mark)) and time.monotonic() < begun + _PATIENCE_SECONDS:
        for process in found:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                if not gently or time.monotonic() > begun + _GENTLE_SECONDS:
                    os.kill(process, signal.SIGKILL)
                elif process not in asked:
                    asked.add(process)
                    os.kill(process, signal.SIGTERM)
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
