"""External inputs of a package that its build scripts or an option name: variables, programs and files.

Build scripts are read if a package is new, or if its sources or the folders of PATH changed; the names in
them are cached in a file in the build folder. A build with nothing to do only compares values and stats.
"""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING

from forge.base.cmake_syntax import cmake_arguments, definitions
from forge.base.files import replace_file
from forge.base.layout import NAMED_INPUTS_FILE
from forge.build.build_types import find_build_type
from forge.build.inputs.fingerprints import stamp_files
from forge.build.inputs.named_entries import (
    NOTHING,
    VOLATILE,
    Entry,
    NamedFiles,
    Uses,
    decode_entry,
    decode_files,
    digest_of_text,
    encode_entry,
    is_text,
)
from forge.build.up_to_date import FOUND_BY_PATH, WITHOUT_EFFECT, ExtraInputs, is_relevant
from forge.toolchain.programs import ProgramLookup, programs_in

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from forge.base.frozen import Pairs
    from forge.build.inputs.build_texts import Scanner
    from forge.build.model import Snapshot
    from forge.build.recipes.context import BuildContext
    from forge.workspace.model import Package


class ReferencedInputs:
    """The variables, programs and files that packages name, with their current values."""

    def __init__(
        self,
        context: BuildContext,
        needs: Mapping[str, frozenset[str]],
        packages: Mapping[str, Package],
        variables: Mapping[str, str],
        forge: str,
    ) -> None:
        """Store the parameters; the cache file of another `forge` version is not used."""
        self._file = context.layout.build / NAMED_INPUTS_FILE
        self._context = context
        self._needs = needs
        self._packages = packages
        self._variables = variables
        self._path_variables = frozenset(name for name in variables if name.endswith(("_ROOT", "_DIR")))
        self._lookup = ProgramLookup(variables)
        prefixes = (variables.get(name, "") for name in ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH"))
        self._stamp = digest_of_text("\n".join((forge, self._lookup.stamp(), *prefixes)))
        self._entries: dict[str, Entry] = {}
        self._files: dict[str, NamedFiles] = {}
        self._known: tuple[Mapping[str, Entry], Mapping[str, NamedFiles]] | None = None
        self._exports: dict[str, Uses] = {}
        data = (
            *_paths((*context.cmake_args, *context.ament_cmake_args)),
            variables.get("CMAKE_TOOLCHAIN_FILE"),
        )
        self._relative = any(word and not word.startswith("/") for word in data)
        self._shared: dict[tuple[str, ...], ExtraInputs] = {}
        """The inputs named by arguments without relative paths."""
        self._scanner: Scanner | None = None
        self._changed = False

    def of(self, package: Package, snapshot: Snapshot) -> ExtraInputs:
        """Return the inputs of a package besides its sources, its dependencies and the shared inputs."""
        arguments = self._of_arguments(package)
        if package.embedded:
            return ExtraInputs(arguments.options)
        uses = self._entry(package.name, snapshot).own
        for need in self._needs[package.name]:
            exported = self._exports.get(need) or self._exported(need, snapshot)
            if exported is not NOTHING:
                uses |= exported
        named = uses.variables.intersection(self._variables)
        if self._path_variables:
            packages = uses.packages.union(dependency.name for dependency in package.manifest.dependencies)
            named |= frozenset(_variables_of(packages, self._path_variables))
        environment = [
            (name, digest_of_text(self._variables[name]))
            for name in named
            if name not in VOLATILE and name not in WITHOUT_EFFECT and not is_relevant(name)
        ]
        if uses.configs:
            found = "; ".join(f"{name} in {folder}" for name, folder in sorted(uses.configs))
            environment.append((FOUND_BY_PATH, found))
        programs = [(word, self._lookup.identity(word)) for word in sorted(uses.programs)]
        return ExtraInputs(
            arguments.options, self._without_shared((*programs, *arguments.tools)), tuple(sorted(environment))
        )

    def _without_shared(self, tools: Pairs) -> Pairs:
        """Return the programs without the shared ones; rename programs with the name of a shared one."""
        shared = dict(self._context.tools)
        return tuple(
            (f"{name} of PATH" if name in shared else name, identity)
            for name, identity in tools
            if shared.get(name) != identity
        )

    def save(self) -> None:
        """Write the cache file if it has changed."""
        if self._changed:
            entries = {**self._stored()[0], **self._entries}
            data = {
                "stamp": self._stamp,
                "packages": {name: encode_entry(e) for name, e in entries.items() if name in self._packages},
                "files": {key: [f.options, f.words, f.read, f.stamp] for key, f in self._files.items()},
            }
            replace_file(self._file, json.dumps(data).encode())
            self._changed = False

    def _entry(self, name: str, snapshot: Snapshot) -> Entry:
        entry = self._entries.get(name)
        if entry is None:
            entry = self._stored()[0].get(name)
            build_type = find_build_type(self._packages[name].build_type)
            sources = f"{snapshot.sources[name].digest}{build_type.code if build_type else ''}"
            if (
                entry is None
                or entry.sources != sources
                or name in snapshot.changed_externals
                or (entry.outside and stamp_files(entry.outside) != entry.stamp)
            ):
                entry = self._scan().entry(self._packages[name], sources)
                self._changed = True
            self._entries[name] = entry
        return entry

    def _scan(self) -> Scanner:
        if self._scanner is None:
            from forge.build.inputs.build_texts import Scanner

            context = self._context
            self._scanner = Scanner(context.root, context.cmake, self._variables, self._lookup)
        return self._scanner

    def _stored(self) -> tuple[Mapping[str, Entry], Mapping[str, NamedFiles]]:
        if self._known is None:
            try:
                data = json.loads(self._file.read_bytes())
                fits = data["stamp"] == self._stamp
                entries = {n: decode_entry(entry) for n, entry in data["packages"].items()} if fits else {}
                files = {n: decode_files(f) for n, f in data["files"].items()} if fits else {}
                self._known = entries, files
            except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
                self._known = {}, {}
        return self._known

    def _exported(self, name: str, snapshot: Snapshot) -> Uses:
        """Return the names exported by a package and its dependencies."""
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
            uses = NOTHING if embedded else self._entry(current, snapshot).exported
            for need in self._needs[current]:
                if self._exports[need] is not NOTHING:
                    uses |= self._exports[need]
            self._exports[current] = uses
        return self._exports[name]

    def _of_arguments(self, package: Package) -> ExtraInputs:
        """Return the files and programs that the CMake arguments of a package name."""
        if not package.build_type.endswith("cmake"):
            return ExtraInputs()
        is_shared = not (package.settings or self._relative)
        context = self._context.of(package)
        words = context.cmake_args
        if is_shared and words in self._shared:
            return self._shared[words]
        bases = (str(context.layout.build_dir(package.name)), str(context.root / package.path))
        paths = named_paths(words, self._variables, bases)
        key = "\0".join(paths)
        if paths and key not in self._files:
            known = self._stored()[1].get(key)
            if known is None or stamp_files(known.read) != known.stamp:
                known = read_files(paths)
                self._changed = True
            self._files[key] = known
        found = _extra(words, self._files[key] if paths else NamedFiles(), self._lookup)
        if is_shared:
            self._shared[words] = found
        return found


def named_by(arguments: Sequence[str], variables: Mapping[str, str]) -> ExtraInputs:
    """Return the files and programs that CMake arguments for all packages name."""
    paths = named_paths(arguments, variables)
    return _extra(arguments, read_files(paths) if paths else NamedFiles(), ProgramLookup(variables))


def named_paths(
    arguments: Sequence[str], variables: Mapping[str, str], bases: Sequence[str] = ("/",)
) -> tuple[str, ...]:
    """Return the files, not programs, named by arguments or the environment; relative ones in each base."""
    words = (*_paths(arguments), variables.get("CMAKE_TOOLCHAIN_FILE", ""))
    found = (os.path.join(base, word) for word in words if word for base in bases)  # noqa: PTH118
    return tuple(path for path in dict.fromkeys(found) if is_text(path))


def read_files(paths: Sequence[str]) -> NamedFiles:
    """Read files named by CMake arguments."""
    from forge.build.inputs.build_texts import read_named_files

    return read_named_files(paths)


def _extra(arguments: Sequence[str], files: NamedFiles, lookup: ProgramLookup) -> ExtraInputs:
    tools = dict(programs_in(arguments, lookup))
    for word in files.words:
        if identity := lookup.identity(word):
            tools.setdefault(word, identity)
    return ExtraInputs(files.options, tuple(sorted(tools.items())))


def _paths(arguments: Sequence[str]) -> Iterator[str]:
    """Yield the CMake arguments that may be files."""
    found = cmake_arguments(arguments)
    yield from (argument.value for argument in found if argument.option in {"-C", "--toolchain"})
    for _, value in definitions(arguments):
        yield from (part for part in value.split(";") if "/" in part or "." in part)


def _variables_of(packages: Iterable[str], names: Iterable[str]) -> Iterator[str]:
    """Yield those `names` that find_package reads for one of `packages`: NAME_ROOT and NAME_DIR."""
    known = frozenset(packages)
    for name in names:
        package, _, ending = name.rpartition("_")
        if package in known or (
            ending == "ROOT" and package.isupper() and package.lower() in map(str.lower, known)
        ):
            yield name
