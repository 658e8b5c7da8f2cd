"""What the programs of a step did with files, by the output of `strace -f -y`; pure.

A line is one system call: process, name, arguments, result. A call during which another process called is
written in two halves. Relative paths count from the working folder of their process, which it has from the
process that started it.
"""

from __future__ import annotations

import re
from enum import Enum
from posixpath import basename, join, normpath
from typing import TYPE_CHECKING

from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping


class Kind(Enum):
    """What a program did with a path, in the words of a report."""

    RAN = "ran"
    READ = "read"
    LOADED = "loaded"
    """A shared library that the program needs to start."""
    LISTED = "listed"
    SEEN = "looked at"
    """The file is there: its contents were not asked for."""
    FOLDER = "passed"
    """The folder or link is there: its names were not asked for."""
    MISSED = "looked for"
    """There was nothing."""
    MADE = "made"


@frozen
class Access:
    """What a program did with an absolute path."""

    path: str
    kind: Kind
    program: str


@frozen
class Accesses:
    """Everything that a step did: the first program for each path and kind, and the paths that it made.

    What was read only after the step itself had made it is left out.
    """

    found: Mapping[tuple[str, Kind], str]
    made: frozenset[str]

    def after(self, made: frozenset[str]) -> Accesses:
        """Return the same with what earlier steps of the package made."""
        return Accesses(self.found, self.made | made)


CALLS = (
    *("open", "openat", "openat2", "creat", "execve", "execveat", "readlink", "readlinkat"),
    *("stat", "lstat", "newfstatat", "statx", "stat64", "lstat64", "fstatat64"),
    *("access", "faccessat", "faccessat2", "chdir", "fchdir", "clone", "clone3", "fork", "vfork"),
    *("mkdir", "mkdirat", "symlink", "symlinkat", "link", "linkat", "rename", "renameat", "renameat2"),
)
"""The system calls that have to be traced."""

_LINE = re.compile(r"(\d+)\s+(.*)")
_RESUMED = re.compile(r"<\.\.\. \w+ resumed>")
_UNFINISHED = " <unfinished ...>"
_RESULT = re.compile(r"\)\s+= (-?\d+|\?)(?:<.*>)?(?: (E\w+) \(.*\))?$")
_DESCRIPTOR = r"(?:AT_FDCWD|-?\d+)(?:<((?:[^>\\]|\\.)*)>(?:\(deleted\))?)?"
_PATH = re.compile(rf'(?:{_DESCRIPTOR}, )?"((?:[^"\\]|\\.)*)"')
_FIRST_DESCRIPTOR = re.compile(_DESCRIPTOR)
_ESCAPE = re.compile(rb"\\([0-7]{1,3}|x[0-9a-f]{2}|.)", re.DOTALL)
_LETTERS = {b"n": b"\n", b"t": b"\t", b"r": b"\r", b"v": b"\v", b"f": b"\f", b"a": b"\a", b"b": b"\b"}
_STARTS = frozenset({"clone", "clone3", "fork", "vfork"})
_TWO_PATHS = re.compile(r"(rename|link)")
_LOADED = re.compile(r"\.so(\.[\w.-]+)?$|^/etc/ld\.so\.")
_FOLDER = re.compile(r"stx?_mode=S_IFDIR")
_ABSENT = frozenset({"ENOENT", "ENOTDIR"})


def started_by(lines: Iterable[str]) -> dict[str, str]:
    """Return which process started which: the parent of each, by their numbers as text."""
    parents = {}
    begun: dict[str, str] = {}
    for line in lines:
        if "clone" not in line and "fork" not in line:
            continue
        for process, call in _whole((line,), begun):
            result = _RESULT.search(call)
            if result and call.partition("(")[0] in _STARTS and result[1].isdigit():
                parents[result[1]] = process
    return parents


def read_accesses(lines: Iterable[str], cwd: str, parents: Mapping[str, str]) -> Accesses:
    """Return all that strace saw of a step which began in the folder `cwd`."""
    found: dict[tuple[str, Kind], str] = {}
    made: set[str] = set()
    for access in _accesses(lines, cwd, parents):
        if access.kind is Kind.MADE:
            made.add(access.path)
        elif access.path not in made:
            found.setdefault((access.path, access.kind), access.program)
    return Accesses(found, frozenset(made))


def _accesses(lines: Iterable[str], cwd: str, parents: Mapping[str, str]) -> Iterator[Access]:
    processes = _Processes(cwd, parents)
    for process, call in _whole(lines, {}):
        name, _, arguments = call.partition("(")
        result = _RESULT.search(arguments)
        if result is None:
            if call.startswith("+++"):
                processes.ended(process)
            continue
        arguments = arguments[: result.start()]
        error = result[2] or ""
        if name in {"chdir", "fchdir"}:
            if not error:
                processes.moved(process, name, arguments)
        elif name not in _STARTS:
            yield from _of_call(processes, process, (name, arguments, error))


def _of_call(processes: _Processes, process: str, call: tuple[str, str, str]) -> Iterator[Access]:
    name, arguments, error = call
    match = _PATH.match(arguments)
    kind = _kind(name, arguments, error)
    if match is None or kind is None or not match[2]:
        return
    path = processes.absolute(process, match)
    if kind is Kind.RAN:
        processes.became(process, basename(path))
    if kind is Kind.READ:
        kind = processes.reading(process, path)
    program = processes.program(process)
    if kind is not Kind.MADE or not _TWO_PATHS.match(name):
        yield Access(path, kind, program)
        return
    if name.startswith("link"):
        yield Access(path, Kind.READ, program)
    other = _PATH.search(arguments, match.end())
    if other is not None:
        yield Access(processes.absolute(process, other), kind, program)


def _kind(name: str, arguments: str, error: str) -> Kind | None:
    """Return what a call did with its path; None for what says nothing of what is there."""
    if error:
        return Kind.MISSED if error in _ABSENT and not _makes(name, arguments) else None
    if name.startswith("exec"):
        return Kind.RAN
    if _makes(name, arguments):
        return Kind.MADE
    if name.startswith("open"):
        return _kind_of_open(arguments)
    leads_on = name.startswith("readlink") or _FOLDER.search(arguments)
    return Kind.FOLDER if leads_on else Kind.SEEN


def _makes(name: str, arguments: str) -> bool:
    """Tell if a call makes what its path names, whatever was there before."""
    if name.startswith("open"):
        flags = arguments.rpartition('"')[2]
        return "O_CREAT" in flags and ("O_TRUNC" in flags or "O_EXCL" in flags)
    return name == "creat" or name.startswith(("mkdir", "symlink", "link", "rename"))


def _kind_of_open(arguments: str) -> Kind | None:
    flags = arguments.rpartition('"')[2]
    if "O_DIRECTORY" in flags:
        return Kind.LISTED
    if "O_WRONLY" in flags:
        return None
    return Kind.SEEN if "O_PATH" in flags else Kind.READ


class _Processes:
    """In which folder each process works, and which program it runs."""

    def __init__(self, cwd: str, parents: Mapping[str, str]) -> None:
        self._first = cwd
        self._parents = parents
        self._folders: dict[str, str] = {}
        self._programs: dict[str, str] = {}
        self._loading: set[str] = set()

    def absolute(self, process: str, match: re.Match[str]) -> str:
        """Return the absolute path that a match of `_PATH` names."""
        below = _text(match[1]) if match[1] else self._folder(process)
        path = normpath(join(below, _text(match[2])))
        return path[1:] if path.startswith("//") else path

    def moved(self, process: str, name: str, arguments: str) -> None:
        """Take note of a new working folder."""
        if name == "chdir":
            match = _PATH.match(arguments)
            folder = self.absolute(process, match) if match else None
        else:
            descriptor = _FIRST_DESCRIPTOR.match(arguments)
            folder = _text(descriptor[1]) if descriptor and descriptor[1] else None
        if folder is not None:
            self._folders[process] = folder

    def became(self, process: str, program: str) -> None:
        """Take note of the program that a process runs from now on."""
        self._folder(process)
        self._programs[process] = program
        self._loading.add(process)

    def reading(self, process: str, path: str) -> Kind:
        """Return what it means that a process opens a file to read it.

        The dynamic loader comes first, before the program has read anything.
        """
        if process in self._loading and _LOADED.search(path):
            return Kind.LOADED
        self._loading.discard(process)
        return Kind.READ

    def program(self, process: str) -> str:
        """Return the name of the program that a process runs."""
        if process not in self._programs:
            parent = self._parents.get(process)
            self._programs[process] = self._programs.get(parent, "") if parent else ""
        return self._programs[process]

    def ended(self, process: str) -> None:
        """Forget a process: its number may be given to another one."""
        self._folders.pop(process, None)
        self._programs.pop(process, None)
        self._loading.discard(process)

    def _folder(self, process: str) -> str:
        if process not in self._folders:
            parent = self._parents.get(process)
            self._folders[process] = self._folders.get(parent, self._first) if parent else self._first
        return self._folders[process]


def _whole(lines: Iterable[str], begun: dict[str, str]) -> Iterator[tuple[str, str]]:
    """Yield each call with its process once its result is known; `begun` keeps first halves."""
    for line in lines:
        match = _LINE.match(line)
        if match is None:
            continue
        process, call = match[1], match[2].rstrip("\n")
        if call.endswith(_UNFINISHED):
            begun[process] = call.removesuffix(_UNFINISHED)
        elif resumed := _RESUMED.match(call):
            yield process, begun.pop(process, "") + call[resumed.end() :]
        else:
            yield process, call


def _text(quoted: str) -> str:
    """Return what strace quoted, with C's escapes resolved; bytes that are no UTF-8 become surrogates."""
    if "\\" not in quoted:
        return quoted
    return _ESCAPE.sub(_unescaped, quoted.encode(errors="surrogateescape")).decode(errors="surrogateescape")


def _unescaped(match: re.Match[bytes]) -> bytes:
    said = match[1]
    if said[:1].isdigit():
        return bytes([int(said, 8) & 0xFF])
    return bytes([int(said[1:], 16)]) if said[:1] == b"x" and len(said) > 1 else _LETTERS.get(said, said)
