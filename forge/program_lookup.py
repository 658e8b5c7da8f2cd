"""Programs by name: which file PATH leads to, what tells it apart, and what a wrapper starts."""

from __future__ import annotations

import hashlib
import os
import stat
from typing import TYPE_CHECKING

from forge.files import open_regular

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

_LARGEST_SCRIPT = 1 << 16
_LAUNCHERS = frozenset({"ccache", "distcc", "icecc", "sccache", "colorgcc", "ccache-swig"})
"""Programs that go by the name of a compiler and start the next one of that name on PATH."""


class ProgramLookup:
    """Looks programs up on one PATH; what was found is remembered, so one build sees one state."""

    def __init__(self, variables: Mapping[str, str]) -> None:
        """Remember the folders of PATH; nothing is looked up yet."""
        path = variables.get("PATH", os.defpath)
        self.folders = tuple(dict.fromkeys(folder for folder in path.split(os.pathsep) if folder))
        self._real: dict[str, str] = {}
        self._identities: dict[str, str] = {}
        self._names: frozenset[str] | None = None

    @property
    def names(self) -> frozenset[str]:
        """The names of all files in the folders of PATH."""
        if self._names is None:
            self._names = frozenset(name for folder in self.folders for name in _listed(folder))
        return self._names

    def stamp(self) -> str:
        """Return what changes when PATH does, or when a file appears in one of its folders or goes."""
        said = [f"{folder} {_time(folder)}" for folder in self.folders]
        return hashlib.blake2b("\n".join(said).encode(errors="surrogateescape"), digest_size=16).hexdigest()

    def identity(self, word: str) -> str:
        """Return path, size and time of the program that a name or a path leads to, '' where there is none.

        The path is the same whichever link of a folder leads there, such as /bin and /usr/bin.
        """
        if word not in self._identities:
            self._identities[word] = next(self._all(word), "")
        return self._identities[word]

    def behind(self, word: str) -> tuple[str, ...]:
        """Return the identities of what a compiler's name comes to: the program, and what that starts.

        A launcher by the name of a compiler starts the next of that name; a script what its text names.
        """
        found: dict[str, None] = {}
        for identity in self._all(word):
            found[identity] = None
            path = identity.rsplit(" ", 2)[0]
            text = _script(path)
            if text:
                from forge.named_variables import in_shell  # noqa: PLC0415  (most compilers are no scripts)

                started = map(self.identity, sorted(in_shell(text).words))
                found |= dict.fromkeys(filter(None, started))
            if not text and os.path.basename(os.path.realpath(path)) not in _LAUNCHERS:  # noqa: PTH119
                break
        return tuple(found)

    def _all(self, word: str) -> Iterator[str]:
        """Yield the identity of each program of that name, in the order of PATH."""
        paths = [word] if os.sep in word else [f"{folder}/{word}" for folder in self.folders]
        for path in paths:
            try:
                status = os.stat(path)  # noqa: PTH116  (hundreds of paths: no Path for each)
            except (OSError, ValueError):
                continue
            if stat.S_ISREG(status.st_mode) and status.st_mode & 0o111:
                yield f"{self._place(path)} {status.st_size} {status.st_mtime_ns}"

    def _place(self, path: str) -> str:
        folder, _, name = path.rpartition("/")
        if folder not in self._real:
            self._real[folder] = os.path.realpath(folder)
        return f"{self._real[folder]}/{name}"


def _listed(folder: str) -> list[str]:
    try:
        return os.listdir(folder)  # noqa: PTH208  (names alone)
    except OSError:
        return []


def _time(folder: str) -> str:
    try:
        status = os.stat(folder)  # noqa: PTH116
    except OSError:
        return ""
    return f"{status.st_ino} {status.st_mtime_ns}"


def _script(path: str) -> str:
    """Return the text of a program that is a script, '' for any other."""
    try:
        with open(path, "rb", opener=open_regular) as stream:
            if stream.read(2) != b"#!":
                return ""
            return stream.read(_LARGEST_SCRIPT).decode(errors="replace")
    except OSError:
        return ""
