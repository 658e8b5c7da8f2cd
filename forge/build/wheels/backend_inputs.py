"""Determine the external files that a build backend read, from the logs of its Python and its compilers.

A backend imports hundreds of modules. Those of an installed distribution are represented by its RECORD, which
an upgrade changes; the standard library is represented by the interpreter, which is tracked as a tool.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import stat
from dataclasses import field
from functools import partial
from typing import TYPE_CHECKING

from forge.base.files import text_or_nothing
from forge.base.frozen import frozen
from forge.build.inputs.fingerprints import DIR_LISTING_SUFFIX

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

_text = partial(text_or_nothing, errors="surrogateescape")
_FEW = 8
"""The number of files of a distribution up to which they are listed individually."""

_CLOSED = re.compile(r"/lib-dynload$|-packages/")
_KERNEL = ("/dev/", "/proc/", "/sys/")
_CACHED = re.compile(r"(.*/)__pycache__/([^/]+?)\.[^/]*\.pyc")
_INFO = (".dist-info", ".egg-info")
_DESCRIPTIONS = ("RECORD", "METADATA", "PKG-INFO")
_MAKE_WORD = re.compile(r"(?:\\.|[^\\\s])+")
_SHELLS = frozenset({"sh", "bash", "dash", "zsh", "ksh"})
_LIBRARIES = ("/usr/local/lib", "/usr/lib", "/lib")


@frozen
class Started:
    """A started program: working folder, program name and command line."""

    folder: str
    program: str
    words: tuple[str, ...]


@frozen
class Traced:
    """The parsed log of `backend_tracer`; `missing`: only installed packages import the module."""

    read: set[str] = field(default_factory=set)
    written: set[str] = field(default_factory=set)
    made: set[str] = field(default_factory=set)
    listed: set[str] = field(default_factory=set)
    started: list[Started] = field(default_factory=list)
    missing: dict[str, bool] = field(default_factory=dict)
    search_path: set[str] = field(default_factory=set)
    programs: set[str] = field(default_factory=set)


def parse_trace(text: str) -> Traced:
    """Parse a log; invalid lines, such as those of two concurrent writers, are ignored."""
    traced = Traced()
    for line in text.splitlines():
        with contextlib.suppress(ValueError, TypeError):
            match json.loads(line):
                case ["read", str(path)]:
                    traced.read.add(os.path.normpath(_CACHED.sub(r"\1\2.py", path)))
                case ["written" | "made" | "listed" as word, str(path)]:
                    getattr(traced, word).add(os.path.normpath(path))
                case ["started", str(folder), str(program), [*words]]:
                    traced.started.append(Started(folder, program, tuple(map(str, words))))
                case ["missing", str(module), bool(optional)]:
                    traced.missing[module] = optional
                case ["interpreter", [*entries], [*programs]]:
                    traced.search_path.update(os.path.normpath(entry) for entry in entries if entry)
                    traced.programs.update(programs)
    return traced


def parse_make_rules(text: str, folder: str) -> Iterator[str]:
    """Yield the prerequisites of make rules; relative paths are relative to `folder`."""
    for line in text.replace("\\\n", " ").split("\n"):
        for word in _MAKE_WORD.findall(line.partition(": ")[2]):
            path = re.sub(r"\\(.)", r"\1", word.replace("$$", "$"))
            yield os.path.normpath(os.path.join(folder, path))


def parse_list(text: str, folder: str) -> Iterator[str]:
    """Yield the files of a list with one per line; relative paths are relative to `folder`."""
    for line in filter(None, text.split("\n")):
        yield os.path.normpath(os.path.join(folder, line))


def external_files(traced: Traced, headers: Iterable[str], inside: Sequence[str]) -> tuple[str, ...]:
    """Return the inputs outside of the folders `inside`; FOLDER/. represents the names in a folder.

    Files that the build wrote itself are not inputs.
    """
    own = tuple(f"{folder}{os.sep}" for folder in (*inside, *traced.made))

    def is_input(path: str) -> bool:
        return not (
            f"{path}{os.sep}".startswith(own)
            or path in traced.written
            or path in traced.programs
            or path.startswith(_KERNEL)
        )

    read = {*traced.read, *headers}
    folders = set(traced.listed)
    for started in traced.started:
        _add_command(started, read, folders)
    candidates = set(filter(is_input, _candidates(traced.missing, traced.search_path)))
    absent = {path for path in candidates if not os.path.exists(path)}
    read.update(candidates - absent)
    condensed = _by_distribution(filter(is_input, read), sorted(traced.search_path))
    files = (path for path in condensed if _may_be_a_file(path, traced.search_path))
    listed = {os.path.realpath(path) for path in folders if is_input(path)} - traced.search_path
    folders = {f"{path}{DIR_LISTING_SUFFIX}" for path in listed if os.path.isdir(path) and is_input(path)}
    return tuple(sorted({*files, *absent, *folders}))


def _may_be_a_file(path: str, search_path: set[str]) -> bool:
    """Return True for a regular file or a missing one, which the build may have looked for."""
    try:
        return stat.S_ISREG(os.stat(path).st_mode)
    except FileNotFoundError:
        return path not in search_path
    except OSError:
        return False


def _add_command(started: Started, read: set[str], folders: set[str]) -> None:
    """Add the files in a command line, including the program, to `read`.

    Include folders are added to `folders`, since a new header may shadow another one.
    """
    words = started.words
    if os.path.basename(started.program) in _SHELLS and words[1:2] == ("-c",):
        words = _shell_words(" ".join(words[2:3]))
        for word in words:
            _add_program(word, started.folder, read)
    _add_program(started.program, started.folder, read)
    at: Callable[[str], str] = lambda word: os.path.normpath(os.path.join(started.folder, word))  # noqa: E731
    for word in words:
        for name in {word, word.partition("=")[2]} - {""}:
            if os.path.isfile(at(name)):
                read.add(at(name))
    directories = [at(word[2:]) for word in words if word.startswith("-L") and word[2:]]
    for library in (word[2:] for word in words if word.startswith("-l") and word[2:]):
        read.update(_found_library(library, directories))
    folders.update(at(word[2:]) for word in words if word.startswith("-I") and word[2:])


def _shell_words(text: str) -> tuple[str, ...]:
    """Return the words of a shell command without expansion."""
    import shlex

    try:
        return tuple(shlex.shlex(text, posix=True, punctuation_chars=True))
    except ValueError:  # such as a quote in a here-document
        return tuple(text.split())


def _add_program(program: str, folder: str, read: set[str]) -> None:
    path = os.path.join(folder, program) if os.sep in program else shutil.which(program)
    if path and os.access(path, os.X_OK) and os.path.isfile(path):
        read.add(os.path.normpath(path))


def _found_library(name: str, directories: Sequence[str]) -> Iterator[str]:
    """Yield the library that a linker finds first in `directories` or the system's default folders."""
    for folder in (*directories, *_LIBRARIES):
        for path in (f"{folder}/lib{name}.so", f"{folder}/lib{name}.a"):
            if os.path.isfile(path):
                yield path
                return


def _by_distribution(files: Iterable[str], search_path: Sequence[str]) -> Iterator[str]:
    """Yield the files; those of an installed distribution are replaced by its RECORD unless they are few."""
    folders = [_Modules(folder) for folder in search_path]
    groups: dict[str, list[str]] = {}
    rest: Iterable[str] = files
    # First by name; then most other files belong to a distribution whose RECORD has been read.
    for any_name in (False, True):
        waiting, rest = rest, []
        for path in waiting:
            holder = next(
                (owner for folder in folders if (owner := folder.holder_of(path, any_name=any_name))), None
            )
            if holder:
                groups.setdefault(holder, []).append(path)
            else:
                rest.append(path)
    yield from rest
    for description, paths in groups.items():
        yield description
        if len(paths) <= _FEW:
            yield from paths


class _Modules:
    """A folder on the interpreter's search path, and the distributions that are installed there."""

    def __init__(self, folder: str) -> None:
        self._start = f"{folder}{os.sep}"
        self._found: dict[tuple[str, bool], str] = {}
        self._records: dict[str, str] = {}
        self._infos: dict[str, list[str]] | None = None

    def holder_of(self, path: str, *, any_name: bool) -> str:
        """Return the description file of a distribution that contains a file, or ''.

        Unless `any_name`, only distributions named like the file are searched.
        """
        if not path.startswith(self._start):
            return ""
        name = path[len(self._start) :]
        key = os.path.dirname(name) or name, any_name
        if key not in self._found:
            self._found[key] = self._look_up(name, any_name=any_name)
        return self._found[key]

    def _look_up(self, name: str, *, any_name: bool) -> str:
        top = name.partition(os.sep)[0]
        if top.endswith(_INFO):
            return self._description(top)
        infos = self._list()
        candidates = infos.get(_plain(top), [])
        if any_name:
            candidates = [*self._records, *(info for some in infos.values() for info in some)]
        return next((self._description(info) for info in candidates if self._holds(info, name, top)), "")

    def _list(self) -> dict[str, list[str]]:
        """Return the .dist-info and .egg-info entries by distribution name."""
        if self._infos is None:
            self._infos = {}
            with contextlib.suppress(OSError):
                for entry in sorted(os.listdir(self._start)):
                    if entry.endswith(_INFO):
                        self._infos.setdefault(_plain(entry.partition("-")[0]), []).append(entry)
        return self._infos

    def _holds(self, info: str, name: str, top: str) -> bool:
        """Return True if a distribution contains a file, by its RECORD or else its top-level names."""
        if info not in self._records:
            self._records[info] = f"\n{_text(f'{self._start}{info}/RECORD')}"
        record = self._records[info]
        if len(record) > 1:
            return f"\n{name}," in record
        modules = _text(f"{self._start}{info}/top_level.txt").split()
        return top.partition(".")[0] in (modules or [info.partition("-")[0]])

    def _description(self, info: str) -> str:
        paths = [*(f"{self._start}{info}/{name}" for name in _DESCRIPTIONS), f"{self._start}{info}"]
        return next((path for path in paths if os.path.isfile(path)), "")


def _candidates(modules: Mapping[str, bool], search_path: Iterable[str]) -> Iterator[str]:
    """Yield the files that would be read if missing modules were installed.

    A module that only an installed package would use, such as Cython, is a folder.
    """
    for folder in search_path:
        # No modules are installed into folders of the standard library or of a distribution.
        if os.path.isdir(folder) and not _CLOSED.search(folder) and not os.path.exists(f"{folder}/os.py"):
            for module, optional in modules.items():
                yield f"{folder}/{module}/__init__.py"
                if not optional:
                    yield f"{folder}/{module}.py"


def _plain(name: str) -> str:
    return name.lower().replace("_", "").replace("-", "").replace(".", "")
