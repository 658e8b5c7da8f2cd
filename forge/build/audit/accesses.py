"""Parse the file accesses of a step from the output of `strace -f -y`; pure.

A line is one system call: process, name, arguments, result. A call interrupted by one of another process is
split into two lines. Relative paths are relative to the working folder of the process, inherited from its
parent.
"""

from __future__ import annotations

import re
from enum import Enum
from posixpath import basename, join, normpath
from typing import TYPE_CHECKING

from forge.base.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping


class AccessKind(Enum):
    """The kind of access; the values appear in reports."""

    RAN = "ran"
    READ = "read"
    LOADED = "loaded"
    """A shared library that the program needs to start."""
    LISTED = "listed"
    SEEN = "looked at"
    """The file exists; its contents were not read."""
    FOLDER = "passed"
    """The folder or link exists; its entries were not listed."""
    MISSED = "looked for"
    """The path does not exist."""
    MADE = "made"


@frozen
class Access:
    """An access of a program to an absolute path."""

    path: str
    kind: AccessKind
    program: str


@frozen
class Accesses:
    """All accesses of a step: the first program for each path and kind, and the paths that it created.

    Paths that were read only after the step itself created them are left out.
    """

    found: Mapping[tuple[str, AccessKind], str]
    made: frozenset[str]

    def after(self, made: frozenset[str]) -> Accesses:
        """Return the accesses with the paths created by earlier steps of the package."""
        return Accesses(self.found, self.made | made)


CALLS = (
    *("open", "openat", "openat2", "creat", "execve", "execveat", "readlink", "readlinkat"),
    *("stat", "lstat", "newfstatat", "statx", "stat64", "lstat64", "fstatat64"),
    *("access", "faccessat", "faccessat2", "chdir", "fchdir", "clone", "clone3", "fork", "vfork"),
    *("mkdir", "mkdirat", "symlink", "symlinkat", "link", "linkat", "rename", "renameat", "renameat2"),
)
"""The system calls to trace."""

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


def parent_processes(lines: Iterable[str]) -> dict[str, str]:
    """Return the parent of each process; process ids are strings."""
    parents = {}
    begun: dict[str, str] = {}
    for line in lines:
        if "clone" not in line and "fork" not in line:
            continue
        for process, call in _complete_calls((line,), begun):
            result = _RESULT.search(call)
            if result and call.partition("(")[0] in _STARTS and result[1].isdigit():
                parents[result[1]] = process
    return parents


def read_accesses(lines: Iterable[str], cwd: str, parents: Mapping[str, str]) -> Accesses:
    """Return all accesses of a step that started in the folder `cwd`."""
    found: dict[tuple[str, AccessKind], str] = {}
    made: set[str] = set()
    for access in _accesses(lines, cwd, parents):
        if access.kind is AccessKind.MADE:
            made.add(access.path)
        elif access.path not in made:
            found.setdefault((access.path, access.kind), access.program)
    return Accesses(found, frozenset(made))


def _accesses(lines: Iterable[str], cwd: str, parents: Mapping[str, str]) -> Iterator[Access]:
    processes = _Processes(cwd, parents)
    for process, call in _complete_calls(lines, {}):
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
                processes.changed_dir(process, name, arguments)
        elif name not in _STARTS:
            yield from _accesses_of_call(processes, process, (name, arguments, error))


def _accesses_of_call(processes: _Processes, process: str, call: tuple[str, str, str]) -> Iterator[Access]:
    name, arguments, error = call
    match = _PATH.match(arguments)
    kind = _kind(name, arguments, error)
    if match is None or kind is None or not match[2]:
        return
    path = processes.absolute(process, match)
    if kind is AccessKind.RAN:
        processes.executed(process, basename(path))
    if kind is AccessKind.READ:
        kind = processes.reading(process, path)
    program = processes.program(process)
    if kind is not AccessKind.MADE or not _TWO_PATHS.match(name):
        yield Access(path, kind, program)
        return
    if name.startswith("link"):
        yield Access(path, AccessKind.READ, program)
    other = _PATH.search(arguments, match.end())
    if other is not None:
        yield Access(processes.absolute(process, other), kind, program)


def _kind(name: str, arguments: str, error: str) -> AccessKind | None:
    """Return the kind of a call, or None if it reveals nothing about the path."""
    if error:
        return AccessKind.MISSED if error in _ABSENT and not _makes(name, arguments) else None
    if name.startswith("exec"):
        return AccessKind.RAN
    if _makes(name, arguments):
        return AccessKind.MADE
    if name.startswith("open"):
        return _kind_of_open(arguments)
    leads_on = name.startswith("readlink") or _FOLDER.search(arguments)
    return AccessKind.FOLDER if leads_on else AccessKind.SEEN


def _makes(name: str, arguments: str) -> bool:
    """Return True if a call creates its path regardless of what existed before."""
    if name.startswith("open"):
        flags = arguments.rpartition('"')[2]
        return "O_CREAT" in flags and ("O_TRUNC" in flags or "O_EXCL" in flags)
    return name == "creat" or name.startswith(("mkdir", "symlink", "link", "rename"))


def _kind_of_open(arguments: str) -> AccessKind | None:
    flags = arguments.rpartition('"')[2]
    if "O_DIRECTORY" in flags:
        return AccessKind.LISTED
    if "O_WRONLY" in flags:
        return None
    return AccessKind.SEEN if "O_PATH" in flags else AccessKind.READ


class _Processes:
    """The working folder and program of each process."""

    def __init__(self, cwd: str, parents: Mapping[str, str]) -> None:
        self._first = cwd
        self._parents = parents
        self._folders: dict[str, str] = {}
        self._programs: dict[str, str] = {}
        self._loading: set[str] = set()

    def absolute(self, process: str, match: re.Match[str]) -> str:
        """Return the absolute path of a match of `_PATH`."""
        below = _text(match[1]) if match[1] else self._folder(process)
        path = normpath(join(below, _text(match[2])))
        return path[1:] if path.startswith("//") else path

    def changed_dir(self, process: str, name: str, arguments: str) -> None:
        """Record a new working folder."""
        if name == "chdir":
            match = _PATH.match(arguments)
            folder = self.absolute(process, match) if match else None
        else:
            descriptor = _FIRST_DESCRIPTOR.match(arguments)
            folder = _text(descriptor[1]) if descriptor and descriptor[1] else None
        if folder is not None:
            self._folders[process] = folder

    def executed(self, process: str, program: str) -> None:
        """Record the program that a process executes."""
        self._folder(process)
        self._programs[process] = program
        self._loading.add(process)

    def reading(self, process: str, path: str) -> AccessKind:
        """Return the kind of opening a file for reading: LOADED by the dynamic loader, or READ.

        The dynamic loader runs before the program reads anything.
        """
        if process in self._loading and _LOADED.search(path):
            return AccessKind.LOADED
        self._loading.discard(process)
        return AccessKind.READ

    def program(self, process: str) -> str:
        """Return the name of the program that a process runs."""
        if process not in self._programs:
            parent = self._parents.get(process)
            self._programs[process] = self._programs.get(parent, "") if parent else ""
        return self._programs[process]

    def ended(self, process: str) -> None:
        """Remove a process, since its id may be reused."""
        self._folders.pop(process, None)
        self._programs.pop(process, None)
        self._loading.discard(process)

    def _folder(self, process: str) -> str:
        if process not in self._folders:
            parent = self._parents.get(process)
            self._folders[process] = self._folders.get(parent, self._first) if parent else self._first
        return self._folders[process]


def _complete_calls(lines: Iterable[str], begun: dict[str, str]) -> Iterator[tuple[str, str]]:
    """Yield each complete call with its process; `begun` stores the first halves of split calls."""
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
    """Return a string of strace with C escapes resolved; bytes that are not UTF-8 become surrogates."""
    if "\\" not in quoted:
        return quoted
    return _ESCAPE.sub(_unescaped, quoted.encode(errors="surrogateescape")).decode(errors="surrogateescape")


def _unescaped(match: re.Match[bytes]) -> bytes:
    escape = match[1]
    if escape[:1].isdigit():
        return bytes([int(escape, 8) & 0xFF])
    return (
        bytes([int(escape[1:], 16)])
        if escape[:1] == b"x" and len(escape) > 1
        else _LETTERS.get(escape, escape)
    )
