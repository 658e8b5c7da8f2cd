"""The locks on build and install folders; processes left running by a killed build are terminated first."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import shlex
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path

from forge.base.env_vars import without_passwords
from forge.base.errors import ForgeError, Problem, WorkspaceError
from forge.base.files import naming
from forge.base.layout import LOCK_FILE
from forge.execution.started import StartedProcesses

_MOST_SHOWN = 100
"""Characters of a command line in a message."""


@contextlib.contextmanager
def lock_build_dir(build: Path, *, wait: bool = True) -> Iterator[float]:
    """Lock a build folder, waiting for another forge if necessary; the lock ends with the process.

    Yields the seconds waited. An interrupt or an internal error terminates all processes started in the
    folder, in any group. Raises WorkspaceError if the folder is locked and `wait` is False, OSError if it is
    not writable.
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
            own = _description(os.getpid(), os.getuid(), time.time(), ("forge", *sys.argv[1:]))
            _write_holder(lock.fileno(), own)
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
            waited = _acquire(descriptor, "install", install, partial(_lock_owner, descriptor), wait=wait)
        yield waited
    finally:
        os.close(descriptor)


def _acquire(descriptor: int, kind: str, folder: Path, read: Callable[[], str], *, wait: bool) -> float:
    """Lock a file; return the seconds waited. `read` returns the description of the lock's owner."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = _holder(read())
        if not wait:
            hint = f"try again later, omit '--no-wait', or choose another '--{kind}-base'"
            message = f"the {kind} folder '{folder}' is locked by {holder}"
            raise WorkspaceError(Problem(message, hint=hint)) from None
        sys.stderr.write(f"waiting for {holder} to release the lock on the {kind} folder '{folder}'\n")
        began = time.monotonic()
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        return time.monotonic() - began
    return 0.0


def _description(pid: int, uid: int, since: float, words: Iterable[str]) -> str:
    """Return the description of a process for others: id, user, start of the command, command line."""
    command = shlex.join(map(without_passwords, words))
    return json.dumps({"pid": pid, "uid": uid, "since": since, "command": command})


def _lock_owner(descriptor: int) -> str:
    """Return the description of the process that has locked a folder, '' if the kernel does not name it."""
    status = os.fstat(descriptor)
    place = f"{os.major(status.st_dev):02x}:{os.minor(status.st_dev):02x}:{status.st_ino}"
    with contextlib.suppress(OSError, ValueError, IndexError):
        locks = [line.split() for line in Path("/proc/locks").read_text(encoding="ascii").splitlines()]
        number = next(int(words[4]) for words in locks if words[1] == "FLOCK" and words[5] == place)
        argv = Path(f"/proc/{number}/cmdline").read_bytes().decode(errors="replace").split("\0")[:-1]
        start = next((at for at, word in enumerate(argv) if Path(word).name == "forge"), -1)
        folder = Path(f"/proc/{number}").stat()
        words = ("forge", *argv[start + 1 :]) if start >= 0 else argv
        return _description(number, folder.st_uid, folder.st_ctime, words)
    return ""


def _holder(description: str) -> str:
    """Return a phrase for the owner of a lock. Any user who can write to the file may have forged it."""
    try:
        told = json.loads(description)
        since = time.localtime(float(told["since"]))
        is_today = time.localtime()[:3] == since[:3]
        shown = time.strftime("%H:%M:%S" if is_today else "%Y-%m-%d %H:%M:%S", since)
        command = "".join(sign if sign.isprintable() else "?" for sign in str(told["command"]))
        command = command if len(command) <= _MOST_SHOWN else f"{command[:_MOST_SHOWN]}..."
        return f"process {int(told['pid'])} ('{command}' of {_user(int(told['uid']))}, since {shown})"
    except (ValueError, LookupError, TypeError, OverflowError):
        return "another process"


def _user(number: int) -> str:
    import pwd

    try:
        return f"user '{pwd.getpwuid(number).pw_name}'"
    except (KeyError, OverflowError):
        return f"user {number}"


def _write_holder(descriptor: int, text: str) -> None:
    os.ftruncate(descriptor, 0)
    os.pwrite(descriptor, text.encode(), 0)
