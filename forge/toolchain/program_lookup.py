"""Looks up programs on PATH, their identity, and what wrappers start."""

from __future__ import annotations

import os
import stat
from typing import TYPE_CHECKING

from forge.base.digests import digest
from forge.base.files import open_regular

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

_LARGEST_SCRIPT = 1 << 16
_LAUNCHERS = frozenset({"ccache", "distcc", "icecc", "sccache", "colorgcc", "ccache-swig"})
"""Programs that may be named like a compiler and start the next program with that name on PATH."""


class ProgramLookup:
    """Looks up programs on one PATH; results are cached, so that a build sees a consistent state."""

    def __init__(self, variables: Mapping[str, str]) -> None:
        path = variables.get("PATH", os.defpath)
        self.folders = tuple(dict.fromkeys(folder for folder in path.split(os.pathsep) if folder))
        self._real: dict[str, str] = {}
        self._identities: dict[str, str] = {}
        self._names: frozenset[str] | None = None

    @property
    def names(self) -> frozenset[str]:
        if self._names is None:
            self._names = frozenset(name for folder in self.folders for name in _listed(folder))
        return self._names

    def stamp(self) -> str:
        """Return a value that changes with PATH, and when files are added to or removed from its folders."""
        return digest("\n".join(f"{folder} {_time(folder)}" for folder in self.folders), size=16)

    def identity(self, word: str) -> str:
        """Return path, size and time of a program given by name or path, '' if it does not exist.

        The path is normalized, so that links between folders such as /bin and /usr/bin make no difference.
        """
        if word not in self._identities:
            self._identities[word] = next(self._all(word), "")
        return self._identities[word]

    def behind(self, word: str) -> tuple[str, ...]:
        """Return the identities of a compiler and of the programs it starts.

        A launcher named like a compiler starts the next program with that name, a script those named in its
        text.
        """
        found: dict[str, None] = {}
        for identity in self._all(word):
            found[identity] = None
            path = identity.rsplit(" ", 2)[0]
            text = _script(path)
            if text:
                from forge.workspace.references import in_shell

                started = map(self.identity, sorted(in_shell(text).words))
                found |= dict.fromkeys(filter(None, started))
            if not text and os.path.basename(os.path.realpath(path)) not in _LAUNCHERS:
                break
        return tuple(found)

    def _all(self, word: str) -> Iterator[str]:
        """Yield the identity of each program with that name, in the order of PATH."""
        paths = [word] if os.sep in word else [f"{folder}/{word}" for folder in self.folders]
        for path in paths:
            try:
                status = os.stat(path)
            except (OSError, ValueError):
                continue
            if stat.S_ISREG(status.st_mode) and status.st_mode & 0o111:
                folder, _, name = path.rpartition("/")
                if folder not in self._real:
                    self._real[folder] = os.path.realpath(folder)
                yield f"{self._real[folder]}/{name} {status.st_size} {status.st_mtime_ns}"


def _listed(folder: str) -> list[str]:
    try:
        return os.listdir(folder)
    except OSError:
        return []


def _time(folder: str) -> str:
    try:
        status = os.stat(folder)
    except OSError:
        return ""
    return f"{status.st_ino} {status.st_mtime_ns}"


def _script(path: str) -> str:
    """Return the text of a script, '' for other programs."""
    try:
        with open(path, "rb", opener=open_regular) as stream:
            if stream.read(2) != b"#!":
                return ""
            return stream.read(_LARGEST_SCRIPT).decode(errors="replace")
    except OSError:
        return ""
