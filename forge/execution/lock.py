"""The locks on build and install folders; processes left running by a killed build are terminated first."""

from __future__ import annotations

import contextlib
import fcntl
import os
import sys
import time
from typing import TYPE_CHECKING

from forge.base.errors import ForgeError, Problem, WorkspaceError
from forge.base.files import naming
from forge.base.layout import LOCK_FILE
from forge.execution.started import StartedProcesses

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path


@contextlib.contextmanager
def lock_build_dir(build: Path, *, wait: bool = True) -> Iterator[float]:
    """Lock a build folder, waiting for another forge if necessary; the lock ends with the process.

    Yields the seconds waited. Leaving by an interrupt or an internal error terminates all processes started
    in the folder, in any group.
    Raises WorkspaceError if the folder is locked and `wait` is False, OSError if it is not writable.
    """
    descriptor = os.open(build / LOCK_FILE, os.O_RDWR | os.O_CREAT, 0o666)
    with os.fdopen(descriptor, "r+", encoding="utf-8", errors="replace") as lock:
        waited = _acquire(descriptor, "build", build, lock.read, wait=wait)
        started = StartedProcesses(build)
        lock.seek(0)
        if lock.read():
            started.end()
        started.forget()
        with naming(build / LOCK_FILE):
            _write_holder(lock.fileno(), str(os.getpid()))
        try:
            yield waited
        except ForgeError:
            raise
        except BaseException:
            started.end(gently=True)
            raise
        finally:
            started.forget()
            with contextlib.suppress(OSError):
                _write_holder(lock.fileno(), "")


@contextlib.contextmanager
def lock_install_dir(install: Path, *, wait: bool = True) -> Iterator[float]:
    """Lock an install folder, in which builds with other build folders may install as well.

    Yields the seconds waited. Nothing is written into the folder; some network file systems do not lock it.
    Raises WorkspaceError if the folder is locked and `wait` is False.
    """
    descriptor, waited = os.open(install, os.O_RDONLY | os.O_DIRECTORY), 0.0
    try:
        with contextlib.suppress(OSError):
            waited = _acquire(descriptor, "install", install, str, wait=wait)
        yield waited
    finally:
        os.close(descriptor)


def _acquire(descriptor: int, kind: str, folder: Path, read: Callable[[], str], *, wait: bool) -> float:
    """Lock a file; return the seconds waited. `read` returns the number of the process that has the lock."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = f"process {number}" if (number := read()) else "another process"
        if not wait:
            hint = f"try again later, omit '--no-wait', or choose another '--{kind}-base'"
            message = f"the {kind} folder '{folder}' is locked by {holder}"
            raise WorkspaceError(Problem(message, hint=hint)) from None
        sys.stderr.write(f"waiting for {holder} to release the lock on the {kind} folder '{folder}'\n")
        began = time.monotonic()
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        return time.monotonic() - began
    return 0.0


def _write_holder(descriptor: int, text: str) -> None:
    os.ftruncate(descriptor, 0)
    os.pwrite(descriptor, text.encode(), 0)
