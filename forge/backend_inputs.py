"""Which files outside of its package a build backend read, from what its Python and its compilers logged.

A backend imports hundreds of modules. Those of an installed distribution count as its list of files, which
an upgrade changes; the standard library counts as the interpreter, which is a tool.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import stat
from dataclasses import field
from typing import TYPE_CHECKING

from forge.digests import NAMES_IN
from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

_FEW = 8
"""Up to so many files of a distribution are listed one by one."""

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
    """A program that was started: where, its name as it was given, and its command line."""

    folder: str
    program: str
    words: tuple[str, ...]


@frozen
class Traced:
    """What the log of `forge.backend_tracer` says; of a missing module, if only installed ones tried it."""

    read: set[str] = field(default_factory=set)
    written: set[str] = field(default_factory=set)
    made: set[str] = field(default_factory=set)
    listed: set[str] = field(default_factory=set)
    started: list[Started] = field(default_factory=list)
    missing: dict[str, bool] = field(default_factory=dict)
    search_path: set[str] = field(default_factory=set)
    programs: set[str] = field(default_factory=set)


def parse_trace(text: str) -> Traced:
    """Return what a log says; a torn line, as of two programs that wrote at once, counts as nothing."""
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
    """Yield the files behind the colons of make's rules; relative ones are taken as below `folder`."""
    for line in text.replace("\\\n", " ").split("\n"):
        for word in _MAKE_WORD.findall(line.partition(": ")[2]):
            path = re.sub(r"\\(.)", r"\1", word.replace("$$", "$"))
            yield os.path.normpath(os.path.join(folder, path))  # noqa: PTH118


def parse_list(text: str, folder: str) -> Iterator[str]:
    """Yield the files of which each has a line; relative ones are taken as below `folder`."""
    for line in filter(None, text.split("\n")):
        yield os.path.normpath(os.path.join(folder, line))  # noqa: PTH118


def external_files(traced: Traced, headers: Iterable[str], inside: Sequence[str]) -> tuple[str, ...]:
    """Return the files outside of the folders `inside` that are inputs; FOLDER/. stands for its names.

    What the build wrote itself is no input, wherever it is.
    """
    own = tuple(f"{folder}{os.sep}" for folder in (*inside, *traced.made))

    def counts(path: str) -> bool:
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
    candidates = set(filter(counts, _candidates(traced.missing, traced.search_path)))
    absent = {path for path in candidates if not os.path.exists(path)}  # noqa: PTH110
    read.update(candidates - absent)
    condensed = _condensed(filter(counts, read), sorted(traced.search_path))
    files = (path for path in condensed if _may_be_a_file(path, traced.search_path))
    listed = {os.path.realpath(path) for path in folders if counts(path)} - traced.search_path
    folders = {f"{path}{NAMES_IN}" for path in listed if os.path.isdir(path) and counts(path)}  # noqa: PTH112
    return tuple(sorted({*files, *absent, *folders}))


def _may_be_a_file(path: str, search_path: set[str]) -> bool:
    """Tell if there is a regular file, or none yet: it may have been looked for, and may appear."""
    try:
        return stat.S_ISREG(os.stat(path).st_mode)  # noqa: PTH116
    except FileNotFoundError:
        return path not in search_path
    except OSError:
        return False


def _add_command(started: Started, read: set[str], folders: set[str]) -> None:
    """Add the files that a command line names, the program among them, to `read`.

    The folders of headers go to `folders`: a new header may come before another one.
    """
    words = started.words
    if os.path.basename(started.program) in _SHELLS and words[1:2] == ("-c",):  # noqa: PTH119
        words = _shell_words(" ".join(words[2:3]))
        for word in words:
            _add_program(word, started.folder, read)
    _add_program(started.program, started.folder, read)
    at: Callable[[str], str] = lambda word: os.path.normpath(os.path.join(started.folder, word))  # noqa: E731, PTH118
    for word in words:
        for name in {word, word.partition("=")[2]} - {""}:
            if os.path.isfile(at(name)):  # noqa: PTH113
                read.add(at(name))
    places = [at(word[2:]) for word in words if word.startswith("-L") and word[2:]]
    for library in (word[2:] for word in words if word.startswith("-l") and word[2:]):
        read.update(_found_library(library, places))
    folders.update(at(word[2:]) for word in words if word.startswith("-I") and word[2:])


def _shell_words(text: str) -> tuple[str, ...]:
    """Return the words of a shell command, as well as they can be told without running it."""
    import shlex  # noqa: PLC0415  (few backends start a shell)

    try:
        return tuple(shlex.shlex(text, posix=True, punctuation_chars=True))
    except ValueError:  # such as a quote in a here-document
        return tuple(text.split())


def _add_program(program: str, folder: str, read: set[str]) -> None:
    path = os.path.join(folder, program) if os.sep in program else shutil.which(program)  # noqa: PTH118
    if path and os.access(path, os.X_OK) and os.path.isfile(path):  # noqa: PTH113
        read.add(os.path.normpath(path))


def _found_library(name: str, places: Sequence[str]) -> Iterator[str]:
    """Yield the library that a linker finds first in `places`, else those in the system's usual folders."""
    for folder in (*places, *_LIBRARIES):
        for path in (f"{folder}/lib{name}.so", f"{folder}/lib{name}.a"):
            if os.path.isfile(path):  # noqa: PTH113
                yield path
                return


def _condensed(files: Iterable[str], search_path: Sequence[str]) -> Iterator[str]:
    """Yield the files, those of each installed distribution as what describes it unless they are few."""
    folders = [_Modules(folder) for folder in search_path]
    groups: dict[str, list[str]] = {}
    rest: Iterable[str] = files
    # First by name: then most of what has another name belongs to a distribution whose record is known.
    for find in (_Modules.of_same_name, _Modules.of_any_name):
        waiting, rest = rest, []
        for path in waiting:
            holder = next((owner for folder in folders if (owner := find(folder, path))), None)
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
        self._beginning = f"{folder}{os.sep}"
        self._found: dict[tuple[str, bool], str] = {}
        self._records: dict[str, str] = {}
        self._infos: dict[str, list[str]] | None = None

    def of_same_name(self, path: str) -> str:
        """Return the file that describes the distribution which holds a file, if it has that file's name."""
        return self._distribution(path, all_of_them=False)

    def of_any_name(self, path: str) -> str:
        """Return the file that describes the distribution which holds a file, or ''."""
        return self._distribution(path, all_of_them=True)

    def _distribution(self, path: str, *, all_of_them: bool) -> str:
        if not path.startswith(self._beginning):
            return ""
        name = path[len(self._beginning) :]
        key = os.path.dirname(name) or name, all_of_them  # noqa: PTH120
        if key not in self._found:
            self._found[key] = self._look_up(name, all_of_them=all_of_them)
        return self._found[key]

    def _look_up(self, name: str, *, all_of_them: bool) -> str:
        top = name.partition(os.sep)[0]
        if top.endswith(_INFO):
            return self._description(top)
        infos = self._list()
        asked = infos.get(_plain(top), [])
        if all_of_them:
            asked = [*self._records, *(info for some in infos.values() for info in some)]
        return next((self._description(info) for info in asked if self._holds(info, name, top)), "")

    def _list(self) -> dict[str, list[str]]:
        """Return the folders that describe distributions, by the names of these."""
        if self._infos is None:
            self._infos = {}
            with contextlib.suppress(OSError):
                for entry in sorted(os.listdir(self._beginning)):  # noqa: PTH208
                    if entry.endswith(_INFO):
                        self._infos.setdefault(_plain(entry.partition("-")[0]), []).append(entry)
        return self._infos

    def _holds(self, info: str, name: str, top: str) -> bool:
        """Tell if a distribution holds a file: by its record, or where it has none by its modules' names."""
        if info not in self._records:
            self._records[info] = f"\n{_text(f'{self._beginning}{info}/RECORD')}"
        record = self._records[info]
        if len(record) > 1:
            return f"\n{name}," in record
        modules = _text(f"{self._beginning}{info}/top_level.txt").split()
        return top.partition(".")[0] in (modules or [info.partition("-")[0]])

    def _description(self, info: str) -> str:
        paths = [*(f"{self._beginning}{info}/{name}" for name in _DESCRIPTIONS), f"{self._beginning}{info}"]
        return next((path for path in paths if os.path.isfile(path)), "")  # noqa: PTH113


def _candidates(modules: Mapping[str, bool], search_path: Iterable[str]) -> Iterator[str]:
    """Yield the files that would be read if modules were there that were looked for in vain.

    One that an installed package would use, such as Cython, is a folder.
    """
    for folder in search_path:
        # The folders of the standard library, and those in a distribution, hold no modules of others.
        if os.path.isdir(folder) and not _CLOSED.search(folder) and not os.path.exists(f"{folder}/os.py"):  # noqa: PTH110, PTH112
            for module, optional in modules.items():
                yield f"{folder}/{module}/__init__.py"
                if not optional:
                    yield f"{folder}/{module}.py"


def _plain(name: str) -> str:
    return name.lower().replace("_", "").replace("-", "").replace(".", "")


def _text(path: str) -> str:
    try:
        with open(path, encoding="utf-8", errors="surrogateescape") as stream:  # noqa: PTH123
            return stream.read()
    except OSError:
        return ""
