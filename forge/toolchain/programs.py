"""Finds the programs of a build: CMake, Ninja, make and compilers."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.cmake_syntax import definitions
from forge.base.digests import digest
from forge.base.errors import HostError, Problem, raise_if_any
from forge.base.files import text_or_nothing
from forge.base.frozen import frozen
from forge.base.own_environment import extra_command, install_beside_forge
from forge.base.text import counted
from forge.toolchain.compiler_launchers.choice import not_found
from forge.toolchain.program_lookup import ProgramLookup
from forge.workspace.cmake_text import calls

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from forge.base.frozen import Pairs
    from forge.workspace.model import Package

CMAKE_TYPES = frozenset({"ament_cmake", "cmake"})
PYTHON_TYPES = frozenset({"ament_python", "python"})

_COMPILERS = ("c++", "g++", "clang++", "cc", "gcc", "clang")
_BEFORE_PROJECT = frozenset({"cmake_minimum_required", "cmake_policy", "message", "set"})
PROJECT_DETAILS = frozenset({"COMPAT_VERSION", "DESCRIPTION", "HOMEPAGE_URL", "SPDX_LICENSE", "VERSION"})
_NAMES_COMPILER = re.compile(r"COMPILER|TOOLCHAIN|INCLUDE|--toolchain|--preset|(?:^| )-C")
_NAMES_BUILDER = re.compile(r"CMAKE_MAKE_PROGRAM|TOOLCHAIN|--toolchain|--preset|(?:^| )-[CG]")


@frozen
class Tools:
    """The programs found; `ninja` and `make` are None if they are not installed.

    `only_make` are packages that call $(MAKE), so that other generators cannot build them.
    """

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

    `launcher` is the name of the compiler launcher, if any; `has_compiler` if a compiler need not be on PATH.
    Raises HostError with all programs that are certainly missing: `cmake_args` and a package's own
    arguments may name others.
    """
    cmake_packages = [package for package in packages if package.build_type in CMAKE_TYPES]
    if not cmake_packages:
        return None
    arguments = {
        package.name: " ".join((*cmake_args, *_own_arguments(package))) for package in cmake_packages
    }
    cmake = find_cmake(variables)
    ninja = find_ninja(variables)
    make = find_program("make", variables)
    problems = []
    if cmake is None:
        problems.append(no_cmake(cmake_packages))
    elif not (ninja or make or "CMAKE_GENERATOR" in variables):
        without = [
            package for package in cmake_packages if not _NAMES_BUILDER.search(arguments[package.name])
        ]
        problems += [no_builder(without)] if without else []
    launcher_path = find_program(launcher, variables) if launcher else None
    if launcher and launcher_path is None:
        problems.append(not_found(launcher))
    texts = [(package, _project_text(package)) for package in cmake_packages if not package.embedded]
    if not (has_compiler or _has_compiler(variables) or "CMAKE_TOOLCHAIN_FILE" in variables):
        compiled = [
            package
            for package, text in texts
            if _certainly_compiles(text) and not _NAMES_COMPILER.search(arguments[package.name])
        ]
        problems += [no_compiler(compiled)] if compiled else []
    raise_if_any(problems, HostError)
    assert cmake is not None
    only_make = frozenset(package.name for package, text in texts if calls_make(text))
    return Tools(cmake, ninja, make, only_make, launcher_path)


def _own_arguments(package: Package) -> tuple[str, ...]:
    return (*package.option_values("cmake-args"), *package.option_values("ament-cmake-args"))


def no_cmake(packages: Sequence[Package]) -> Problem:
    return Problem(f"CMake not found; {_dependents(packages)} it", hint=_cmake_hint())


def _cmake_hint() -> str:
    return f"install your distribution's cmake package, or CMake beside forge: {extra_command('cmake')}"


def no_builder(packages: Sequence[Package]) -> Problem:
    """Return a problem for missing Ninja and make."""
    hint = f"install Ninja, `{install_beside_forge('ninja')}`, or make with your distribution's package"
    return Problem(f"neither Ninja nor make found; {_dependents(packages)} one", hint=hint)


def no_compiler(packages: Sequence[Package]) -> Problem:
    hint = "install g++ or clang++, for example with `apt install g++` or `dnf install gcc-c++`, or set CXX"
    return Problem(f"no C++ compiler found; {_dependents(packages)} one", hint=hint)


def compiled_packages(packages: Iterable[Package]) -> list[Package]:
    """Return the packages whose project() enables a language."""
    cmake_packages = (package for package in packages if package.build_type in CMAKE_TYPES)
    return [package for package in cmake_packages if _compiles(_project_text(package))]


def compiler_words(variables: Mapping[str, str]) -> list[str]:
    """Return the C++ compiler command: CXX, else the first compiler on PATH; empty without one."""
    if variables.get("CXX", "").strip():
        return variables["CXX"].split()
    found = (shutil.which(name, path=variables.get("PATH", os.defpath)) for name in _COMPILERS)
    return [name for name in found if name][:1]


def ninja_first(ninja: Path | None, folder: Path, variables: Mapping[str, str]) -> dict[str, str]:
    """Return PATH with a folder in front that contains only `ninja`; empty if it is already first.

    Packages that run CMake themselves, as for an external project, then use the same Ninja.
    """
    path = variables.get("PATH", os.defpath)
    if ninja is None or shutil.which("ninja", path=path) == str(ninja):
        return {}
    link = folder / ninja.name
    if not (link.is_symlink() and link.readlink() == ninja):
        folder.mkdir(parents=True, exist_ok=True)
        link.unlink(missing_ok=True)
        link.symlink_to(ninja)
    return {"PATH": f"{folder}{os.pathsep}{path}"}


def find_ctest(variables: Mapping[str, str]) -> Path:
    """Return CTEST_COMMAND, else the ctest next to CMake, else from PATH; raises HostError."""
    named = variables.get("CTEST_COMMAND")
    if named:
        return Path(named)
    cmake = find_cmake(variables)
    beside = cmake.with_name("ctest") if cmake else None
    found = beside if beside and beside.is_file() else find_program("ctest", variables)
    if found is None:
        raise HostError(Problem("ctest, which is part of CMake, not found", hint=_cmake_hint()))
    return found


def identities(
    tools: Tools | None,
    python: Path,
    variables: Mapping[str, str],
    arguments: Sequence[str] = (),
    more: Sequence[Path] = (),
) -> Pairs:
    """Return the programs whose replacement changes build results, each with its identity.

    `arguments` are CMake's arguments for all packages, `more` the programs of a toolchain. Programs that no
    selected package needs count as well: otherwise, the inputs of a package would depend on those with which
    it is selected.
    """
    found = {"python": _identity(python), **{str(program): _identity(program) for program in more}}
    lookup = ProgramLookup(variables)
    cmake = tools.cmake if tools else find_cmake(variables)
    ninja = tools.ninja if tools else find_ninja(variables)
    make = tools.make if tools else find_program("make", variables)
    for name, program in (("cmake", cmake), ("ninja", ninja), ("make", make)):
        if program:
            found[name] = _identity(program)
    for name, variable in _COMPILING.items():
        found |= _resolve_wrappers(name, variables.get(variable) or name, lookup)
    for variable in _NAMED_PROGRAMS:
        if variables.get(variable, "").strip():
            found |= _resolve_wrappers(variable, variables[variable], lookup)
    flags = " ".join((*arguments, *(variables.get(name, "") for name in _FLAGS)))
    for linker in dict.fromkeys(re.findall(_USE_LINKER, flags)) if "-fuse-ld" in flags else ():
        for name in (linker, f"ld.{linker}", f"ld64.{linker}"):
            if identity := lookup.identity(name):
                found[name] = identity
    return tuple(sorted(found.items()))


def condensed(tools: Pairs) -> Pairs:
    """Return the programs for the build records, with binutils condensed into one hash."""
    binutils = digest(*(f"{name} {identity}" for name, identity in tools if name in _BINUTILS))
    return tuple(sorted((*(pair for pair in tools if pair[0] not in _BINUTILS), (BINUTILS, binutils))))


def programs_in(arguments: Sequence[str], lookup: ProgramLookup) -> Pairs:
    """Return the programs named in CMake definitions such as -DCMAKE_C_COMPILER=clang."""
    found: dict[str, str] = {}
    for name, value in definitions(arguments):
        if name.endswith(_PROGRAM_VARIABLES) or value.startswith("/"):
            found |= _resolve_wrappers(name, value.replace(";", " "), lookup)
    return tuple(sorted(found.items()))


def cmake_root(cmake: Path) -> Path | None:
    """Return the folder of CMake's modules; None if it is not next to the program."""
    roots = sorted((cmake.resolve().parents[1] / "share").glob("cmake*"))
    return next((root for root in roots if (root / "Modules" / "CMakeDetermineSystem.cmake").is_file()), None)


def _resolve_wrappers(name: str, words: str, lookup: ProgramLookup) -> dict[str, str]:
    """Return the programs in a command: the first one under the given name, others with a number."""
    found: dict[str, str] = {}
    for word in words.split():
        for identity in lookup.behind(word) if not word.startswith("-") else ():
            if identity not in found.values():
                found[f"{name} {len(found) + 1}" if found else name] = identity
    return found


def program_of(identity: str) -> str:
    """Return the path in one of `identities`."""
    return identity.removesuffix(_GONE) if identity.endswith(_GONE) else identity.rsplit(" ", 2)[0]


_GONE = " is not there"

BINUTILS = "binutils"
_BINUTILS = frozenset({"ar", "as", "ld", "nm", "objcopy", "ranlib", "strip"})
_COMPILING = {"cc": "CC", "c++": "CXX", **{name: name.upper() for name in sorted(_BINUTILS)}}
"""Compilers and binutils, and the variables that override them."""
_NAMED_PROGRAMS = (
    *("ASM", "CCACHE_COMPILER", "CPP", "CUDACXX", "CUDAHOSTCXX", "FC", "HIPCXX", "ISPC"),
    *("LDCXXSHARED", "LDSHARED", "OBJC", "OBJCXX", "PKG_CONFIG"),
)
"""Variables that name build programs."""
_FLAGS = ("CFLAGS", "CXXFLAGS", "LDFLAGS", "LDSHARED")
_USE_LINKER = r"-fuse-ld=([^\s\"';]+)"
_PROGRAM_VARIABLES = (
    *("_COMPILER", "_LAUNCHER", "_LINKER", "_AR", "_RANLIB", "_NM", "_OBJCOPY", "_OBJDUMP", "_READELF"),
    *("_STRIP", "_EXECUTABLE", "_PROGRAM", "_COMMAND", "_EMULATOR", "_ADDR2LINE"),
)
"""Suffixes of CMake variables that name programs."""


def _identity(program: Path) -> str:
    try:
        status = program.stat()
    except OSError:
        return f"{program}{_GONE}"
    return f"{program.resolve()} {status.st_size} {status.st_mtime_ns}"


def find_program(program: str, variables: Mapping[str, str]) -> Path | None:
    """Return a program from PATH, else from the folder of the interpreter that runs forge."""
    here = str(Path(sys.executable).parent)
    found = shutil.which(program, path=os.pathsep.join([variables.get("PATH", os.defpath), here]))
    return Path(found) if found else None


def find_ninja(variables: Mapping[str, str]) -> Path | None:
    """Return NINJA, as in Meson, else the wheel's next to the interpreter, else from PATH.

    The wheel's Ninja supports the jobserver; that of a distribution rarely does, and would build the last
    large package with the few jobs that were free when it started.
    """
    named = variables.get("NINJA")
    if named:
        return Path(named)
    beside = Path(sys.executable).with_name("ninja")
    if importlib.util.find_spec("ninja") is not None and beside.is_file():
        return beside
    return find_program("ninja", variables)


def find_cmake(variables: Mapping[str, str]) -> Path | None:
    """Return CMAKE_COMMAND, else CMake from PATH, else the wheel's.

    The wheel's command is a Python script; return the program that it starts.
    """
    named = variables.get("CMAKE_COMMAND")
    if named:
        return Path(named)
    found = find_program("cmake", variables)
    if found is None or found.parent == Path(sys.executable).parent:
        wheel = importlib.util.find_spec("cmake")
        for folder in (wheel and wheel.submodule_search_locations) or ():
            program = Path(folder) / "data" / "bin" / "cmake"
            if program.is_file():
                return program
    return found


def _has_compiler(variables: Mapping[str, str]) -> bool:
    if "CXX" in variables or "CC" in variables:
        return True
    path = variables.get("PATH", os.defpath)
    return any(shutil.which(compiler, path=path) for compiler in _COMPILERS)


def calls_make(text: str) -> bool:
    """Tell whether a CMakeLists.txt calls $(MAKE), which only makefiles support, as for external projects."""
    return "$(MAKE)" in text


def _project_text(package: Package) -> str:
    """Return the text of a package's CMakeLists.txt, empty if it is unreadable."""
    return text_or_nothing(package.path / "CMakeLists.txt")


def _compiles(text: str) -> bool:
    """Tell whether project() enables a language, which it does unless it specifies NONE."""
    project = next((call for call in calls(text) if call.command == "project"), None)
    return bool(text) and (project is None or "NONE" not in project.words)


def _certainly_compiles(text: str) -> bool:
    """Tell whether project() enables C or C++, and no command before it may choose a compiler."""
    for call in calls(text):
        if call.command == "project" and not call.conditions:
            following = call.words[1] if call.words[1:] else "VERSION"
            named = not {"C", "CXX"}.isdisjoint(call.words)
            return named or (following in PROJECT_DETAILS and "LANGUAGES" not in call.words)
        if call.command not in _BEFORE_PROJECT or "COMPILER" in str(call.words):
            return False
    return False


def _dependents(packages: Sequence[Package]) -> str:
    if not packages:
        return "CMake packages need"
    first, rest = f"'{packages[0].name}'", len(packages) - 1
    return f"{first} and {counted(rest, 'more package')} need" if rest else f"{first} needs"
