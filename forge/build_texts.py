"""The build scripts of packages, read: what each names, and which programs and files that is.

Loaded only when a package is new or changed; a build with nothing to do knows all this already.
"""

from __future__ import annotations

import os
import time
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from forge.config_search import ConfigSearch, prefixes_of_path
from forge.digests import RACY_NANOSECONDS, source_files, stamp_files
from forge.files import open_regular
from forge.freshness import NAMED_FILE, counts
from forge.named_inputs import VOLATILE, Entry, NamedFiles, Uses, digest_of_text, is_text
from forge.named_variables import LISTS, Named, in_find_module, in_module, reader_of, reader_of_script
from forge.tools import cmake_root

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from forge.model import Package
    from forge.program_lookup import ProgramLookup

_LARGEST = 1 << 19
_OTHERWISE = frozenset({"Python", "Python2", "Python3", "PythonInterp", "PythonLibs", "Threads"})
"""Find modules for what forge itself tells CMake, or that read nothing."""


class Scanner:
    """Reads packages of one workspace; what CMake and underlays have for a name is read once."""

    def __init__(
        self, root: Path, cmake: Path | None, variables: Mapping[str, str], lookup: ProgramLookup
    ) -> None:
        """Remember where the workspace is, which CMake counts, and what is looked up where."""
        self._root = root
        self._cmake = cmake
        self._variables = variables
        self._lookup = lookup
        self._configs = ConfigSearch()
        self._find_module = cache(self._read_find_module)
        self._config = cache(self._read_config)
        self._folder_of = cache(self._find_folder)

    def entry(self, package: Package, sources: str) -> Entry:
        """Read the texts of a package and look up what they name."""
        named, outside = _read_texts(os.path.normpath(self._root / package.path))
        for name in sorted(named.packages):
            named |= self._find_module(name) | self._config(name)
        return Entry(
            sources,
            own=self._uses(named.variables, named.packages, named.words),
            exported=self._uses(named.exported, named.exported_packages, named.exported_words),
            outside=tuple(outside),
            stamp=_stamp(outside),
        )

    def _uses(self, variables: frozenset[str], packages: frozenset[str], words: frozenset[str]) -> Uses:
        """Return names with what is looked up for them; without those that count for all, or for nobody."""
        programs = (word for word in words if word in self._lookup.names or word.startswith("/"))
        configs = ((name, self._folder_of(name)) for name in packages)
        return Uses(
            frozenset(name for name in variables if not counts(name)) - VOLATILE,
            packages,
            frozenset(word for word in programs if self._lookup.identity(word)),
            frozenset((name, folder) for name, folder in configs if folder),
        )

    def _find_folder(self, name: str) -> str:
        """Return where find_package finds a package by PATH alone, '' where it does not."""
        found = (self._configs.folder(prefix, name) for prefix in prefixes_of_path(self._lookup.folders))
        return next(filter(None, found), "")

    def _read_find_module(self, name: str) -> Named:
        """Return what CMake's own module for a package reads."""
        root = cmake_root(self._cmake) if self._cmake else None
        if root is None or name in _OTHERWISE:
            return Named()
        return in_find_module(_text(f"{root}/Modules/Find{name}.cmake"))

    def _read_config(self, name: str) -> Named:
        """Return the variables that the files of CMake read that an underlay has for a package."""
        found = Named()
        entries = (self._variables.get(key, "") for key in ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH"))
        for prefix in dict.fromkeys(os.pathsep.join(entries).split(os.pathsep)):
            folder = self._configs.folder(prefix, name) if prefix else ""
            for path in sorted(Path(folder).glob("*.cmake")) if folder else ():
                found |= Named(variables=in_module(_text(str(path))).variables)
        return found


def read_named_files(paths: Sequence[str]) -> NamedFiles:
    """Read files that arguments of CMake name. What such a file includes counts like itself."""
    options: list[str] = []
    words: set[str] = set()
    waiting = list(paths)
    seen = set(paths)
    while waiting:
        path = waiting.pop()
        text = _text(path)
        named = in_module(text)
        content = digest_of_text(text) if len(text) < _LARGEST else stamp_files([path])
        options.append(f"{NAMED_FILE}'{path}', which an option names, {content}")
        here = os.path.dirname(path)  # noqa: PTH120
        words |= named.words | {_settled(word, here) for word in _joined_words(text)}
        for included in named.included:
            other = os.path.normpath(os.path.join(here, _settled(included, here)))  # noqa: PTH118
            if other not in seen and is_text(other):
                seen.add(other)
                waiting.append(other)
    read = tuple(sorted(seen))
    return NamedFiles(tuple(sorted(options)), tuple(sorted(words)), read, _stamp(read))


def _stamp(paths: Sequence[str]) -> str:
    """Return a stamp of files that were read, '' where one may have changed since without a trace."""
    since = time.time_ns() - RACY_NANOSECONDS
    try:
        racy = any(os.stat(path).st_ctime_ns > since for path in paths)  # noqa: PTH116
    except OSError:
        racy = True
    return "" if racy or not paths else stamp_files(paths)


def _read_texts(home: str) -> tuple[Named, list[str]]:
    """Return what the build scripts below a folder name, and the files elsewhere that they include."""
    files = list(source_files(home))
    named, outside = Named(), list[str]()
    waiting = []
    for path in files:
        folder, _, name = path.rpartition("/")
        if reader := reader_of(name, top=folder == home):
            waiting.append((path, reader))
    seen = {path for path, _ in waiting}
    mentioned = False
    while waiting:
        path, reader = waiting.pop()
        found = reader(_text(path))
        named |= found
        folder = os.path.dirname(path)  # noqa: PTH120
        for word in found.included:
            for other in _listed(os.path.normpath(os.path.join(folder, _settled(word, folder, home)))):  # noqa: PTH118
                if other not in seen and not other.startswith(f"{home}/"):
                    seen.add(other)
                    outside.append(other)
                    waiting.append((other, reader_of(os.path.basename(other), top=False) or in_module))  # noqa: PTH119
        if not waiting and not mentioned:
            mentioned = True
            for other in files:
                name = os.path.basename(other)  # noqa: PTH119
                if other not in seen and name in named.scripts and (script := reader_of_script(name)):
                    seen.add(other)
                    waiting.append((other, script))
    return named, outside


def _listed(path: str) -> tuple[str, ...]:
    """Return the files of CMake that a word for a file or a folder stands for."""
    return tuple(name for name in (path, f"{path}/{LISTS}") if os.path.isfile(name))  # noqa: PTH113


def _settled(word: str, here: str, home: str = "") -> str:
    """Return a path with CMake's variables for the folder of its file put in, and those for the package's."""
    for name in ("CMAKE_CURRENT_LIST_DIR", "CMAKE_CURRENT_SOURCE_DIR"):
        word = word.replace(f"${{{name}}}", here)
    for name in ("PROJECT_SOURCE_DIR", "CMAKE_SOURCE_DIR"):
        word = word.replace(f"${{{name}}}", home or here)
    return word


def _joined_words(text: str) -> Iterable[str]:
    """Return the words of a text that begin in the folder of its file."""
    return (word.strip('"()') for word in text.split() if "${CMAKE_CURRENT_LIST_DIR}/" in word)


def _text(path: str) -> str:
    """Return the text of a file, '' for one that cannot be read or is too large for a script."""
    try:
        with open(path, encoding="utf-8", errors="surrogateescape", opener=open_regular) as stream:
            return stream.read(_LARGEST)
    except (OSError, ValueError):
        return ""
