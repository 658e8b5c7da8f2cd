"""Names found in the build scripts of packages, as values that are cached between builds."""

from __future__ import annotations

import hashlib
import os
from typing import Any

from forge.base.frozen import frozen

VOLATILE = frozenset(
    {"PATH", "PWD", "OLDPWD", "SHLVL", "_", "TERM", "COLUMNS", "LINES"}
    | {"MAKEFLAGS", "MAKELEVEL", "MFLAGS", "CTEST_PARALLEL_LEVEL"}
)
"""Variables that differ between shells; PATH is represented by the programs found in it."""


@frozen
class Uses:
    """Names in build scripts: variables, packages, programs; and package folders found through PATH."""

    variables: frozenset[str] = frozenset()
    packages: frozenset[str] = frozenset()
    programs: frozenset[str] = frozenset()
    configs: frozenset[tuple[str, str]] = frozenset()

    def __or__(self, other: Uses) -> Uses:
        """Return the union."""
        return Uses(
            self.variables | other.variables,
            self.packages | other.packages,
            self.programs | other.programs,
            self.configs | other.configs,
        )


NOTHING = Uses()


@frozen
class Entry:
    """The names in a package's build scripts, and those exported to its dependents.

    `outside` are files outside the package that were read, with their `stamp`.
    """

    sources: str
    own: Uses = NOTHING
    exported: Uses = NOTHING
    outside: tuple[str, ...] = ()
    stamp: str = ""


@frozen
class NamedFiles:
    """The contents of files named by CMake arguments: recorded options, and words that may be programs."""

    options: tuple[str, ...] = ()
    words: tuple[str, ...] = ()
    read: tuple[str, ...] = ()
    stamp: str = ""


def is_text(path: str) -> bool:
    """Return True if the path is a file that a build may read and not a program."""
    return os.path.isfile(path) and (path.endswith(".cmake") or not os.access(path, os.X_OK))  # noqa: PTH113


def digest_of_text(text: str) -> str:
    """Return a digest of a value, which may be a secret and must not be stored itself."""
    return hashlib.blake2b(text.encode(errors="surrogateescape"), digest_size=8).hexdigest()


def encode_entry(entry: Entry) -> list[object]:
    """Return an entry as JSON-compatible data."""
    uses = ([sorted(field) for field in _fields(each)] for each in (entry.own, entry.exported))
    return [entry.sources, *uses, entry.outside, entry.stamp]


def decode_entry(data: list[Any]) -> Entry:
    """Return the entry that `encode_entry` gave; raises TypeError or ValueError for anything else."""
    sources, own, exported, outside, stamp = data
    return Entry(sources, _uses(*own), _uses(*exported) if any(exported) else NOTHING, tuple(outside), stamp)


def decode_files(data: list[Any]) -> NamedFiles:
    """Return the NamedFiles of JSON data; raises TypeError for invalid data."""
    return NamedFiles(*map(_tuple, data))


def _fields(uses: Uses) -> tuple[frozenset[Any], ...]:
    return (uses.variables, uses.packages, uses.programs, uses.configs)


def _uses(variables: list[str], packages: list[str], programs: list[str], configs: list[list[str]]) -> Uses:
    found = frozenset((name, folder) for name, folder in configs)
    return Uses(frozenset(variables), frozenset(packages), frozenset(programs), found)


def _tuple(data: list[str] | str) -> Any:
    return data if isinstance(data, str) else tuple(data)
