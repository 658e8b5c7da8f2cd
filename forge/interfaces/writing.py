"""Write rendered files to a folder: only changed ones; obsolete ones are removed.

The state of an output folder contains the files that earlier runs generated, and hashes of their inputs.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field
from functools import cache
from pathlib import Path

from forge import __version__
from forge.base.errors import HostError, Location, Problem
from forge.base.files import write_if_changed
from forge.base.frozen import frozen
from forge.base.layout import templates_folder
from forge.interfaces.model import TypeName
from forge.interfaces.rendering import Part

STATE_FOLDER = ".forge"
"""The folder with the state, inside the output folder."""

_VERSION = 3


@frozen
class PartState:
    """The digest of the inputs of a part, and size and modification time of each of its files."""

    digest: str | None
    stats: Mapping[str, tuple[int, int] | None]


@frozen
class OutputState:
    """The state of a package in an output folder: its files by part, and types of other packages it needs."""

    parts: Mapping[str, PartState] = field(default_factory=dict)
    needs: tuple[TypeName, ...] = ()
    folders: Mapping[str, Path] = field(default_factory=dict)
    """The folders with the definitions of needed packages."""

    @property
    def files(self) -> Iterator[str]:
        for part in self.parts.values():
            yield from part.stats

    def up_to_date(self, part: str, digest: str | None, out: Path) -> PartState | None:
        """Return the state of a part if its digest matches and all its files exist unchanged, else None."""
        state = self.parts.get(part)
        if state is None or digest is None or state.digest != digest:
            return None
        unchanged = all(stat and file_stat(out, path) == stat for path, stat in state.stats.items())
        return state if unchanged else None


def file_stat(out: Path, path: str) -> tuple[int, int] | None:
    """Return size and modification time of a file, or None if it does not exist."""
    try:
        status = os.stat(f"{out}/{path}")  # noqa: PTH116  (thousands of them: Path takes three times as long)
    except OSError:
        return None
    return status.st_size, status.st_mtime_ns


def read_states(out: Path) -> dict[str, OutputState]:
    """Return the state of each package generated into a folder; unreadable files are ignored."""
    return {path.stem: _read(path) for path in sorted((out / STATE_FOLDER).glob("*.json"))}


@cache
def generator_digest() -> str:
    """Return a hash of the generator: the version, and size and time of each module and template."""
    digest = hashlib.sha256(__version__.encode())
    for root in (Path(__file__).parent, templates_folder()):
        for folder, below, names in os.walk(root):
            below.sort()
            for name in sorted(names):
                if not name.endswith(".pyc"):
                    path = os.path.relpath(f"{folder}/{name}", root)
                    digest.update(f"{path} {file_stat(root, path)}".encode())
    return digest.hexdigest()[:32]


def _read(path: Path) -> OutputState:
    try:
        state = json.loads(path.read_text(encoding="utf-8"))
        if state["version"] != _VERSION:
            return OutputState()
        return OutputState(
            {
                key: PartState(digest, {name: tuple(stat) if stat else None for name, stat in stats.items()})
                for key, (digest, stats) in state["parts"].items()
            },
            tuple(TypeName(*name.split("/")) for name in state["needs"]),
            {name: Path(folder) for name, folder in state["folders"].items()},
        )
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return OutputState()


@frozen
class Written:
    """The result of a run: the new or changed files, and the total number."""

    changed: tuple[Path, ...]
    total: int


def write(parts: Iterable[Part], out: Path, package: str, state: OutputState | None = None) -> Written:
    """Write the parts of a package below `out`; parts that are up to date are skipped.

    `state` contains the needed types to store. Files of an earlier run of the same package are removed,
    unless this run or another package generates them, or this run does not include their language.
    Raises HostError if the folder is not writable.
    """
    states = read_states(out)
    before = states.pop(package, OutputState())
    changed: list[Path] = []
    written: dict[str, PartState] = {}
    try:
        for part in parts:
            current = before.up_to_date(part.key, part.digest, out)
            if current is None:
                stats = {}
                for file in part.files():
                    if write_if_changed(out / file.path, file.text):
                        changed.append(out / file.path)
                    stats[file.path] = file_stat(out, file.path)
                current = PartState(part.digest, stats)
            written[part.key] = current
        languages = {key.partition(" ")[0] for key in written}
        total = sum(len(each.stats) for each in written.values())
        others = {k: each for k, each in before.parts.items() if k.partition(" ")[0] not in languages}
        new = OutputState(written | others, *((state.needs, state.folders) if state else ()))
        current_files = {*new.files, *(path for each in states.values() for path in each.files)}
        for path in set(before.files) - current_files:
            (out / path).unlink(missing_ok=True)
        content = {
            "version": _VERSION,
            "needs": sorted(map(str, new.needs)),
            "folders": {name: str(folder) for name, folder in sorted(new.folders.items())},
            "parts": {key: [part.digest, part.stats] for key, part in sorted(new.parts.items())},
        }
        write_if_changed(out / STATE_FOLDER / f"{package}.json", json.dumps(content) + "\n")
    except OSError as error:
        raise unwritable(error, out) from error
    return Written(tuple(changed), total)


def unwritable(error: OSError, out: Path) -> HostError:
    """Return the error for a file below `out` that could not be written."""
    reason = (error.strerror or str(error)).lower()
    return HostError(Problem(f"cannot write: {reason}", Location(error.filename or out)))


def write_depfile(path: Path, target: Path, sources: Iterable[Path]) -> None:
    """Write a make depfile with the inputs of `target`.

    Raises HostError for a path that make cannot represent.
    """
    inputs = tuple(sources)
    invalid = [each for each in (target, *inputs) if any(sign in str(each) for sign in "\n\r\0;")]
    if invalid:
        hint = "rename the folder: paths must not contain ';' or line breaks"
        raise HostError(Problem(f"make cannot handle the path {str(invalid[0])!r}", hint=hint))
    names = " \\\n  ".join(map(_for_make, inputs))
    write_if_changed(path, f"{_for_make(target)}: {names}\n" if names else f"{_for_make(target)}:\n")


def write_stamp(path: Path) -> None:
    """Create an empty file, or update its modification time."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()


def _for_make(path: Path) -> str:
    return str(path).replace("$", "$$").replace("#", "\\#").replace(" ", "\\ ")
