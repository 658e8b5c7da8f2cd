"""The state of an output folder: the files that earlier runs generated, and hashes of their inputs."""

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
"""The folder with the state, inside the output folder."""

_VERSION = 3

FileStat = tuple[int, int]
"""The size and modification time of a file; a file is unchanged if both are."""


@frozen
class PartState:
    """The files of one part, and the digest of their inputs."""

    digest: str | None
    stats: Mapping[str, FileStat | None]


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


def file_stat(out: Path, path: str) -> FileStat | None:
    """Return size and modification time of a file, or None if it does not exist."""
    try:
        status = os.stat(f"{out}/{path}")  # noqa: PTH116  (thousands of them: Path takes three times as long)
    except OSError:
        return None
    return status.st_size, status.st_mtime_ns


def read_states(out: Path) -> dict[str, OutputState]:
    """Return the state of each package generated into a folder; unreadable files are ignored."""
    return {path.stem: _read(path) for path in sorted((out / STATE_FOLDER).glob("*.json"))}


def write_state(out: Path, package: str, state: OutputState) -> None:
    """Write the state of a package; raises OSError."""
    content = {
        "version": _VERSION,
        "needs": sorted(map(str, state.needs)),
        "folders": {name: str(folder) for name, folder in sorted(state.folders.items())},
        "parts": {key: [part.digest, part.stats] for key, part in sorted(state.parts.items())},
    }
    write_if_changed(out / STATE_FOLDER / f"{package}.json", json.dumps(content) + "\n")


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
