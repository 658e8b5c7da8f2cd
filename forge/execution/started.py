"""Record the processes started by a build, so that the next build can terminate those left over by a kill.

A killed forge cannot terminate its child processes, which would continue to write into the build folders. So
each process is recorded by its id and start time, and the next forge terminates the recorded ones. The id is
known only after the start, and forge may be killed in between, so a token is recorded before the start and
passed in the environment of the process. No other process is ever signalled: neither one that merely
inherited the variables of a build, such as a shell that has sourced its `environment.sh`, nor an ancestor of
this forge.
"""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path

from forge.base.frozen import frozen
from forge.base.layout import PROCESSES_FILE

BUILD_FOLDER_VARIABLE = "FORGE_BUILD_FOLDER"
"""An environment variable of the programs of a build: the absolute path of the build folder."""
START_VARIABLE = "FORGE_START"
"""An environment variable of a process that forge starts: the token recorded before the start."""

_ANNOUNCED = "start"
_STARTED = "started"
_TIMEOUT_SECONDS = 5.0
_GENTLE_SECONDS = 1.0
_PROCESSES = Path("/proc")


@frozen
class Process:
    """A process according to /proc; `started` is in clock ticks since boot."""

    number: int
    started: int
    parent: int
    group: int
    session: int
    ended: bool


class StartedProcesses:
    def __init__(self, build: Path) -> None:
        self._build = build
        self._machine = _machine()

    def announce(self) -> str:
        """Record a token that the next process will have as START_VARIABLE, and return it."""
        token = f"{os.getpid()}.{time.monotonic_ns()}"
        self._append(f"{_ANNOUNCED} {token} {self._machine}\n")
        return token

    def note(self, number: int, token: str = "") -> None:
        """Record a process that has been started, perhaps with a token; does nothing without /proc."""
        process = _read_process(number)
        if process is not None and self._machine:
            started = f"{_STARTED} {token} {self._machine}\n" if token else ""
            self._append(self._line(process) + started)

    def note_descendants(self) -> None:
        """Record the descendants of recorded processes, which are unknown once their parents have ended."""
        if living := self._living():
            self._append("".join(map(self._line, living)))

    def end(self, *, gently: bool = False) -> None:
        """Kill all recorded processes and their descendants, and wait a limited time for them to end.

        With `gently`, send SIGTERM first and SIGKILL after a while.
        """
        begun = time.monotonic()
        identities: set[tuple[int, int]] = set()
        terminated: set[tuple[int, int]] = set()
        # Read them each time: the workers of a killed forge also record processes.
        while (living := self._living(identities)) and time.monotonic() < begun + _TIMEOUT_SECONDS:
            identities = {(process.number, process.started) for process in living}
            kill = not gently or time.monotonic() > begun + _GENTLE_SECONDS
            for process in living:
                if kill:
                    _send(process, signal.SIGKILL)
                elif (process.number, process.started) not in terminated:
                    terminated.add((process.number, process.started))
                    _send(process, signal.SIGTERM)
            time.sleep(0.01)

    def forget(self) -> None:
        """Remove the records; processes that still run are left alone."""
        with contextlib.suppress(OSError):
            self._path.unlink()

    @property
    def _path(self) -> Path:
        return self._build / PROCESSES_FILE

    def _line(self, process: Process) -> str:
        return f"{process.number} {process.started} {self._machine}\n"

    def _append(self, lines: str) -> None:
        """Append lines in one write, so that writers do not interleave; ignore errors such as a full disk."""
        with contextlib.suppress(OSError):
            descriptor = os.open(self._path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o600)
            try:
                os.write(descriptor, lines.encode())
            finally:
                os.close(descriptor)

    def _living(self, identities: Collection[tuple[int, int]] = ()) -> list[Process]:
        """Return the living processes that are recorded or in `identities`, and their descendants."""
        recorded, tokens = self._read()
        if not recorded and not tokens:
            return []
        table = _all()
        earlier = (each for each in table.values() if (each.number, each.started) in identities)
        return _with_descendants((*earlier, *_noted(table, recorded, tokens, self._build)), table)

    def _read(self) -> tuple[dict[int, set[int]], set[str]]:
        """Return the records of this machine since it was booted.

        These are the start times of processes by id, and the tokens of processes whose id was not recorded.
        """
        processes: dict[int, set[int]] = {}
        announced, started = set(), set()
        try:
            lines = self._path.read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            lines = []
        for line in lines:
            first, second, machine = (*line.split(" ", 2), "", "", "")[:3]
            if machine != self._machine:
                continue
            if first == _ANNOUNCED:
                announced.add(second)
            elif first == _STARTED:
                started.add(second)
            elif first.isdecimal() and second.isdecimal():
                processes.setdefault(int(first), set()).add(int(second))
        return processes, announced - started


def _machine() -> str:
    """Return an id of the boot and PID namespace in which process ids are valid, or '' without /proc."""
    try:
        boot = (_PROCESSES / "sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        return f"{boot} {(_PROCESSES / 'self/ns/pid').readlink()}"
    except OSError:
        return ""


def _read_process(number: int) -> Process | None:
    try:
        stat_line = (_PROCESSES / str(number) / "stat").read_bytes()
    except OSError:
        return None
    # The program name in parentheses comes first and may contain any character.
    words = stat_line.rpartition(b")")[2].split()
    state, (parent, group, session) = words[0], map(int, words[1:4])
    return Process(number, int(words[19]), parent, group, session, ended=state in {b"Z", b"X"})


def is_running(number: int) -> bool:
    """Return whether a process with this id is running; zombies do not count."""
    process = _read_process(number)
    return process is not None and not process.ended


def _all() -> dict[int, Process]:
    numbers = (int(name) for name in os.listdir(_PROCESSES) if name.isdecimal())  # noqa: PTH208  (names alone)
    return {number: process for number in numbers if (process := _read_process(number))}


def _noted(
    table: Mapping[int, Process], recorded: Mapping[int, set[int]], tokens: Iterable[str], build: Path
) -> Iterator[Process]:
    """Yield the recorded processes, and those in groups and sessions that these lead or led."""
    mark = f"{BUILD_FOLDER_VARIABLE}={build}".encode(errors="surrogateescape")
    starts = {f"{START_VARIABLE}={token}".encode() for token in tokens}
    for process in table.values():
        if starts and not starts.isdisjoint(_variables(process)):
            yield process
            continue
        for number in {process.number, process.group, process.session} & recorded.keys():
            begun = recorded[number]
            if (leader := table.get(number)) is not None:
                is_noted = leader.started in begun
            else:
                # The leader has ended. Its id is not reused while the group has members, but these may belong
                # to a newer group with a reused id. So the process must also have the build folder in its
                # environment.
                is_noted = process.started >= min(begun) and mark in _variables(process)
            if is_noted:
                yield process
                break


def _variables(process: Process) -> list[bytes]:
    with contextlib.suppress(OSError):
        return (_PROCESSES / str(process.number) / "environ").read_bytes().split(b"\0")
    return []


def _with_descendants(processes: Iterable[Process], table: Mapping[int, Process]) -> list[Process]:
    """Return the living processes and their descendants, without this process and its ancestors."""
    protected = {os.getpid()}
    process = table.get(os.getpid())
    while process is not None and process.parent not in protected:
        protected.add(process.parent)
        process = table.get(process.parent)
    children: dict[int, list[Process]] = {}
    for process in table.values():
        children.setdefault(process.parent, []).append(process)
    by_number: dict[int, Process] = {}
    waiting = list(processes)
    while waiting:
        process = waiting.pop()
        if process.number not in by_number and process.number not in protected:
            by_number[process.number] = process
            waiting += children.get(process.number, ())
    return [process for process in by_number.values() if not process.ended]


def _send(process: Process, number: signal.Signals) -> None:
    """Send a signal to this process, but not to another one that reuses its id."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        try:
            descriptor = os.pidfd_open(process.number)
        except (AttributeError, OSError):
            descriptor = None
        try:
            now = _read_process(process.number)
            if now is None or now.started != process.started:
                return
            if descriptor is None:
                os.kill(process.number, number)
            else:
                signal.pidfd_send_signal(descriptor, number)
        finally:
            if descriptor is not None:
                os.close(descriptor)
