"""One build at a time in a build folder; what a killed one left running is ended first."""

from __future__ import annotations

import contextlib
import fcntl
import os
import sys
from typing import TYPE_CHECKING

from forge.errors import ForgeError, Problem, WorkspaceError
from forge.files import naming
from forge.started import StartedProcesses

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

LOCK = ".forge_lock"


@contextlib.contextmanager
def occupied(build: Path, *, wait: bool = True) -> Iterator[None]:
    """Hold a build folder, waiting for another forge that does; the lock goes with the process.

    What is left by an interrupt, or by an error of ours, ends what was started there, in whatever group.
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
        started = StartedProcesses(build)
        lock.seek(0)
        if lock.read():
            started.end()
        started.forget()
        with naming(build / LOCK):
            _say(lock.fileno(), str(os.getpid()))
        try:
            yield
        except ForgeError:
            raise
        except BaseException:
            started.end(gently=True)
            raise
        finally:
            started.forget()
            with contextlib.suppress(OSError):
                _say(lock.fileno(), "")


def _say(descriptor: int, text: str) -> None:
    os.ftruncate(descriptor, 0)
    os.pwrite(descriptor, text.encode(), 0)
