"""Read the build scripts of packages to find the variables, packages, programs and files that they name.

Imported only if a package is new or changed; otherwise the names are cached.
"""

from __future__ import annotations

import os
import time
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.extensions import PACKAGE_FILES, call
from forge.base.files import open_regular
from forge.build.inputs.fingerprints import RACY_NANOSECONDS, source_files, stamp_files
from forge.build.inputs.named_entries import VOLATILE, Entry, NamedFiles, Uses, digest_of_text, is_text
from forge.build.up_to_date import NAMED_FILE, is_relevant
from forge.toolchain.config_search import ConfigSearch, prefixes_of_path
from forge.toolchain.programs import CMAKE_TYPES, PYTHON_TYPES, cmake_root
from forge.workspace.identity import plugin
from forge.workspace.references import (
    LISTS,
    References,
    in_find_module,
    in_module,
    reader_of,
    reader_of_script,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from forge.toolchain.programs import ProgramLookup
    from forge.workspace.model import Package

_LARGEST = 1 << 19
_OF_CORE = CMAKE_TYPES | PYTHON_TYPES
_SKIPPED_MODULES = frozenset({"Python", "Python2", "Python3", "PythonInterp", "PythonLibs", "Threads"})
"""Find modules whose results forge itself sets, or that read no variables."""


class Scanner:
    """Reads the build scripts of one workspace; CMake modules and config files are cached by package name."""

    def __init__(
        self, root: Path, cmake: Path | None, variables: Mapping[str, str], lookup: ProgramLookup
    ) -> None:
        """Store the workspace root, CMake, the environment and the program lookup."""
        self._root = root
        self._cmake = cmake
        self._variables = variables
        self._lookup = lookup
        self._configs = ConfigSearch()
        self._find_module = cache(self._read_find_module)
        self._config = cache(self._read_config)
        self._folder_of = cache(self._find_folder)

    def entry(self, package: Package, sources: str) -> Entry:
        """Read the build scripts of a package and look up the names in them."""
        named, outside = _read_texts(os.path.normpath(self._root / package.path), package.build_type)
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
        """Look up names; names that are irrelevant or affect all packages are left out."""
        programs = (word for word in words if word in self._lookup.names or word.startswith("/"))
        configs = ((name, self._folder_of(name)) for name in packages)
        return Uses(
            frozenset(name for name in variables if not is_relevant(name)) - VOLATILE,
            packages,
            frozenset(word for word in programs if self._lookup.identity(word)),
            frozenset((name, folder) for name, folder in configs if folder),
        )

    def _find_folder(self, name: str) -> str:
        """Return the folder where find_package finds a package through PATH, or ''."""
        found = (self._configs.folder(prefix, name) for prefix in prefixes_of_path(self._lookup.folders))
        return next(filter(None, found), "")

    def _read_find_module(self, name: str) -> References:
        """Return the names in CMake's find module for a package."""
        root = cmake_root(self._cmake) if self._cmake else None
        if root is None or name in _SKIPPED_MODULES:
            return References()
        return in_find_module(_text(f"{root}/Modules/Find{name}.cmake"))

    def _read_config(self, name: str) -> References:
        """Return the variables read by the CMake config files of a package in an underlay."""
        found = References()
        entries = (self._variables.get(key, "") for key in ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH"))
        for prefix in dict.fromkeys(os.pathsep.join(entries).split(os.pathsep)):
            folder = self._configs.folder(prefix, name) if prefix else ""
            for path in sorted(Path(folder).glob("*.cmake")) if folder else ():
                found |= References(variables=in_module(_text(str(path))).variables)
        return found


def read_named_files(paths: Sequence[str]) -> NamedFiles:
    """Read files named by CMake arguments, and the files that they include."""
    options: list[str] = []
    words: set[str] = set()
    waiting = list(paths)
    seen = set(paths)
    while waiting:
        path = waiting.pop()
        text = _text(path)
        named = in_module(text)
        content = digest_of_text(text) if len(text) < _LARGEST else stamp_files([path])
        options.append(f"{NAMED_FILE}'{path}' named by an option {content}")
        list_dir = os.path.dirname(path)
        words |= named.words | {_expand(word, list_dir) for word in _joined_words(text)}
        for included in named.included:
            other = os.path.normpath(os.path.join(list_dir, _expand(included, list_dir)))
            if other not in seen and is_text(other):
                seen.add(other)
                waiting.append(other)
    read = tuple(sorted(seen))
    return NamedFiles(tuple(sorted(options)), tuple(sorted(words)), read, _stamp(read))


def _stamp(paths: Sequence[str]) -> str:
    """Return a stamp of the files, or '' if one may change without a change of its stat."""
    since = time.time_ns() - RACY_NANOSECONDS
    try:
        racy = any(os.stat(path).st_ctime_ns > since for path in paths)
    except OSError:
        racy = True
    return "" if racy or not paths else stamp_files(paths)


def _read_texts(source_dir: str, build_type: str) -> tuple[References, list[str]]:
    """Return the names in the build scripts below a folder, and the files that they include elsewhere."""
    files = list(source_files(source_dir))
    types = {build_type, *(PACKAGE_FILES.get(os.path.basename(path), build_type) for path in files)}
    of_plugins = [(f"the build type '{name}'", plugin(name)) for name in sorted(types - _OF_CORE)]

    def reader(path: str, *, top: bool = False) -> Callable[[str], References] | None:
        if found := reader_of(os.path.basename(path), top=top):
            return found
        for what, module in of_plugins:
            if hasattr(module, "reader_of") and (found := call(what, module.reader_of, path)):
                return partial(call, what, found)
        return None

    named, outside = References(), list[str]()
    readers = ((path, reader(path, top=os.path.dirname(path) == source_dir)) for path in files)
    waiting = [(path, read) for path, read in readers if read]
    seen = {path for path, _ in waiting}
    mentioned = False
    while waiting:
        path, read = waiting.pop()
        found = read(_text(path))
        named |= found
        folder = os.path.dirname(path)
        for word in found.included:
            name = os.path.normpath(os.path.join(folder, _expand(word, folder, source_dir)))
            for other in filter(os.path.isfile, (name, f"{name}/{LISTS}")):
                if other not in seen and not other.startswith(f"{source_dir}/"):
                    seen.add(other)
                    outside.append(other)
                    waiting.append((other, reader(other) or in_module))
        if not waiting and not mentioned:
            mentioned = True
            for other in files:
                name = os.path.basename(other)
                if other not in seen and name in named.scripts and (script := reader_of_script(name)):
                    seen.add(other)
                    waiting.append((other, script))
    return named, outside


def _expand(word: str, list_dir: str, source_dir: str = "") -> str:
    """Expand CMake's variables for the folder of the current file and of the package in a path."""
    for name in ("CMAKE_CURRENT_LIST_DIR", "CMAKE_CURRENT_SOURCE_DIR"):
        word = word.replace(f"${{{name}}}", list_dir)
    for name in ("PROJECT_SOURCE_DIR", "CMAKE_SOURCE_DIR"):
        word = word.replace(f"${{{name}}}", source_dir or list_dir)
    return word


def _joined_words(text: str) -> Iterable[str]:
    """Return the words of a text that contain ${CMAKE_CURRENT_LIST_DIR}."""
    return (word.strip('"()') for word in text.split() if "${CMAKE_CURRENT_LIST_DIR}/" in word)


def _text(path: str) -> str:
    """Return the text of a file up to a size limit, or '' if it cannot be read."""
    try:
        with open(path, encoding="utf-8", errors="surrogateescape", opener=open_regular) as stream:
            return stream.read(_LARGEST)
    except (OSError, ValueError):
        return ""
