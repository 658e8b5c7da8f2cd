"""Mixins: named sets of options, built-in ones and those of the user's *.mixin files."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forge.base.errors import Location, Problem, SelectionError, WorkspaceError
from forge.base.files import read_file
from forge.base.formats import read_yaml
from forge.base.frozen import frozen
from forge.base.names import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

_OURS: dict[str, dict[str, Any]] = {
    "ccache": {"compiler-launcher": "ccache"},
    "compile-commands": {"cmake-args": ["-DCMAKE_EXPORT_COMPILE_COMMANDS=ON"]},
    "debug": {"cmake-args": ["-DCMAKE_BUILD_TYPE=Debug"]},
    "ninja": {"cmake-args": ["-GNinja"]},
    "rel-with-deb-info": {"cmake-args": ["-DCMAKE_BUILD_TYPE=RelWithDebInfo"]},
    "release": {"cmake-args": ["-DCMAKE_BUILD_TYPE=Release"]},
}


@frozen
class Mixin:
    """Options of one command under one name, without leading dashes; `place` is None for built-in mixins."""

    verb: str
    name: str
    options: Mapping[str, Any]
    place: Path | None = None


Mixins = dict[tuple[str, str], Mixin]
"""Mixins by command and name."""


def read_mixins(home: Path, files: Iterable[str] = ()) -> Mixins:
    """Return the built-in mixins, those of *.mixin files below `home`/mixin, and those of `files`.

    A later mixin replaces an earlier one of the same name. Raises WorkspaceError for malformed files,
    SelectionError for missing files.
    """
    found = [Mixin("build", name, options) for name, options in _OURS.items()]
    for path in (*_user_files(home / "mixin"), *map(Path, files)):
        found += _read(path)
    return {(mixin.verb, mixin.name): mixin for mixin in found}


def combined(names: Iterable[str], verb: str, mixins: Mixins) -> dict[str, Any]:
    """Return the combined options of mixins: lists are concatenated, of other values the last one wins.

    Included mixins come before the mixin that includes them. Raises SelectionError for unknown mixins and for
    mixins that include each other.
    """
    mixture = _Mixture(verb, mixins)
    for name in names:
        mixture.add(name, ())
    return mixture.options


@dataclass(slots=True)
class _Mixture:
    """Accumulates the options of mixins."""

    verb: str
    mixins: Mixins
    options: dict[str, Any] = field(default_factory=dict)

    def add(self, name: str, above: tuple[str, ...]) -> None:
        """Add a mixin after the ones it includes; `above` is the chain of mixins that include it."""
        if name in above:
            cycle = " -> ".join((*above[above.index(name) :], name))
            raise SelectionError(Problem(f"mixins include each other: {cycle}"))
        mixin = self.mixins.get((self.verb, name))
        if mixin is None:
            known = [other for of, other in self.mixins if of == self.verb]
            hint = did_you_mean(name, known) or "'forge mixin list' lists all mixins"
            raise SelectionError(Problem(f"unknown mixin '{name}' for 'forge {self.verb}'", hint=hint))
        for other in mixin.options.get("mixin", ()):
            self.add(other, (*above, name))
        for key, value in mixin.options.items():
            if key != "mixin":
                old = self.options.get(key)
                joined = isinstance(old, list) and isinstance(value, list)
                self.options[key] = old + value if joined else value


def _user_files(folder: Path) -> Iterator[Path]:
    for parent, names, files in os.walk(folder, followlinks=True):
        names[:] = sorted(name for name in names if not name.startswith("."))
        yield from (Path(parent) / file for file in sorted(files) if file.endswith(".mixin"))


def _read(path: Path) -> Iterator[Mixin]:
    try:
        content = read_yaml(read_file(path), path)
    except OSError as error:
        raise SelectionError(Problem(f"cannot read mixin file: {error.strerror}", Location(path))) from None
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
