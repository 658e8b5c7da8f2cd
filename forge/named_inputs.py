"""What each package depends on outside of the workspace because its own text, or an option, names it.

Texts are read when a package is new, or when its sources or the folders of PATH changed; what they name is
kept in a file of the build folder. A build with nothing to do compares only values and stats.
"""

from __future__ import annotations

import hashlib
import json
import os
from typing import TYPE_CHECKING, Any

from forge.digests import stamp_files
from forge.files import replace_file
from forge.freshness import WITHOUT_EFFECT, Extra, counts
from forge.frozen import frozen
from forge.program_lookup import ProgramLookup
from forge.tools import definitions, programs_in

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from forge.build_texts import Scanner
    from forge.model import Package, Pairs, Snapshot
    from forge.recipes.kitchen import Kitchen

FILE = "forge_names.json"

VOLATILE = frozenset(
    {"PATH", "PWD", "OLDPWD", "SHLVL", "_", "TERM", "COLUMNS", "LINES"}
    | {"MAKEFLAGS", "MAKELEVEL", "MFLAGS", "CTEST_PARALLEL_LEVEL"}
)
"""Variables that differ from shell to shell; of PATH counts what it leads to."""


@frozen
class Uses:
    """What texts name: variables, packages, programs; and where prefixes of PATH provide packages."""

    variables: frozenset[str] = frozenset()
    packages: frozenset[str] = frozenset()
    programs: frozenset[str] = frozenset()
    configs: frozenset[tuple[str, str]] = frozenset()

    def __or__(self, other: Uses) -> Uses:
        """Return what either of two names."""
        return Uses(
            self.variables | other.variables,
            self.packages | other.packages,
            self.programs | other.programs,
            self.configs | other.configs,
        )


_NOTHING = Uses()


@frozen
class Entry:
    """What the texts of a package name, as of sources with a digest, and what of that counts for its users.

    `outside` are files elsewhere that were read, with their `stamp`.
    """

    sources: str
    own: Uses = _NOTHING
    exported: Uses = _NOTHING
    outside: tuple[str, ...] = ()
    stamp: str = ""


@frozen
class NamedFiles:
    """What files say that arguments of CMake name: words for options, and words that may be programs."""

    options: tuple[str, ...] = ()
    words: tuple[str, ...] = ()
    read: tuple[str, ...] = ()
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
        prefixes = (variables.get(name, "") for name in ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH"))
        self._stamp = "\n".join((forge, self._lookup.stamp(), *prefixes))
        self._entries: dict[str, Entry] = {}
        self._files: dict[str, NamedFiles] = {}
        self._known: tuple[Mapping[str, Entry], Mapping[str, NamedFiles]] | None = None
        self._exports: dict[str, Uses] = {}
        said = (
            *_paths((*kitchen.cmake_args, *kitchen.ament_cmake_args)),
            variables.get("CMAKE_TOOLCHAIN_FILE"),
        )
        self._relative = any(word and not word.startswith("/") for word in said)
        self._usual: dict[bool, Extra] = {}
        """What arguments come to that are the same for all packages, and for embedded ones."""
        self._scanner: Scanner | None = None
        self._changed = False

    def of(self, package: Package, snapshot: Snapshot) -> Extra:
        """Return what a package depends on beside its sources, its needs and what all depend on."""
        arguments = self._of_arguments(package)
        if package.embedded:
            return Extra(arguments.options)
        uses = self._entry(package.name, snapshot).own
        for need in self._needs[package.name]:
            exported = self._exports.get(need) or self._exported(need, snapshot)
            if exported is not _NOTHING:
                uses |= exported
        named = uses.variables.intersection(self._variables)
        if self._places:
            packages = uses.packages.union(dependency.name for dependency in package.manifest.dependencies)
            named |= frozenset(_variables_of(packages, self._places))
        environment = [
            (name, digest_of_text(self._variables[name]))
            for name in named
            if name not in VOLATILE and name not in WITHOUT_EFFECT and not counts(name)
        ]
        if uses.configs:
            found = "; ".join(f"{name} in {folder}" for name, folder in sorted(uses.configs))
            environment.append(("PATH", found))
        programs = [(word, self._lookup.identity(word)) for word in sorted(uses.programs)]
        return Extra(
            arguments.options, self._apart((*programs, *arguments.tools)), tuple(sorted(environment))
        )

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
            entries = {**self._remembered()[0], **self._entries}
            said = {
                "stamp": self._stamp,
                "packages": {name: _written(e) for name, e in entries.items() if name in self._packages},
                "files": {key: [f.options, f.words, f.read, f.stamp] for key, f in self._files.items()},
            }
            replace_file(self._file, json.dumps(said).encode())
            self._changed = False

    def _entry(self, name: str, snapshot: Snapshot) -> Entry:
        entry = self._entries.get(name)
        if entry is None:
            entry = self._remembered()[0].get(name)
            sources = snapshot.sources[name].digest
            if (
                entry is None
                or entry.sources != sources
                or name in snapshot.moved
                or (entry.outside and stamp_files(entry.outside) != entry.stamp)
            ):
                entry = self._scan().entry(self._packages[name], sources)
                self._changed = True
            self._entries[name] = entry
        return entry

    def _scan(self) -> Scanner:
        if self._scanner is None:
            from forge.build_texts import Scanner  # noqa: PLC0415  (most builds read no text)

            kitchen = self._kitchen
            self._scanner = Scanner(kitchen.root, kitchen.cmake, self._variables, self._lookup)
        return self._scanner

    def _remembered(self) -> tuple[Mapping[str, Entry], Mapping[str, NamedFiles]]:
        if self._known is None:
            try:
                said = json.loads(self._file.read_bytes())
                fits = said["stamp"] == self._stamp
                entries = {n: _read(entry) for n, entry in said["packages"].items()} if fits else {}
                files = {n: NamedFiles(*map(_tuple, f)) for n, f in said["files"].items()} if fits else {}
                self._known = entries, files
            except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
                self._known = {}, {}
        return self._known

    def _exported(self, name: str, snapshot: Snapshot) -> Uses:
        """Return what a package and all that it needs name for their users."""
        waiting = [name]
        while waiting:
            current = waiting.pop()
            if current in self._exports:
                continue
            missing = [need for need in self._needs[current] if need not in self._exports]
            if missing:
                waiting += (current, *missing)
                continue
            embedded = self._packages[current].embedded
            uses = _NOTHING if embedded else self._entry(current, snapshot).exported
            for need in self._needs[current]:
                if self._exports[need] is not _NOTHING:
                    uses |= self._exports[need]
            self._exports[current] = uses
        return self._exports[name]

    def _of_arguments(self, package: Package) -> Extra:
        """Return the files and the programs that the arguments of CMake name for a package."""
        if not package.build_type.endswith("cmake"):
            return Extra()
        usual = not (package.settings or self._relative)
        if usual and package.embedded in self._usual:
            return self._usual[package.embedded]
        kitchen = self._kitchen.of(package)
        words = (*kitchen.cmake_args, *kitchen.ament_cmake_args)
        bases = (str(kitchen.layout.build_dir(package.name)), str(kitchen.root / package.path))
        paths = named_paths(words, self._variables, bases)
        key = "\0".join(paths)
        if paths and key not in self._files:
            known = self._remembered()[1].get(key)
            if known is None or stamp_files(known.read) != known.stamp:
                known = read_files(paths)
                self._changed = True
            self._files[key] = known
        found = _extra(words, self._files[key] if paths else NamedFiles(), self._lookup)
        if usual:
            self._usual[package.embedded] = found
        return found


def named_by(arguments: Sequence[str], variables: Mapping[str, str]) -> Extra:
    """Return the contents of files, and the programs, that arguments of CMake for all packages name."""
    paths = named_paths(arguments, variables)
    return _extra(arguments, read_files(paths) if paths else NamedFiles(), ProgramLookup(variables))


def named_paths(
    arguments: Sequence[str], variables: Mapping[str, str], bases: Sequence[str] = ("/",)
) -> tuple[str, ...]:
    """Return the files, no programs, that arguments or the environment name; relative ones below a base."""
    words = (*_paths(arguments), variables.get("CMAKE_TOOLCHAIN_FILE", ""))
    found = (os.path.join(base, word) for word in words if word for base in bases)  # noqa: PTH118
    return tuple(path for path in dict.fromkeys(found) if is_text(path))


def read_files(paths: Sequence[str]) -> NamedFiles:
    """Read files that arguments of CMake name."""
    from forge.build_texts import read_named_files  # noqa: PLC0415  (most builds read no text)

    return read_named_files(paths)


def is_text(path: str) -> bool:
    """Tell if a path leads to a file that a build may read, not to a program."""
    return os.path.isfile(path) and (path.endswith(".cmake") or not os.access(path, os.X_OK))  # noqa: PTH113


def _extra(arguments: Sequence[str], files: NamedFiles, lookup: ProgramLookup) -> Extra:
    tools = dict(programs_in(arguments, lookup))
    for word in files.words:
        if identity := lookup.identity(word):
            tools.setdefault(word, identity)
    return Extra(files.options, tuple(sorted(tools.items())))


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


def _variables_of(packages: Iterable[str], names: Iterable[str]) -> Iterator[str]:
    """Yield those of `names` in which find_package looks for one of `packages`, as NAME_ROOT and NAME_DIR."""
    known = frozenset(packages)
    for name in names:
        package, _, ending = name.rpartition("_")
        if package in known or (
            ending == "ROOT" and package.isupper() and package.lower() in map(str.lower, known)
        ):
            yield name


def digest_of_text(text: str) -> str:
    """Return a digest: a value may be a secret, and is not written down."""
    return hashlib.blake2b(text.encode(errors="surrogateescape"), digest_size=8).hexdigest()


def _written(entry: Entry) -> list[object]:
    uses = ([sorted(field) for field in _fields(each)] for each in (entry.own, entry.exported))
    return [entry.sources, *uses, entry.outside, entry.stamp]


def _fields(uses: Uses) -> tuple[frozenset[Any], ...]:
    return (uses.variables, uses.packages, uses.programs, uses.configs)


def _read(said: list[Any]) -> Entry:
    sources, own, exported, outside, stamp = said
    return Entry(sources, _uses(*own), _uses(*exported) if any(exported) else _NOTHING, tuple(outside), stamp)


def _uses(variables: list[str], packages: list[str], programs: list[str], configs: list[list[str]]) -> Uses:
    found = frozenset((name, folder) for name, folder in configs)
    return Uses(frozenset(variables), frozenset(packages), frozenset(programs), found)


def _tuple(said: list[str] | str) -> Any:  # noqa: ANN401  (a field of one type or the other)
    return said if isinstance(said, str) else tuple(said)
