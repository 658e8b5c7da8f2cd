"""Finds the programs of a build; packages are rebuilt if the path, size or time of one changes."""

from __future__ import annotations

import importlib.util
import os
import re
import stat
import sys
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache, cached_property
from itertools import islice
from pathlib import Path

from forge.base.errors import HostError, Problem, raise_if_any
from forge.base.files import names_in, text_or_nothing
from forge.base.frozen import Pairs, frozen
from forge.base.own_environment import extra_command, install_beside_forge
from forge.base.text import counted, digest
from forge.toolchain.compiler_launchers import LAUNCHERS
from forge.workspace.model import CMAKE_TYPES, Package

_INSIDE = ("", "/cmake", "/CMake")
_LIBRARIES = ("lib64", "lib32", "libx32", "lib", "share")
COMPILERS = ("c++", "g++", "clang++", "cc", "gcc", "clang")
_NAMES_COMPILER = re.compile(r"COMPILER|TOOLCHAIN|INCLUDE|--toolchain|--preset|(?:^| )-C")
_NAMES_BUILDER = re.compile(r"CMAKE_MAKE_PROGRAM|TOOLCHAIN|--toolchain|--preset|(?:^| )-[CG]")


@frozen
class Tools:
    """The programs found; `only_make` are packages that call $(MAKE), which other generators cannot build."""

    cmake: Path
    ninja: Path | None = None
    make: Path | None = None
    only_make: frozenset[str] = frozenset()
    launcher: Path | None = None


def find_tools(
    packages: Iterable[Package],
    variables: Mapping[str, str],
    launcher: str = "",
    *,
    has_compiler: bool = False,
    cmake_args: Sequence[str] = (),
) -> Tools | None:
    """Return the programs to build `packages`, None if none of them needs CMake.

    `launcher` is the name of the compiler launcher, if any; with `has_compiler`, no compiler is required on
    PATH. Raises HostError with all programs that are certainly missing: `cmake_args` and a package's own
    arguments may name others.
    """
    cmake_packages = [package for package in packages if package.build_type in CMAKE_TYPES]
    if not cmake_packages:
        return None
    arguments = {
        package.name: " ".join(
            (*cmake_args, *package.option_values("cmake-args"), *package.option_values("ament-cmake-args"))
        )
        for package in cmake_packages
    }
    cmake = find_cmake(variables)
    ninja = find_ninja(variables)
    make = find_program("make", variables)
    problems = []
    if cmake is None:
        problems.append(no_cmake(cmake_packages))
    elif not (ninja or make or "CMAKE_GENERATOR" in variables):
        without = [each for each in cmake_packages if not _NAMES_BUILDER.search(arguments[each.name])]
        problems += [no_builder(without)] if without else []
    launcher_path = find_program(launcher, variables) if launcher else None
    if launcher and launcher_path is None:
        hint = LAUNCHERS[launcher]
        problems.append(Problem(f"compiler launcher '{launcher}' not found on PATH", hint=hint))
    own = (package for package in cmake_packages if not package.embedded)
    texts = [(package, text_or_nothing(package.path / "CMakeLists.txt")) for package in own]
    path = variables.get("PATH", os.defpath)
    if not (
        has_compiler
        or not {"CC", "CXX", "CMAKE_TOOLCHAIN_FILE"}.isdisjoint(variables)
        or any(_which(name, path) for name in COMPILERS)
    ):
        from forge.workspace.cmake_text import certainly_compiles

        compiled = [
            package
            for package, text in texts
            if certainly_compiles(text) and not _NAMES_COMPILER.search(arguments[package.name])
        ]
        problems += [no_compiler(compiled)] if compiled else []
    raise_if_any(problems, HostError)
    assert cmake is not None
    only_make = frozenset(package.name for package, text in texts if calls_make(text))
    return Tools(cmake, ninja, make, only_make, launcher_path)


def no_cmake(packages: Sequence[Package]) -> Problem:
    return Problem(f"CMake not found; {_dependents(packages)} it", hint=_cmake_hint())


def _cmake_hint() -> str:
    return f"install your distribution's cmake package, or CMake beside forge: {extra_command('cmake')}"


def no_builder(packages: Sequence[Package]) -> Problem:
    hint = f"install Ninja, `{install_beside_forge('ninja')}`, or make with your distribution's package"
    return Problem(f"neither Ninja nor make found; {_dependents(packages)} one", hint=hint)


def no_compiler(packages: Sequence[Package]) -> Problem:
    hint = "install g++ or clang++, for example with `apt install g++` or `dnf install gcc-c++`, or set CXX"
    return Problem(f"no C++ compiler found; {_dependents(packages)} one", hint=hint)


def ninja_first(ninja: Path | None, folder: Path, variables: Mapping[str, str]) -> dict[str, str]:
    """Return a PATH on which packages that run CMake themselves find the same Ninja; empty if it is first."""
    path = variables.get("PATH", os.defpath)
    if ninja is None or _which("ninja", path) == str(ninja):
        return {}
    link = folder / ninja.name
    if not (link.is_symlink() and link.readlink() == ninja):
        folder.mkdir(parents=True, exist_ok=True)
        link.unlink(missing_ok=True)
        link.symlink_to(ninja)
    return {"PATH": f"{folder}{os.pathsep}{path}"}


def find_ctest(variables: Mapping[str, str]) -> Path:
    """Return CTEST_COMMAND, else the ctest next to CMake, else from PATH; raises HostError."""
    if named := variables.get("CTEST_COMMAND"):
        return Path(named)
    cmake = find_cmake(variables)
    beside = cmake.with_name("ctest") if cmake else None
    ctest = beside if beside and beside.is_file() else find_program("ctest", variables)
    if ctest is None:
        raise HostError(Problem("ctest, which is part of CMake, not found", hint=_cmake_hint()))
    return ctest


def identities(
    tools: Tools | None,
    python: Path,
    variables: Mapping[str, str],
    more: Sequence[Path] = (),
) -> Pairs:
    """Return the programs whose replacement changes build results, each with its identity.

    `more` are the programs of a toolchain. Programs that no selected package needs also count: otherwise, the
    inputs of a package would depend on the selection.
    """
    by_name = {"python": _identity(python), **{str(program): _identity(program) for program in more}}
    lookup = ProgramLookup(variables)
    for name, program in (
        ("cmake", tools.cmake if tools else find_cmake(variables)),
        ("ninja", tools.ninja if tools else find_ninja(variables)),
        ("make", tools.make if tools else find_program("make", variables)),
    ):
        if program:
            by_name[name] = _identity(program)
    for name, variable in _COMPILING.items():
        for word in (variables.get(variable) or name).split()[:1]:
            if identity := lookup.identity(word):
                by_name[name] = identity
    return tuple(sorted(by_name.items()))


def condensed(tools: Pairs) -> Pairs:
    """Return the programs for the build records, with binutils condensed into one hash."""
    binutils = digest(*(f"{name} {identity}" for name, identity in tools if name in _BINUTILS))
    return tuple(sorted((*(pair for pair in tools if pair[0] not in _BINUTILS), (BINUTILS, binutils))))


def cmake_root(cmake: Path) -> Path | None:
    """Return the folder of CMake's modules; None if it is not next to the program."""
    roots = sorted((cmake.resolve().parents[1] / "share").glob("cmake*"))
    return next((root for root in roots if (root / "Modules" / "CMakeDetermineSystem.cmake").is_file()), None)


def program_of(identity: str) -> str:
    """Return the path in one of `identities`."""
    return identity.removesuffix(_GONE) if identity.endswith(_GONE) else identity.rsplit(" ", 2)[0]


_GONE = " is not there"

BINUTILS = "binutils"
_BINUTILS = frozenset({"ar", "as", "ld", "nm", "objcopy", "ranlib", "strip"})
_COMPILING = {"cc": "CC", "c++": "CXX", **{name: name.upper() for name in sorted(_BINUTILS)}}
"""Compilers and binutils, and the variables that override them."""


def _identity(program: Path) -> str:
    try:
        status = program.stat()
    except OSError:
        return f"{program}{_GONE}"
    return f"{program.resolve()} {status.st_size} {status.st_mtime_ns}"


def find_program(program: str, variables: Mapping[str, str]) -> Path | None:
    """Return a program from PATH, else from the folder of the interpreter that runs forge."""
    here = str(Path(sys.executable).parent)
    path = _which(program, os.pathsep.join([variables.get("PATH", os.defpath), here]))
    return Path(path) if path else None


def _which(program: str, path: str) -> str | None:
    """Like shutil.which, whose module takes 3 ms to import."""
    folders = [""] if os.sep in program else path.split(os.pathsep)
    candidates = (os.path.join(folder, program) for folder in folders)
    return next((each for each in candidates if os.access(each, os.X_OK) and not os.path.isdir(each)), None)


def find_ninja(variables: Mapping[str, str]) -> Path | None:
    """Return NINJA, else the wheel's, as distributions' lack the jobserver, else that on PATH."""
    if named := variables.get("NINJA"):
        return Path(named)
    beside = Path(sys.executable).with_name("ninja")
    if importlib.util.find_spec("ninja") is not None and beside.is_file():
        return beside
    return find_program("ninja", variables)


def find_cmake(variables: Mapping[str, str]) -> Path | None:
    """Return CMAKE_COMMAND, else CMake from PATH, else the program that the wheel's Python script starts."""
    if named := variables.get("CMAKE_COMMAND"):
        return Path(named)
    cmake = find_program("cmake", variables)
    if cmake is None or cmake.parent == Path(sys.executable).parent:
        wheel = importlib.util.find_spec("cmake")
        for folder in (wheel and wheel.submodule_search_locations) or ():
            program = Path(folder) / "data" / "bin" / "cmake"
            if program.is_file():
                return program
    return cmake


def calls_make(text: str) -> bool:
    """Return whether a CMakeLists.txt calls $(MAKE), as for external projects; only makefiles support it."""
    return "$(MAKE)" in text


def _dependents(packages: Sequence[Package]) -> str:
    if not packages:
        return "CMake packages need"
    first, rest = f"'{packages[0].name}'", len(packages) - 1
    return f"{first} and {counted(rest, 'more package')} need" if rest else f"{first} needs"


class ProgramLookup:
    """Looks up programs on one PATH; results are cached, so that a build sees a consistent state."""

    def __init__(self, variables: Mapping[str, str]) -> None:
        path = variables.get("PATH", os.defpath)
        self.folders = tuple(dict.fromkeys(folder for folder in path.split(os.pathsep) if folder))
        self.identity = cache(self._identity)
        self._real = cache(os.path.realpath)

    @cached_property
    def names(self) -> frozenset[str]:
        return frozenset(name for folder in self.folders for name in names_in(folder))

    def _identity(self, word: str) -> str:
        """Return path, size and time of a program given by name or path, '' if it does not exist.

        The path is normalized, so that links between folders such as /bin and /usr/bin make no difference.
        """
        for path in [word] if os.sep in word else [f"{folder}/{word}" for folder in self.folders]:
            try:
                status = os.stat(path)
            except (OSError, ValueError):
                continue
            if stat.S_ISREG(status.st_mode) and status.st_mode & 0o111:
                folder, _, name = path.rpartition("/")
                return f"{self._real(folder)}/{name} {status.st_size} {status.st_mtime_ns}"
        return ""


def prefixes_of_path(folders: Sequence[str]) -> tuple[str, ...]:
    """Return the prefixes that CMake derives from PATH: the parents of 'bin' and 'sbin'."""
    pairs = (folder.rstrip("/").rpartition("/") for folder in folders)
    return tuple(dict.fromkeys(above or "/" for above, _, last in pairs if last in {"bin", "sbin"}))


class ConfigSearch:
    """Searches config files; each folder is read once."""

    def __init__(self) -> None:
        self._bases = cache(self._find_bases)
        self._listed = cache(self._sorted_entries)

    def folder(self, prefix: str, name: str) -> str:
        """Return the real folder of a package's config file below a prefix, '' if there is none."""
        files = (f"{name}Config.cmake", f"{name.lower()}-config.cmake")
        for folder in self._candidates(prefix, name.lower()):
            if any((file.lower(), file) in self._listed(folder) for file in files):
                return os.path.realpath(folder)
        return ""

    def _candidates(self, prefix: str, name: str) -> Iterator[str]:
        """Yield the folders below a prefix that CMake searches, ignoring the case of the name."""
        yield from (f"{prefix}{below}" for below in _INSIDE)
        for entry in self._named(prefix, name):
            yield from (f"{prefix}/{entry}{below}" for below in _INSIDE)
        for base in self._bases(prefix):
            yield from (f"{base}/cmake/{entry}" for entry in self._named(f"{base}/cmake", name))
            for entry in self._named(base, name):
                yield from (f"{base}/{entry}{below}" for below in _INSIDE)

    def _find_bases(self, prefix: str) -> tuple[str, ...]:
        native = (f"lib/{entry}" for _, entry in self._listed(f"{prefix}/lib") if "-linux-" in entry)
        return tuple(f"{prefix}/{below}" for below in (*native, *_LIBRARIES))

    def _named(self, folder: str, name: str) -> Iterator[str]:
        listed = self._listed(folder)
        for low, entry in islice(listed, bisect_left(listed, (name, "")), None):
            if not low.startswith(name):
                break
            yield entry

    @staticmethod
    def _sorted_entries(folder: str) -> list[tuple[str, str]]:
        """Return the entries of a folder as (lower-case name, name), sorted."""
        return sorted((entry.lower(), entry) for entry in names_in(folder))
