"""Read the log of what the steps of a package wrote below its prefix.

The records are described in forge/execution/observer.c, the library that writes most of them; forge's own
installers write the others.
"""

from __future__ import annotations

import os
from pathlib import Path

from forge.base.frozen import frozen

LOG_VARIABLE, PREFIX_VARIABLE = "FORGE_OBSERVER_LOG", "FORGE_OBSERVER_PREFIX"


@frozen
class ObservedWrites:
    """What the steps wrote, as absolute paths; a renamed folder stands for all that is in it.

    `complete` is False if some process could not be observed.
    """

    files: frozenset[str] = frozenset()
    folders: frozenset[str] = frozenset()
    complete: bool = False

    def contain(self, path: str) -> bool:
        """Return True if a step wrote this file or link, or renamed a folder that contains it."""
        while path not in self.files:
            parent = os.path.dirname(path)  # noqa: PTH120  (each installed file: no Path for each)
            if parent == path:
                return False
            path = parent
        return True


def read_log(log: Path, prefix: Path) -> ObservedWrites:
    """Return what a log says; nothing, and not complete, if there is none."""
    try:
        records = log.read_bytes().split(b"\0")[:-1]
    except OSError:
        return ObservedWrites()
    real = os.path.realpath(prefix)
    files: set[str] = set()
    folders: set[str] = set()
    spawned: set[str] = set()
    loaded: set[str] = set()
    unconfirmed: set[str] = set()
    for record in records:
        kind, word = record[:1], os.fsdecode(record[1:])
        match kind:
            case b"W" | b"D":
                if word == real or word.startswith(f"{real}/"):
                    word = f"{prefix}{word[len(real) :]}"
                (files if kind == b"W" else folders).add(word)
            case b"E":
                unconfirmed.add(word)
            case b"S" | b"F":
                unconfirmed.discard(word)
                loaded.add(word)
            case b"P":
                spawned.add(word)
            case _:
                unconfirmed.add(word)  # a torn record
    complete = bool(records) and not unconfirmed and spawned <= loaded
    return ObservedWrites(frozenset(files), frozenset(folders), complete)


def note_written(path: str) -> None:
    """Log a file that this process is about to write, or has written, as a step of a package."""
    _append(b"W", path)


def note_unobserved(program: str) -> None:
    """Log a program that has run as part of a step, unless the library observes the processes of the step."""
    if "LD_PRELOAD" not in os.environ:
        _append(b"E", program)


def _append(kind: bytes, word: str) -> None:
    log = os.environ.get(LOG_VARIABLE)
    if log and os.path.isfile(log):  # noqa: PTH113  (a string)
        with Path(log).open("ab") as stream:
            stream.write(b"%s%s\0" % (kind, os.fsencode(word)))
