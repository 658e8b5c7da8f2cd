"""What each package depends on outside of the workspace because its own text, or an option, names it.

Texts are read when a package is new, or when its sources or the folders of PATH changed; what they name is
kept in a file of the build folder. A build with nothing to do compares only values and stats.
"""

from __future__ import annotations

import hashlib
import json
import os
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forge.config_search import ConfigSearch, prefixes_of_path
from forge.digests import source_files, stamp_files
from forge.files import replace_file
from forge.freshness import NAMED_FILE, WITHOUT_EFFECT, Extra, counts
from forge.frozen import frozen
from forge.named_variables import (
    LISTS,
    Named,
    in_find_module,
    in_module,
    reader_of,
    reader_of_script,
    variables_of_packages,
)
from forge.program_lookup import ProgramLookup
from forge.tools import cmake_root, definitions, programs_in

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from forge.model import Package, Pairs, Snapshot
    from forge.recipes.kitchen import Kitchen

FILE = "forge_names.json"

_LARGEST = 1 << 19
_NOBODY: frozenset[str] = frozenset()
_VOLATILE = frozenset(
    {"PATH", "PWD", "OLDPWD", "SHLVL", "_", "TERM", "COLUMNS", "LINES"}
    | {"MAKEFLAGS", "MAKELEVEL", "MFLAGS", "CTEST_PARALLEL_LEVEL"}
)
"""Variables that differ from shell to shell; of PATH counts what it leads to."""
_OTHERWISE = frozenset({"Python", "Python2", "Python3", "PythonInterp", "PythonLibs", "Threads"})
"""Find modules for what forge itself tells CMake, or that read nothing."""


@frozen
class _Entry:
    """What the texts of one package name, as of sources with a digest.

    `programs` are words that led to programs; `configs` the packages that a prefix of PATH provides, each
    with the folder; `outside` files elsewhere that were read, with their stamp.
    """

    sources: str
    variables: frozenset[str] = _NOBODY
    packages: frozenset[str] = _NOBODY
    exported: frozenset[str] = _NOBODY
    exported_packages: frozenset[str] = _NOBODY
    programs: tuple[str, ...] = ()
    configs: tuple[tuple[str, str], ...] = ()
    outside: tuple[str, ...] = ()
    stamp: str = ""


class NamedInputs:
    """The variables, programs and files that packages name, with what they are now."""

    def __init__(
        self,
        kitchen: Kitchen,
        needs: Mapping[str, frozenset[str]],
        packages: Mapping[str, Package],
        variables: Mapping[str, str],
        forge: str,
    ) -> None:
        """Remember what to look at; `forge` tells this forge apart, whose notes another one does not read."""
        self._file = kitchen.layout.build / FILE
        self._kitchen = kitchen
        self._needs = needs
        self._packages = packages
        self._variables = variables
        self._places = frozenset(name for name in variables if name.endswith(("_ROOT", "_DIR")))
        self._lookup = ProgramLookup(variables)
        self._configs = ConfigSearch()
        prefixes = (variables.get(name, "") for name in ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH"))
        self._stamp = "\n".join((forge, self._lookup.stamp(), *prefixes))
        self._entries: dict[str, _Entry] = {}
        self._known: dict[str, _Entry] | None = None
        self._exports: dict[str, tuple[frozenset[str], frozenset[str]]] = {}
        self._named_by_words: dict[tuple[str, ...], Extra] = {}
        self._find_module = cache(self._read_find_module)
        self._config = cache(self._read_config)
        self._changed = False

    def of(self, package: Package, snapshot: Snapshot) -> Extra:
        """Return what a package depends on beside its sources, its needs and what all depend on."""
        if package.embedded:
            return Extra(self._of_arguments(package).options)
        entry = self._entry(package.name, snapshot)
        below = [self._exported(need, snapshot) for need in self._needs[package.name]]
        variables = entry.variables.union(*(exported for exported, _ in below))
        packages = entry.packages.union(*(exported for _, exported in below))
        named = variables.intersection(self._variables)
        named |= frozenset(variables_of_packages(packages, self._places)) if self._places else _NOBODY
        environment = [
            (name, _digest(self._variables[name]))
            for name in sorted(named)
            if name not in _VOLATILE and name not in WITHOUT_EFFECT and not counts(name)
        ]
        if entry.configs:
            found = "; ".join(f"{name} in {folder}" for name, folder in entry.configs)
            environment.append(("PATH", found))
        extra = self._of_arguments(package)
        programs = [(word, self._lookup.identity(word)) for word in entry.programs]
        return Extra(extra.options, self._apart((*programs, *extra.tools)), tuple(sorted(environment)))

    def _apart(self, tools: Pairs) -> Pairs:
        """Return programs without those that all packages depend on, of equal names under other ones."""
        shared = dict(self._kitchen.tools)
        return tuple(
            (f"{name} of PATH" if name in shared else name, identity)
            for name, identity in tools
            if shared.get(name) != identity
        )

    def save(self) -> None:
        """Write what was found if any of it is new."""
        if self._changed:
            kept = {**(self._known or {}), **self._entries}
            said = {name: _written(entry) for name, entry in kept.items() if name in self._packages}
            replace_file(self._file, json.dumps({"stamp": self._stamp, "packages": said}).encode())
            self._changed = False

    def _entry(self, name: str, snapshot: Snapshot) -> _Entry:
        entry = self._entries.get(name)
        if entry is None:
            entry = self._remembered().get(name)
            sources = snapshot.sources[name].digest
            if (
                entry is None
                or entry.sources != sources
                or name in snapshot.moved
                or (entry.outside and stamp_files(entry.outside) != entry.stamp)
            ):
                entry = self._scanned(self._packages[name], sources)
                self._changed = True
            self._entries[name] = entry
        return entry

    def _remembered(self) -> Mapping[str, _Entry]:
        if self._known is None:
            try:
                said = json.loads(self._file.read_bytes())
                fits = said["stamp"] == self._stamp
                self._known = {n: _read(entry) for n, entry in said["packages"].items()} if fits else {}
            except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
                self._known = {}
        return self._known

    def _exported(self, name: str, snapshot: Snapshot) -> tuple[frozenset[str], frozenset[str]]:
        """Return the variables and the packages that a package and all that it needs name for their users."""
        waiting = [name]
        while waiting:
            current = waiting[-1]
            missing = [need for need in self._needs[current] if need not in self._exports]
            if missing and current not in self._exports:
                waiting += missing
                continue
            waiting.pop()
            if current in self._exports:
                continue
            embedded = self._packages[current].embedded
            entry = _Entry("") if embedded else self._entry(current, snapshot)
            below = [self._exports[need] for need in self._needs[current]]
            self._exports[current] = (
                entry.exported.union(*(variables for variables, _ in below)),
                entry.exported_packages.union(*(packages for _, packages in below)),
            )
        return self._exports[name]

    def _scanned(self, package: Package, sources: str) -> _Entry:
        """Read the texts of a package and look up what they name."""
        home = os.path.normpath(self._kitchen.root / package.path)
        named, outside = _read_texts(home)
        for name in sorted(named.packages):
            named |= self._find_module(name) | self._config(name)
        packages = named.packages | {dependency.name for dependency in package.manifest.dependencies}
        words = (word for word in named.words if word in self._lookup.names or word.startswith("/"))
        configs = ((name, self._folder_of(name)) for name in sorted(named.packages))
        return _Entry(
            sources,
            variables=frozenset(name for name in named.variables if not counts(name)) - _VOLATILE,
            packages=packages,
            exported=frozenset(name for name in named.exported if not counts(name)) - _VOLATILE,
            exported_packages=named.exported_packages,
            programs=tuple(sorted(word for word in words if self._lookup.identity(word))),
            configs=tuple((name, folder) for name, folder in configs if folder),
            outside=tuple(outside),
            stamp=stamp_files(outside) if outside else "",
        )

    def _folder_of(self, name: str) -> str:
        """Return where find_package finds a package by PATH alone, '' where it does not."""
        found = (self._configs.folder(prefix, name) for prefix in prefixes_of_path(self._lookup.folders))
        return next(filter(None, found), "")

    def _read_find_module(self, name: str) -> Named:
        """Return what CMake's own module for a package reads."""
        root = cmake_root(self._kitchen.cmake) if self._kitchen.cmake else None
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

    def _of_arguments(self, package: Package) -> Extra:
        """Return the files and the programs that the arguments of CMake name for a package."""
        if not self._packages[package.name].build_type.endswith("cmake"):
            return Extra()
        kitchen = self._kitchen.of(package)
        words = (*kitchen.cmake_args, *kitchen.ament_cmake_args)
        relative = any(not value.startswith("/") for value in _paths(words))
        home = str(kitchen.root / package.path)
        bases = (str(kitchen.layout.build_dir(package.name)), home) if relative else ("/",)
        key = (*words, *bases)
        if key not in self._named_by_words:
            self._named_by_words[key] = named_by(words, self._variables, bases, self._lookup)
        return self._named_by_words[key]


def named_by(
    arguments: Sequence[str],
    variables: Mapping[str, str],
    bases: Sequence[str] = ("/",),
    lookup: ProgramLookup | None = None,
) -> Extra:
    """Return the contents of the files that arguments of CMake name, and programs named by both.

    Relative paths are below one of `bases`. What such a file includes counts like itself.
    """
    lookup = lookup or ProgramLookup(variables)
    values = (*_paths(arguments), variables.get("CMAKE_TOOLCHAIN_FILE", ""))
    found = (os.path.join(base, value) for value in values if value for base in bases)  # noqa: PTH118
    options, tools = [], dict(programs_in(arguments, lookup))
    waiting = [path for path in dict.fromkeys(found) if _is_text(path)]
    seen = set(waiting)
    while waiting:
        path = waiting.pop(0)
        text = _text(path)
        named = in_module(text)
        content = _digest(text) if len(text) < _LARGEST else stamp_files([path])
        options.append(f"{NAMED_FILE}'{path}', which an option names, {content}")
        here = os.path.dirname(path)  # noqa: PTH120
        for word in sorted({*named.words, *(_settled(word, here) for word in _joined_words(text))}):
            if identity := lookup.identity(word):
                tools.setdefault(word, identity)
        for included in sorted(_settled(word, here) for word in named.included):
            other = os.path.normpath(os.path.join(here, included))  # noqa: PTH118
            if other not in seen and _is_text(other):
                seen.add(other)
                waiting.append(other)
    return Extra(tuple(sorted(options)), tuple(sorted(tools.items())))


def _paths(arguments: Sequence[str]) -> Iterator[str]:
    """Yield what may be a file among the arguments of CMake."""
    words = iter(arguments)
    for word in words:
        if word in {"-C", "--toolchain"}:
            yield next(words, "")
        elif word.startswith("-C"):
            yield word[2:]
        elif word.startswith("--toolchain="):
            yield word.partition("=")[2]
    for _, value in definitions(arguments):
        yield from (part for part in value.split(";") if "/" in part or "." in part)


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


def _is_text(path: str) -> bool:
    """Tell if a path leads to a file that a build may read, not to a program."""
    return os.path.isfile(path) and (path.endswith(".cmake") or not os.access(path, os.X_OK))  # noqa: PTH113


def _text(path: str) -> str:
    """Return the text of a file, '' for one that cannot be read or is too large for a script."""
    try:
        with open(path, encoding="utf-8", errors="surrogateescape") as stream:  # noqa: PTH123
            return stream.read(_LARGEST)
    except (OSError, ValueError):
        return ""


def _digest(text: str) -> str:
    """Return a digest: a value may be a secret, and is not written down."""
    return hashlib.blake2b(text.encode(errors="surrogateescape"), digest_size=8).hexdigest()


def _written(entry: _Entry) -> list[object]:
    sets = (entry.variables, entry.packages, entry.exported, entry.exported_packages)
    return [entry.sources, *map(sorted, sets), entry.programs, entry.configs, entry.outside, entry.stamp]


def _read(said: list[Any]) -> _Entry:
    sources, variables, packages, exported, exported_packages, programs, configs, outside, stamp = said
    return _Entry(
        sources,
        frozenset(variables),
        frozenset(packages),
        frozenset(exported),
        frozenset(exported_packages),
        tuple(programs),
        tuple((name, folder) for name, folder in configs),
        tuple(outside),
        stamp,
    )
