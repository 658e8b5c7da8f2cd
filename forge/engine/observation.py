"""Read the log of an observed step: the file system accesses of each process.

`observer.c` describes the records, which the processes of a step write through `LD_PRELOAD`.
"""

from __future__ import annotations

import contextlib
import os
import re
import struct
import sys
from bisect import bisect
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

from forge.base.frozen import frozen

LOG_VARIABLE = "FORGE_OBSERVER_LOG"
LINKS_VARIABLE = "FORGE_OBSERVER_LINKS"
STAGE_VARIABLE = "FORGE_OBSERVER_STAGE"
COLOURS_VARIABLE = "FORGE_COLOURS"
"""Compilers colour their messages if it is set, even when writing to a pipe; see observer.c."""
LOG_BYTES = 1 << 30
"""The size of a log, which is a sparse file: the library maps all of it."""

_HEADER, _END = struct.Struct("=QQQQ"), struct.Struct("=Q")
_HEADER_BYTES = 4096
_CHUNK = struct.Struct("=II")
_RECORD = struct.Struct("=IIB")
_NINJA = frozenset({"ninja", "ninja-build", "samu"})


@frozen
class Observation:
    """File system accesses of some processes, as absolute paths.

    `found` are paths that exist but were not opened; `missing` end with the first name that did not exist.
    Files that the processes wrote before reading them are not inputs and appear in `written` only; a renamed
    folder stands for everything in it. `folders` were created, `removed` were removed or renamed, `loaded`
    are shared libraries, `refused` are changes that were not allowed. `variables` were requested by name.
    `ledgers` are the digest and the path of each, see `forge.engine.observed`. `modules` are names that
    Python looked for, each with its folders. `blind` describes what was not observed; if it is empty, nothing
    else was read or written.
    """

    read: frozenset[str] = frozenset()
    found: frozenset[str] = frozenset()
    listed: frozenset[str] = frozenset()
    missing: frozenset[str] = frozenset()
    written: frozenset[str] = frozenset()
    folders: frozenset[str] = frozenset()
    removed: frozenset[str] = frozenset()
    executed: frozenset[str] = frozenset()
    loaded: frozenset[str] = frozenset()
    refused: frozenset[str] = frozenset()
    variables: frozenset[str] = frozenset()
    ledgers: frozenset[str] = frozenset()
    modules: frozenset[tuple[tuple[str, ...], str]] = frozenset()
    blind: tuple[str, ...] = ()


@dataclass(eq=False, slots=True)
class Process:
    """A process and its programs in order; `records` have numbers that order all records of a log."""

    pid: int
    parent: Process | None = None
    programs: list[str] = field(default_factory=list)
    command: str = ""
    """The command line, if the first program is a shell."""
    records: list[tuple[int, str, str]] = field(default_factory=list)
    children: list[Process] = field(default_factory=list)
    starts: list[int] = field(default_factory=list)
    """The number of the next record when each program began."""

    @property
    def is_ninja(self) -> bool:
        """Return True if the last program is ninja."""
        return bool(self.programs) and os.path.basename(self.programs[-1]) in _NINJA

    def program_at(self, number: int) -> str:
        """Return the program that wrote a record; a forked process runs that of its parent."""
        begun = bisect(self.starts, number)
        if not begun and self.parent:
            return self.parent.program_at(number)
        return self.programs[begun - 1] if self.programs else ""

    def above(self) -> Iterator[Process]:
        """Yield the parent, its parent and so on."""
        parent = self.parent
        while parent:
            yield parent
            parent = parent.parent

    def family(self) -> list[Process]:
        """Return the process and all its descendants."""
        processes = [self]
        for process in processes:
            processes += process.children
        return processes


@frozen
class ObservedStep:
    """The processes of a step. `blind` describes known gaps of any process."""

    processes: tuple[Process, ...]
    blind: tuple[str, ...] = ()

    def edges(self) -> tuple[Process, ...]:
        """Return the processes that ninja has started, one for each edge that it ran.

        A ninja started by such a process, for example of an ExternalProject, is part of it.
        """
        return tuple(
            each
            for each in self.processes
            if sum(above.is_ninja for above in each.above()) == 1 and each.parent and each.parent.is_ninja
        )


def begin_log(log: Path) -> None:
    """Create an empty log, which takes no space until records are written.

    If the file system does not support files of this size, nothing is observed.
    """
    log.parent.mkdir(parents=True, exist_ok=True)
    # A server left by a killed build may still map the previous log: truncating that would kill the server.
    log.unlink(missing_ok=True)
    _last_read.pop(log, None)
    with log.open("wb") as file:
        file.write(_HEADER.pack(_HEADER_BYTES, 0, 0, _HEADER_BYTES).ljust(_HEADER_BYTES, b"\0"))
        with contextlib.suppress(OSError):
            file.truncate(LOG_BYTES)


def end_log(log: Path) -> None:
    """Remove a log; processes that outlive the steps no longer write to it."""
    _last_read.pop(log, None)
    with contextlib.suppress(OSError), log.open("r+b") as file:
        file.write(_END.pack(LOG_BYTES))
    log.unlink(missing_ok=True)


ALL_KINDS = "RYTLNWDUVIMEBJ"
KINDS_FOR_TESTS = f"{ALL_KINDS}Kntl"
"""Also devices, sockets, calls that fail, and folders that Python lists to find modules."""
_OF_PATHS = frozenset("RYTLNWDUEntl")


def read_log(
    log: Path, roots: frozenset[int], more_roots: int = 0, *, kinds: str = ALL_KINDS
) -> ObservedStep:
    """Return all processes in a log.

    `roots` are the processes that forge started, and `more_roots` the number of further ones with unknown
    ids. Records of other `kinds` are left out.
    """
    try:
        with log.open("rb") as file:
            header = file.read(_HEADER.size)
            status = os.fstat(file.fileno())
            state = (status.st_ino, status.st_size, header, roots, more_roots, kinds)
            if (last := _last_read.get(log)) and last[0] == state:
                return last[1]
            end, count, lost, _ = _HEADER.unpack(header)
            file.seek(_HEADER_BYTES)
            records = _decoded(file.read(max(0, min(end, LOG_BYTES) - _HEADER_BYTES)))
    except (OSError, struct.error):
        return ObservedStep((), ("there is no log",))
    is_whole = len(records) == count and not lost and end <= LOG_BYTES
    blind = [] if is_whole else ["the log is incomplete"]
    wanted = f"POCXFS{kinds}"
    processes: list[Process] = []
    running: dict[int, Process] = {}
    pending = dict.fromkeys(roots, "the step")
    """Programs that were started and have not loaded the library, by process."""
    spawned: dict[int, Process] = {}
    resolve = _resolver()
    last_kind: dict[int, str] = {}
    for number, pid, kind, word in records:
        if kind not in wanted:
            continue
        process = running.get(pid)
        if process and kind in _OF_PATHS:
            if "/.." in word:
                process.records += _resolved(number, kind, word, resolve)
            else:
                process.records.append((number, kind, word))
            continue
        started = pending.pop(pid, None) if kind == "P" else None
        executes = started is not None
        if process is None or (kind == "P" and not executes) or (kind == "O" and last_kind[pid] != "P"):
            process = running[pid] = Process(pid)
            processes.append(process)
        last_kind[pid] = kind
        match kind:
            case "P":
                spawned.pop(pid, None)
                process.programs.append(word)
                process.starts.append(number)
                if started and started.startswith("/") and os.path.realpath(started) != word:
                    # The kernel has read the interpreter of the script.
                    process.records.append((number, "R", word))
            case "O" if process.parent is None:
                process.parent = running.get(int(word))
                if process.parent:
                    process.parent.children.append(process)
            case "C" if len(process.programs) == 1:
                process.command = word
            case "X":
                pending[pid] = word
            case "F":
                pending.pop(pid, None)
            case "S" if int(word) not in running:
                spawned[int(word)] = process
            case "B" | "V" | "I" | "M" | "J" | "K" if kind in kinds:
                process.records.append((number, kind, word))
            case _ if kind in _OF_PATHS:
                process.records += _resolved(number, kind, word, resolve)
    unknown = [process for process in processes if process.parent is None and process.pid not in roots]
    if sum(bool(process.programs) for process in unknown) < more_roots:
        blind.append("a program cannot be observed")
    unseen = [(running.get(pid), f"'{program}' cannot be observed") for pid, program in pending.items()]
    unseen += [(process, "a program cannot be observed") for process in spawned.values()]
    for each, what in unseen:
        if each is None or (each.parent is None and each.pid not in roots):
            blind.append(what)
        else:
            each.records.append((len(records), "B", what))
    step = ObservedStep(tuple(processes), tuple(blind))
    _last_read[log] = state, step
    return step


_last_read: dict[Path, tuple[tuple[object, ...], ObservedStep]] = {}
"""The parsed contents of existing logs and the state of the files that they were read from.

A build needs them several times.
"""


def _decoded(content: bytes) -> list[tuple[int, int, str, str]]:
    records: list[tuple[int, int, str, str]] = []
    encoding, letters = sys.getfilesystemencoding(), [chr(number) for number in range(256)]
    at = 0
    while at + _CHUNK.size <= len(content):
        length, pid = _CHUNK.unpack_from(content, at)
        if not length:
            at += _HEADER_BYTES  # a process was killed before it used this page
            continue
        limit = min(at + length, len(content))
        at += _CHUNK.size
        while at + _RECORD.size < limit:
            size, order, letter = _RECORD.unpack_from(content, at)
            if not _RECORD.size < size <= limit - at:
                break
            start = at + _RECORD.size
            word = content[start : content.index(0, start)].decode(encoding, "surrogateescape")
            records.append((order, pid, letters[letter], word))
            at += size
        at = limit
    records.sort()
    return records


def observe(processes: Iterable[Process], blind: tuple[str, ...] = ()) -> Observation:
    """Return the combined observations of these processes."""
    processes = tuple(processes)
    words: dict[str, set[str]] = defaultdict(set)
    unknown = dict.fromkeys(blind)
    ledgers: dict[str, str] = {}
    modules: set[tuple[tuple[str, ...], str]] = set()
    for process in processes:
        folders: tuple[str, ...] = ()
        for _, kind, word in process.records:
            if kind == "I":
                folders = tuple(word.split("\n")[:-1])
            elif kind == "M":
                modules.add((folders, word))
            elif kind == "R" and folders and (name := _module(word, folders)):
                # Also modules that importlib and 'python -m' look for, which Python's audit hooks do not
                # report.
                modules.add((folders, name))
    for _, kind, word in sorted(chain.from_iterable(process.records for process in processes)):
        if kind == "B":
            unknown[word] = None
        elif kind == "J":
            ledgers[word.partition(" ")[2]] = word
        elif kind not in "RTL" or word not in words["W"]:
            words[kind].add(word)
    return Observation(
        read=frozenset(words["R"]),
        found=frozenset(words["T"] - words["R"]),
        listed=frozenset(words["L"]),
        missing=frozenset(words["N"]),
        written=frozenset(words["W"]),
        folders=frozenset(words["D"]),
        removed=frozenset(words["U"]),
        executed=frozenset(program for process in processes for program in process.programs),
        loaded=frozenset(words["Y"]),
        refused=frozenset(words["E"]),
        variables=frozenset(words["V"]),
        ledgers=frozenset(ledgers.values()),
        modules=frozenset(modules),
        blind=tuple(unknown),
    )


def _module(path: str, folders: tuple[str, ...]) -> str:
    """Return the module name of a file below one of the folders, '' if it is not a module."""
    match = _MODULE.match(path)
    if match is None:
        return ""
    folder, names = match[1], [] if match[2] == "__init__" else [match[2]]
    while folder not in folders:
        folder, _, name = folder.rpartition("/")
        if not folder or not name.isidentifier():
            return ""
        names.insert(0, name)
    return ".".join(names)


_MODULE = re.compile(r"(.+?)(?:/__pycache__)?/(\w+)(?:\.[\w-]+)?\.(?:py|pyc|so)$")


def _resolved(
    number: int, kind: str, word: str, resolve: Callable[[str], tuple[str, list[str]]]
) -> list[tuple[int, str, str]]:
    path, links = resolve(word)
    return [*((number, "T", link) for link in links), (number, kind, path)]


def _resolver() -> Callable[[str], tuple[str, list[str]]]:
    """Return a function that resolves '..' in paths like the kernel: the folder before it may be a link.

    It also returns the links that the result depends on.
    """
    targets: dict[str, str] = {}
    folders: dict[str, tuple[str, list[str]]] = {}

    def target_of(path: str) -> str:
        if path not in targets:
            try:
                targets[path] = os.readlink(path)
            except OSError:
                targets[path] = ""
        return targets[path]

    def walk(folder: str) -> tuple[str, list[str]]:
        place, links = "", list[str]()
        names = folder.split("/")[::-1]
        while names:
            name = names.pop()
            path = f"{place}/{name}"
            if name == "..":
                place = place.rpartition("/")[0]
            elif name in {"", "."}:
                continue
            elif len(links) < _MAX_LINKS and (target := target_of(path)):
                links.append(path)
                names += target.split("/")[::-1]
                place = "" if target.startswith("/") else place
            else:
                place = path
        return place, links

    def resolve(path: str) -> tuple[str, list[str]]:
        above = _ABOVE.match(path) if "/.." in path else None
        if above is None:
            return path, []
        # The remaining path may be a link whose target changes later.
        folder, rest = above[0], path[above.end() :]
        if folder not in folders:
            folders[folder] = walk(folder)
        place, links = folders[folder]
        return f"{place}{rest}" or "/", links

    return resolve


_ABOVE = re.compile(r".*/\.\.(?=/|$)")
_MAX_LINKS = 40
