"""Read the log of what the steps of a package wrote below its prefix.

The records are described in forge/execution/observer.c, the library that writes most of them; forge's own
installers write the others.
"""

from __future__ import annotations

import contextlib
import os
import struct
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.files import naming
from forge.base.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Mapping

LOG_VARIABLE = "FORGE_OBSERVER_LOG"
PREFIX_VARIABLE, REAL_PREFIX_VARIABLE = "FORGE_OBSERVER_PREFIX", "FORGE_OBSERVER_REAL_PREFIX"
LINKS_VARIABLE = "FORGE_OBSERVER_LINKS"

_COUNTERS = struct.Struct("=QQ")


@frozen
class ObservedWrites:
    """What the steps wrote and `removed`, as absolute paths; a folder renamed away stands for what was in it.

    They tried to change what is `refused`, behind links of somebody else. `started` is True if steps were
    observed, and `complete` is False if some process could not be.
    """

    files: frozenset[str] = frozenset()
    folders: frozenset[str] = frozenset()
    removed: frozenset[str] = frozenset()
    refused: frozenset[str] = frozenset()
    started: bool = False
    complete: bool = False

    def take_away(self, path: str) -> bool:
        """Return True if a step removed this path, or removed or renamed a folder that contains it."""
        while path not in self.removed:
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
    below, real = f"{prefix}/", ""
    words: dict[bytes, set[str]] = {b"W": set(), b"D": set(), b"U": set(), b"L": set()}
    steps, complete = 0, records.pop() == b""
    for record in records:
        kind, word = record[:1], os.fsdecode(record[1:])
        if kind == b"P":
            steps += 1
        elif kind in words:
            if not word.startswith(below):
                real = real or os.path.realpath(prefix)
                word = f"{prefix}{word[len(real) :]}" if f"{word}/".startswith(f"{real}/") else word
            words[kind].add(word)
        else:
            complete = False
    complete = complete and steps > 0 and loaded == executed + steps
    files, folders, removed, refused = (frozenset(words[kind]) for kind in (b"W", b"D", b"U", b"L"))
    return ObservedWrites(files, folders, removed, refused, steps > 0, complete)


def begin_log(log: Path) -> None:
    """Create an empty log."""
    log.write_bytes(bytes(_COUNTERS.size))


def note_written(path: str) -> None:
    """Log a file that this process is about to write, or has written, as a step of a package."""
    append(os.environ.get(LOG_VARIABLE), b"W" + os.fsencode(path))


def note_start(variables: Mapping[str, str]) -> None:
    """Log that this process is about to start a program of a step that the library observes.

    The library itself counts the programs that an observed process starts; forge's worker is none.
    """
    if "LD_PRELOAD" in variables and not _is_observed():
        append(variables.get(LOG_VARIABLE), b"P")


def _is_observed() -> bool:
    """Tell whether this process started with the library."""
    try:
        return LOG_VARIABLE.encode() in Path("/proc/self/environ").read_bytes()
    except OSError:
        return False


def note_unobserved(program: str) -> None:
    """Log a program that has run as part of a step, unless the library observes the processes of the step."""
    if "LD_PRELOAD" not in os.environ:
        append(os.environ.get(LOG_VARIABLE), b"E" + os.fsencode(program))


def append(log: str | None, *records: bytes) -> None:
    """Append records to a log that exists."""
    with contextlib.suppress(FileNotFoundError):
        descriptor = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CLOEXEC) if log else -1
        if descriptor >= 0:
            try:
                with naming(Path(log or "")):
                    os.write(descriptor, b"".join(b"%s\0" % record for record in records))
            finally:
                os.close(descriptor)
