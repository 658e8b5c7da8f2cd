"""Mixins: named sets of options, forge's own and those of the user's *.mixin files."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forge.errors import Place, Problem, SelectionError, WorkspaceError
from forge.formats import read_yaml
from forge.frozen import frozen
from forge.names import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

_OURS: dict[str, list[str]] = {
    "ccache": ["-DCMAKE_C_COMPILER_LAUNCHER=ccache", "-DCMAKE_CXX_COMPILER_LAUNCHER=ccache"],
    "compile-commands": ["-DCMAKE_EXPORT_COMPILE_COMMANDS=ON"],
    "debug": ["-DCMAKE_BUILD_TYPE=Debug"],
    "ninja": ["-GNinja"],
    "rel-with-deb-info": ["-DCMAKE_BUILD_TYPE=RelWithDebInfo"],
    "release": ["-DCMAKE_BUILD_TYPE=Release"],
}


@frozen
class Mixin:
    """Options of one command under one name, by their name without dashes; `place` is None for ours."""

    verb: str
    name: str
    options: Mapping[str, Any]
    place: Path | None = None


Mixins = dict[tuple[str, str], Mixin]
"""Mixins by command and name."""


def read_mixins(home: Path, files: Iterable[str] = ()) -> Mixins:
    """Return forge's own mixins, those of *.mixin files below `home`/mixin, and those of `files`.

    A later one replaces an earlier one of its name. Raises WorkspaceError for files that are malformed,
    SelectionError for files that are not there.
    """
    found = [Mixin("build", name, {"cmake-args": words}) for name, words in _OURS.items()]
    for path in (*_user_files(home / "mixin"), *map(Path, files)):
        found += _read(path)
    return {(mixin.verb, mixin.name): mixin for mixin in found}


def combined(names: Iterable[str], verb: str, mixins: Mixins) -> dict[str, Any]:
    """Return what mixins say together: lists are joined, of anything else the last word counts.

    What a mixin is composed of comes before it. Raises SelectionError for names that nobody knows and for
    mixins that are composed of each other.
    """
    options: dict[str, Any] = {}
    for name in names:
        _add(name, verb, mixins, options, ())
    return options


def _add(name: str, verb: str, mixins: Mixins, options: dict[str, Any], above: tuple[str, ...]) -> None:
    if name in above:
        circle = " -> ".join((*above[above.index(name) :], name))
        raise SelectionError(Problem(f"mixins are composed of each other: {circle}"))
    mixin = mixins.get((verb, name))
    if mixin is None:
        known = [other for of, other in mixins if of == verb]
        hint = did_you_mean(name, known) or f"'forge mixin list' shows those of 'forge {verb}'"
        raise SelectionError(Problem(f"there is no mixin '{name}' for 'forge {verb}'", hint=hint))
    for other in mixin.options.get("mixin", ()):
        _add(other, verb, mixins, options, (*above, name))
    for key, value in mixin.options.items():
        if key != "mixin":
            old = options.get(key)
            options[key] = [*old, *value] if isinstance(old, list) and isinstance(value, list) else value


def _user_files(folder: Path) -> Iterator[Path]:
    for place, names, files in os.walk(folder, followlinks=True):
        names[:] = sorted(name for name in names if not name.startswith("."))
        yield from (Path(place) / file for file in sorted(files) if file.endswith(".mixin"))


def _read(path: Path) -> Iterator[Mixin]:
    try:
        said = read_yaml(path.read_text(encoding="utf-8"), path)
    except OSError as error:
        raise SelectionError(Problem(f"cannot read it: {error.strerror}", Place(path))) from None
    for verb, mixins in said.items():
        if not isinstance(mixins, dict) or not all(isinstance(value, dict) for value in mixins.values()):
            hint = f"write '{verb}:', below it a name, and below that 'option: value'"
            raise WorkspaceError(Problem(f"'{verb}' holds no mapping of options", Place(path), hint))
        yield from (Mixin(verb, str(name), options, path) for name, options in mixins.items())
