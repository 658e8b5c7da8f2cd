"""The processes that a build starts: noted in its folder while it runs, so that none outlives it unnoticed.

A forge that is killed cannot end what it started, and that would go on writing into the folders of the next
build. So each process is noted by its id and its start time, and the next forge ends what is noted. Nothing
else is ever signalled: neither what merely has the variables of a build, as a shell does that has sourced
its `environment.sh`, nor the processes from which this forge descends.
"""

from __future__ import annotations

import contextlib
import os
import signal
import time
from pathlib import Path
from typing import TYPE_CHECKING

from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

NOTES = ".forge_processes"
VARIABLE = "FORGE_BUILD_FOLDER"
"""What the programs of a build have in their environment: the folder, by its absolute path."""

_PATIENCE_SECONDS = 5.0
_GENTLE_SECONDS = 1.0
_PROCESSES = Path("/proc")


@frozen
class Process:
    """A process as /proc shows it; `started` is in clock ticks since the system's start."""

    number: int
    started: int
    parent: int
    group: int
    session: int
    ended: bool


class StartedProcesses:
    """The notes of one build folder."""

    def __init__(self, build: Path) -> None:
        """Remember the folder; the file is made with the first note."""
        self._build = build
        self._machine = _machine()

    def note(self, number: int) -> None:
        """Note a process that has just been started, and is no other's to wait for; nothing without /proc."""
        process = _look(number)
        if process is not None and self._machine:
            self._write([process])

    def note_descendants(self) -> None:
        """Note what descends from noted processes: once its parents have ended, nobody could tell."""
        noted = self._read()
        if noted:
            table = _all()
            self._write(_with_descendants(_noted_ones(table, noted, self._build), table))

    def end(self, *, gently: bool = False) -> None:
        """End all noted processes and what descends from them, and wait for that, but not for ever.

        `gently` they are asked first, and killed after a while.
        """
        noted = self._read()
        if not noted:
            return
        begun = time.monotonic()
        found: set[tuple[int, int]] = set()
        asked: set[tuple[int, int]] = set()
        while time.monotonic() < begun + _PATIENCE_SECONDS:
            table = _all()
            known = [process for process in table.values() if (process.number, process.started) in found]
            living = _with_descendants((*known, *_noted_ones(table, noted, self._build)), table)
            if not living:
                return
            found = {(process.number, process.started) for process in living}
            kill = not gently or time.monotonic() > begun + _GENTLE_SECONDS
            for process in living:
                if kill:
                    _send(process, signal.SIGKILL)
                elif (process.number, process.started) not in asked:
                    asked.add((process.number, process.started))
                    _send(process, signal.SIGTERM)
            time.sleep(0.01)

    def forget(self) -> None:
        """Remove the notes: what is left running may stay."""
        with contextlib.suppress(OSError):
            self._path.unlink()

    @property
    def _path(self) -> Path:
        return self._build / NOTES

    def _write(self, processes: Iterable[Process]) -> None:
        """Add lines in one write, so that several writers do not mix; a full disk is no reason to stop."""
        lines = "".join(f"{process.number} {process.started} {self._machine}\n" for process in processes)
        with contextlib.suppress(OSError):
            descriptor = os.open(self._path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o600)
            try:
                os.write(descriptor, lines.encode())
            finally:
                os.close(descriptor)

    def _read(self) -> dict[int, set[int]]:
        """Return the start times of the processes that were noted on this machine, by their ids."""
        noted: dict[int, set[int]] = {}
        try:
            lines = self._path.read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            return noted
        for line in lines:
            number, started, machine = (*line.split(" ", 2), "", "", "")[:3]
            if machine == self._machine and number.isdecimal() and started.isdecimal():
                noted.setdefault(int(number), set()).add(int(started))
        return noted


def _machine() -> str:
    """Return where ids of processes hold: in this container, until the system restarts; '' without /proc."""
    try:
        boot = (_PROCESSES / "sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        return f"{boot} {(_PROCESSES / 'self/ns/pid').readlink()}"
    except OSError:
        return ""


def _look(number: int) -> Process | None:
    """Return a process by its id, None when there is none."""
    try:
        said = (_PROCESSES / str(number) / "stat").read_bytes()
    except OSError:
        return None
    # The name of the program comes first, in parentheses, and may have any sign in it.
    words = said.rpartition(b")")[2].split()
    state, (parent, group, session) = words[0], map(int, words[1:4])
    return Process(number, int(words[19]), parent, group, session, ended=state in {b"Z", b"X"})


def _all() -> dict[int, Process]:
    """Return all processes by their ids."""
    numbers = (int(name) for name in os.listdir(_PROCESSES) if name.isdecimal())  # noqa: PTH208  (names alone)
    return {number: process for number in numbers if (process := _look(number))}


def _noted_ones(
    table: Mapping[int, Process], noted: Mapping[int, set[int]], build: Path
) -> tuple[Process, ...]:
    """Return the noted processes, and those in the groups and sessions that these lead or led."""
    return tuple(process for process in table.values() if _is_noted(process, table, noted, build))


def _is_noted(
    process: Process, table: Mapping[int, Process], noted: Mapping[int, set[int]], build: Path
) -> bool:
    for number in {process.number, process.group, process.session} & noted.keys():
        leader = table.get(number)
        if leader is not None:
            if leader.started in noted[number]:
                return True
        # The leader has ended. Its id is not used again while it has members, but all of those may have ended
        # and these belong to another one. So they must have been told the folder as well.
        elif process.started >= min(noted[number]) and _was_told(process, build):
            return True
    return False


def _was_told(process: Process, build: Path) -> bool:
    """Tell if a process has the folder of the build in its environment."""
    mark = f"{VARIABLE}={build}".encode(errors="surrogateescape")
    try:
        return mark in (_PROCESSES / str(process.number) / "environ").read_bytes().split(b"\0")
    except OSError:
        return False


def _with_descendants(processes: Iterable[Process], table: Mapping[int, Process]) -> list[Process]:
    """Return the processes that still run, and all that descend from these; never our own line."""
    spared = _own_line(table)
    children: dict[int, list[Process]] = {}
    for process in table.values():
        children.setdefault(process.parent, []).append(process)
    found: dict[int, Process] = {}
    waiting = list(processes)
    while waiting:
        process = waiting.pop()
        if process.number not in found and process.number not in spared:
            found[process.number] = process
            waiting += children.get(process.number, ())
    return [process for process in found.values() if not process.ended]


def _own_line(table: Mapping[int, Process]) -> set[int]:
    """Return this process and those from which it descends."""
    line = {os.getpid()}
    process = table.get(os.getpid())
    while process is not None and process.parent not in line:
        line.add(process.parent)
        process = table.get(process.parent)
    return line


def _send(process: Process, number: signal.Signals) -> None:
    """Send a signal to just this process: not to another one that has got its id meanwhile."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        try:
            descriptor = os.pidfd_open(process.number)
        except (AttributeError, OSError):
            descriptor = None
        try:
            now = _look(process.number)
            if now is None or now.started != process.started:
                return
            if descriptor is None:
                os.kill(process.number, number)
            else:
                signal.pidfd_send_signal(descriptor, number)
        finally:
            if descriptor is not None:
                os.close(descriptor)
