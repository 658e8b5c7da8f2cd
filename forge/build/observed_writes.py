"""Read the log of what the steps of a package wrote below its prefix.

The records are described in forge/execution/observer.c, the library that writes most of them; forge's own
installers write the others.
"""

from __future__ import annotations

import os
import struct
from pathlib import Path

from forge.base.frozen import frozen

LOG_VARIABLE = "FORGE_OBSERVER_LOG"
PREFIX_VARIABLE, REAL_PREFIX_VARIABLE = "FORGE_OBSERVER_PREFIX", "FORGE_OBSERVER_REAL_PREFIX"

_COUNTERS = struct.Struct("=QQ")


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
        content = log.read_bytes()
        executed, loaded = _COUNTERS.unpack_from(content)
    except (OSError, struct.error):
        return ObservedWrites()
    records = content[_COUNTERS.size :].split(b"\0")
    real = os.path.realpath(prefix)
    words: dict[bytes, set[str]] = {b"W": set(), b"D": set(), b"P": set()}
    complete = records.pop() == b""
    for record in records:
        word = os.fsdecode(record[1:])
        if word == real or word.startswith(f"{real}/"):
            word = f"{prefix}{word[len(real) :]}"
        if record[:1] in words:
            words[record[:1]].add(word)
        else:
            complete = False
    steps = len(words[b"P"])
    complete = complete and steps > 0 and loaded == executed + steps
    return ObservedWrites(frozenset(words[b"W"]), frozenset(words[b"D"]), complete)


def begin_log(log: Path) -> None:
    """Create an empty log."""
    log.write_bytes(bytes(_COUNTERS.size))


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
