"""Mixins: named sets of options, built-in ones and those of the user's *.mixin files."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from forge.base.cmake_syntax import definitions
from forge.base.env_vars import home, setting
from forge.base.errors import Location, Problem, SelectionError, WorkspaceError
from forge.base.files import read_file
from forge.base.formats import read_yaml
from forge.base.frozen import frozen
from forge.base.names import did_you_mean

MIXIN_FOLDER = "mixin"
"""The folder of the user's mixins in their settings."""
REPOSITORIES = "mixin_repositories.yaml"
"""The file with the URLs of repositories of mixins in the user's settings, by name."""


def _flags(flags: str) -> dict[str, Any]:
    return {"cmake-args": [f"-DCMAKE_C_FLAGS={flags}", f"-DCMAKE_CXX_FLAGS={flags}"]}


_LTO = ("-DCMAKE_INTERPROCEDURAL_OPTIMIZATION=ON", "-DCMAKE_POLICY_DEFAULT_CMP0069=NEW")
"""The policy is for projects that require a CMake before 3.9, which would ignore the variable."""

_BUILT_IN: dict[str, dict[str, dict[str, Any]]] = {
    "build": {
        "asan": _flags("-fsanitize=address -g -fno-omit-frame-pointer"),
        "asan-gcc": _flags("-fsanitize=address"),
        "ccache": {"compiler-launcher": "ccache"},
        "compile-commands": {"cmake-args": ["-DCMAKE_EXPORT_COMPILE_COMMANDS=ON"]},
        "coverage": {"mixin": ["coverage-gcc", "debug"]},
        "coverage-gcc": _flags("--coverage"),
        "coverage-pytest": {"ament-cmake-args": ["-DAMENT_CMAKE_PYTEST_WITH_COVERAGE=ON"]},
        "debug": {"cmake-args": ["-DCMAKE_BUILD_TYPE=Debug"]},
        "lto": {"cmake-args": [*_LTO]},
        "min-size-rel": {"cmake-args": ["-DCMAKE_BUILD_TYPE=MinSizeRel"]},
        "ninja": {"cmake-args": ["-GNinja"]},
        "rel-with-deb-info": {"cmake-args": ["-DCMAKE_BUILD_TYPE=RelWithDebInfo"]},
        "release": {"cmake-args": ["-DCMAKE_BUILD_TYPE=Release"]},
        "tsan": _flags("-fsanitize=thread -O2 -g -fno-omit-frame-pointer"),
        "ubsan": _flags("-fsanitize=undefined -g -fno-omit-frame-pointer"),
    },
    "test": {
        "coverage-pytest": {"pytest-args": ["--cov-report=term"], "pytest-with-coverage": True},
    },
}
"""Mixins by command. Those that colcon-mixin-repository also has use its names and have the same effect."""

_COMPILER_FLAGS = frozenset(
    f"CMAKE_{name}_FLAGS" for name in ("C", "CXX", "EXE_LINKER", "MODULE_LINKER", "SHARED_LINKER")
)


@frozen
class Mixin:
    """Options of one command under one name, without leading dashes; `place` is None for built-in mixins."""

    verb: str
    name: str
    options: Mapping[str, Any]
    place: Path | None = None


Mixins = dict[tuple[str, str], Mixin]
"""Mixins by command and name."""


def mixin_folders(variables: Mapping[str, str]) -> tuple[Path, ...]:
    """Return the folders below which mixin files are found.

    That of the user, then those of $COLCON_MIXIN_PATH.
    """
    more = setting("MIXIN_PATH", variables) or ""
    return (home(variables) / MIXIN_FOLDER, *(Path(folder) for folder in more.split(os.pathsep) if folder))


def read_mixins(folders: Iterable[Path], files: Iterable[str] = ()) -> Mixins:
    """Return the built-in mixins, those of *.mixin files below `folders`, and those of `files`.

    A later mixin replaces an earlier one of the same name. Raises WorkspaceError for malformed files,
    SelectionError for missing files.
    """
    mixins = [Mixin(verb, name, options) for verb, own in _BUILT_IN.items() for name, options in own.items()]
    for path in (*(path for folder in folders for path in mixin_files(folder)), *map(Path, files)):
        try:
            content = read_file(path)
        except OSError as error:
            message = f"cannot read mixin file: {error.strerror}"
            raise SelectionError(Problem(message, Location(path))) from None
        mixins += parse_mixins(content, path)
    return {(mixin.verb, mixin.name): mixin for mixin in mixins}


def combined(names: Iterable[str], verb: str, mixins: Mixins) -> dict[str, Any]:
    """Return the combined options of mixins: lists are concatenated, the last of other values wins.

    Compiler flags of several mixins are joined, so that sanitizers can be combined. Included mixins come
    before the mixin that includes them. Raises SelectionError for unknown mixins and for mixins that include
    each other.
    """
    combination: dict[str, Any] = {}

    def add(name: str, above: tuple[str, ...]) -> None:
        """Add a mixin after the ones it includes; `above` is the chain of mixins that include it."""
        if name in above:
            cycle = " -> ".join((*above[above.index(name) :], name))
            raise SelectionError(Problem(f"mixins include each other: {cycle}"))
        mixin = mixins.get((verb, name))
        if mixin is None:
            names = [other for of, other in mixins if of == verb]
            hint = did_you_mean(name, names) or "'forge mixin show' shows all mixins"
            raise SelectionError(Problem(f"unknown mixin '{name}' for 'forge {verb}'", hint=hint))
        for other in mixin.options.get("mixin", ()):
            add(other, (*above, name))
        for key, value in mixin.options.items():
            if key != "mixin":
                old = combination.get(key)
                is_list = isinstance(old, list) and isinstance(value, list)
                combination[key] = with_joined_flags(old + value) if is_list else value

    for name in names:
        add(name, ())
    return combination


def with_joined_flags(words: list[Any]) -> list[Any]:
    """Return the arguments with a single -DCMAKE_CXX_FLAGS=..., and so on, with the flags of all of them.

    CMake would use only the last one.
    """
    joined: list[Any] = []
    places: dict[str, int] = {}
    for word in words:
        name, value = next(definitions([str(word)]), ("", ""))
        # CMake would remove single quotes around the value.
        flags = value[1:-1] if len(value) > 1 and value[0] == value[-1] == "'" else value
        if name not in _COMPILER_FLAGS:
            joined.append(word)
        elif name in places:
            joined[places[name]] += f" {flags}"
        else:
            places[name] = len(joined)
            joined.append(f"-D{name}={flags}")
    return joined


def mixin_files(folder: Path) -> Iterator[Path]:
    """Yield the *.mixin files below a folder, sorted; hidden folders are skipped."""
    for parent, names, files in os.walk(folder, followlinks=True):
        names[:] = sorted(name for name in names if not name.startswith("."))
        yield from (Path(parent) / file for file in sorted(files) if file.endswith(".mixin"))


def parse_mixins(text: bytes, path: Path) -> Iterator[Mixin]:
    """Yield the mixins of a file; raises WorkspaceError if it is malformed."""
    content = read_yaml(text, path)
    for verb, mixins in content.items():
        if not isinstance(mixins, dict) or not all(isinstance(value, dict) for value in mixins.values()):
            hint = "the format is 'COMMAND:', below it 'NAME:', below that 'option: value'"
            raise WorkspaceError(
                Problem(f"'{verb}' is not a mapping of names to options", Location(path), hint)
            )
        for name, options in mixins.items():
            others = options.get("mixin", [])
            if not isinstance(others, list) or not all(isinstance(other, str) for other in others):
                raise WorkspaceError(Problem(f"'mixin' of '{name}' is not a list of names", Location(path)))
        yield from (Mixin(verb, str(name), options, path) for name, options in mixins.items())
