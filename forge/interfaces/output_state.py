"""What earlier runs left in an output folder, and what they made it from."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from forge import __version__
from forge.base.files import write_if_changed
from forge.base.frozen import frozen
from forge.base.layout import templates_folder
from forge.interfaces.model import TypeName

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

STATE_FOLDER = ".forge"
"""The folder for forge's own records in an output folder."""

_VERSION = 3

FileStat = tuple[int, int]
"""The size and modification time of a file: if both are unchanged, so is the file."""


@frozen
class PartState:
    """The files of one part of a run, and the digest of what they were made from."""

    digest: str | None
    marks: Mapping[str, FileStat | None]


@frozen
class OutputState:
    """The record of a package in an output folder: its files by part, and referenced types of others."""

    parts: Mapping[str, PartState] = field(default_factory=dict)
    needs: tuple[TypeName, ...] = ()
    folders: Mapping[str, Path] = field(default_factory=dict)
    """Where the definitions of needed packages were."""

    @property
    def files(self) -> Iterator[str]:
        """Yield the paths of all files."""
        for part in self.parts.values():
            yield from part.marks

    def fresh(self, part: str, digest: str | None, out: Path) -> PartState | None:
        """Return the record of a part if its digest matches and all its files exist unchanged."""
        made = self.parts.get(part)
        if made is None or digest is None or made.digest != digest:
            return None
        return (
            made if all(mark and file_stat(out, path) == mark for path, mark in made.marks.items()) else None
        )


def file_stat(out: Path, path: str) -> FileStat | None:
    """Return the mark of a file, or None when it is not there."""
    try:
        status = os.stat(f"{out}/{path}")  # noqa: PTH116  (thousands of them: Path takes three times as long)
    except OSError:
        return None
    return status.st_size, status.st_mtime_ns


def read_states(out: Path) -> dict[str, OutputState]:
    """Return the records of all packages generated into a folder; unreadable ones are ignored."""
    return {path.stem: _read(path) for path in sorted((out / STATE_FOLDER).glob("*.json"))}


def write_state(out: Path, package: str, record: OutputState) -> None:
    """Keep the record of a package's run; raises OSError."""
    content = {
        "version": _VERSION,
        "needs": sorted(map(str, record.needs)),
        "folders": {name: str(folder) for name, folder in sorted(record.folders.items())},
        "parts": {key: [made.digest, made.marks] for key, made in sorted(record.parts.items())},
    }
    write_if_changed(out / STATE_FOLDER / f"{package}.json", json.dumps(content) + "\n")


@cache
def generator_digest() -> str:
    """Return an identifier of this forge: its version, and the state of its code and templates."""
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
        written = json.loads(path.read_text(encoding="utf-8"))
        if written["version"] != _VERSION:
            return OutputState()
        return OutputState(
            {
                key: PartState(digest, {name: tuple(mark) if mark else None for name, mark in marks.items()})
                for key, (digest, marks) in written["parts"].items()
            },
            tuple(TypeName(*name.split("/")) for name in written["needs"]),
            {name: Path(folder) for name, folder in written["folders"].items()},
        )
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return OutputState()
