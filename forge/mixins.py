"""Mixins: named sets of options, forge's own and those of the user's *.mixin files."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forge.errors import Place, Problem, SelectionError, WorkspaceError
from forge.files import read_file
from forge.formats import read_yaml
from forge.frozen import frozen
from forge.names import did_you_mean

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


_DEEPEST = 50
_MOST = 1000
"""How many mixins may be inside each other, and how many come to one: two of two each have no end."""


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
    found = [Mixin("build", name, options) for name, options in _OURS.items()]
    for path in (*_user_files(home / "mixin"), *map(Path, files)):
        found += _read(path)
    return {(mixin.verb, mixin.name): mixin for mixin in found}


def combined(names: Iterable[str], verb: str, mixins: Mixins) -> dict[str, Any]:
    """Return what mixins say together: lists are joined, of anything else the last word counts.

    What a mixin is composed of comes before it. Raises SelectionError for names that nobody knows and for
    mixins that are composed of each other.
    """
    mixture = _Mixture(verb, mixins)
    for name in names:
        mixture.add(name, ())
    return mixture.options


@dataclass(slots=True)
class _Mixture:
    """What mixins come to, put together one by one."""

    verb: str
    mixins: Mixins
    options: dict[str, Any] = field(default_factory=dict)
    count: int = 0

    def add(self, name: str, above: tuple[str, ...]) -> None:
        """Add a mixin, after what it is composed of; `above` are those that it is a part of."""
        if name in above:
            circle = " -> ".join((*above[above.index(name) :], name))
            raise SelectionError(Problem(f"mixins are composed of each other: {circle}"))
        mixin = self.mixins.get((self.verb, name))
        if mixin is None:
            known = [other for of, other in self.mixins if of == self.verb]
            hint = did_you_mean(name, known) or f"'forge mixin list' shows those of 'forge {self.verb}'"
            raise SelectionError(Problem(f"there is no mixin '{name}' for 'forge {self.verb}'", hint=hint))
        self.count += 1
        if len(above) > _DEEPEST or self.count > _MOST:
            raise SelectionError(Problem(f"mixin '{(*above, name)[0]}' is composed of too many others"))
        for other in mixin.options.get("mixin", ()):
            self.add(other, (*above, name))
        for key, value in mixin.options.items():
            if key != "mixin":
                old = self.options.get(key)
                joined = isinstance(old, list) and isinstance(value, list)
                self.options[key] = old + value if joined else value


def _user_files(folder: Path) -> Iterator[Path]:
    for place, names, files in os.walk(folder, followlinks=True):
        names[:] = sorted(name for name in names if not name.startswith("."))
        yield from (Path(place) / file for file in sorted(files) if file.endswith(".mixin"))


def _read(path: Path) -> Iterator[Mixin]:
    try:
        said = read_yaml(read_file(path), path)
    except OSError as error:
        raise SelectionError(Problem(f"cannot read it: {error.strerror}", Place(path))) from None
    for verb, mixins in said.items():
        if not isinstance(mixins, dict) or not all(isinstance(value, dict) for value in mixins.values()):
            hint = f"write '{verb}:', below it a name, and below that 'option: value'"
            raise WorkspaceError(Problem(f"'{verb}' holds no mapping of options", Place(path), hint))
        for name, options in mixins.items():
            others = options.get("mixin", [])
            if not isinstance(others, list) or not all(isinstance(other, str) for other in others):
                raise WorkspaceError(Problem(f"'mixin' of '{name}' is no list of names", Place(path)))
        yield from (Mixin(verb, str(name), options, path) for name, options in mixins.items())
