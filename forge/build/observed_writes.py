"""Read the log of the files that the steps of a package wrote below its prefix.

The library of forge/engine logs the accesses of the processes of a step. forge's own installers run without
it and note their writes in a file beside the log: a letter and a word that ends with NUL for each.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from dataclasses import field
from pathlib import Path

from forge.base.files import naming
from forge.base.frozen import frozen
from forge.engine.observation import ALL_KINDS, LOG_VARIABLE, ObservedStep, end_log, observe, read_log
from forge.engine.observation import begin_log as begin_library_log

NOTES = ".notes"
"""The suffix of the file beside a log:

P pid kind   forge has started a step; P alone: forge's worker has started a program of one
W path   a file that forge has written
"""


@frozen
class ObservedWrites:
    """The paths that the steps wrote and `removed`, absolute; a folder renamed away stands for its contents.

    `refused` are paths behind unowned links that they tried to change. `started` is True if steps were
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


@frozen
class ObservedSteps:
    """The contents of a log: `kinds` of the steps by process, and `files` that forge itself wrote."""

    observed: ObservedStep
    kinds: Mapping[int, str] = field(default_factory=dict)
    files: frozenset[str] = frozenset()
    started: bool = False
    complete: bool = False


def read_steps(log: Path, kinds: str = ALL_KINDS) -> ObservedSteps:
    """Return the records of some kinds, and forge's own notes."""
    try:
        notes = log.with_name(f"{log.name}{NOTES}").read_bytes().split(b"\0")
    except OSError:
        return ObservedSteps(ObservedStep((), ("there is no log",)))
    words = [(note[:1], os.fsdecode(note[1:])) for note in notes]
    starts = [word for kind, word in words if kind == b"P"]
    roots = {int(pid): kind for pid, _, kind in (word.partition(" ") for word in starts) if pid}
    observed = read_log(log, frozenset(roots), starts.count(""), kinds=kinds)
    files = frozenset(word for kind, word in words if kind == b"W")
    is_noted = notes[-1] == b"" and bool(starts)
    unseen = any(kind == "B" for process in observed.processes for _, kind, _ in process.records)
    complete = is_noted and not observed.blind and not unseen
    return ObservedSteps(observed, roots, files, bool(starts), complete)


def read_writes(log: Path, prefix: Path) -> ObservedWrites:
    """Return the writes below a prefix in a log; empty and incomplete without a log."""
    steps = read_steps(log)
    seen = observe(steps.observed.processes, steps.observed.blind)
    real = os.path.realpath(prefix)

    def below(paths: frozenset[str]) -> frozenset[str]:
        """Return the paths inside the prefix, spelled with its unresolved name."""
        inside = {path for path in paths if f"{path}/".startswith(f"{prefix}/")}
        if real != str(prefix):
            inside |= {f"{prefix}{path[len(real) :]}" for path in paths if f"{path}/".startswith(f"{real}/")}
        return frozenset(inside)

    return ObservedWrites(
        files=below(seen.written | steps.files),
        folders=below(seen.folders),
        removed=below(seen.removed),
        refused=below(seen.refused),
        started=steps.started,
        complete=steps.complete,
    )


def begin_log(log: Path, *, observed: bool = True) -> None:
    """Create an empty log; unless `observed`, only for forge's own notes."""
    if observed:
        begin_library_log(log)
    log.with_name(f"{log.name}{NOTES}").write_bytes(b"")


def remove_log(log: Path) -> None:
    end_log(log)
    log.with_name(f"{log.name}{NOTES}").unlink(missing_ok=True)


def note_written(path: str) -> None:
    """Log a file that this process is about to write, or has written, as a step of a package."""
    append(os.environ.get(LOG_VARIABLE), b"W" + os.fsencode(path))


def note_start(variables: Mapping[str, str]) -> None:
    """Log that this process is about to start a program of a step that the library observes.

    The library logs this itself in observed processes, but forge's worker is not one.
    """
    if "LD_PRELOAD" not in variables:
        return
    started_with = b""
    with contextlib.suppress(OSError):
        started_with = Path("/proc/self/environ").read_bytes()
    if LOG_VARIABLE.encode() not in started_with:  # otherwise this process has loaded the library
        append(variables.get(LOG_VARIABLE), b"P")


def append(log: str | None, *notes: bytes) -> None:
    with contextlib.suppress(FileNotFoundError):
        descriptor = os.open(f"{log}{NOTES}", os.O_WRONLY | os.O_APPEND | os.O_CLOEXEC) if log else -1
        if descriptor >= 0:
            try:
                with naming(Path(log or "")):
                    os.write(descriptor, b"".join(b"%s\0" % note for note in notes))
            finally:
                os.close(descriptor)
