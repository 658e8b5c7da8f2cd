"""Inputs file by file: what each looked like and said when a build began, and how two moments differ.

A digest of a whole tree (`Mark`) tells that something changed. To reuse what an earlier build left behind,
it takes the names of the files that changed.
"""

from __future__ import annotations

import json
from dataclasses import field
from typing import TYPE_CHECKING

from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path


@frozen
class FileState:
    """One file at one moment: `stats` are its size, times, inode and mode in words, `content` a digest."""

    stats: str
    content: str


InputManifest = dict[str, FileState]
"""Files by their absolute paths; a path with '/' at its end is a folder, whose names are its content."""


@frozen
class Changes:
    """Absolute paths of files that were added, removed, or say something else."""

    added: frozenset[str] = field(default_factory=frozenset)
    removed: frozenset[str] = field(default_factory=frozenset)
    modified: frozenset[str] = field(default_factory=frozenset)

    def __or__(self, other: Changes) -> Changes:
        """Return the changes of both."""
        return Changes(self.added | other.added, self.removed | other.removed, self.modified | other.modified)

    def __bool__(self) -> bool:
        """Tell if anything changed."""
        return bool(self.added or self.removed or self.modified)

    @property
    def all(self) -> frozenset[str]:
        """All paths that changed in any way."""
        return self.added | self.removed | self.modified

    @property
    def names(self) -> frozenset[str]:
        """The paths that came or went."""
        return self.added | self.removed


def compare(
    then: Mapping[str, FileState], now: Mapping[str, FileState], *, by_stats: bool = False
) -> Changes:
    """Return how two manifests differ.

    With `by_stats` a file counts as modified when it was written at all: it may have said something else
    in between.
    """

    def differs(path: str) -> bool:
        one, other = then[path], now[path]
        return one.content != other.content or (by_stats and one.stats != other.stats)

    return Changes(
        added=frozenset(now.keys() - then.keys()),
        removed=frozenset(then.keys() - now.keys()),
        modified=frozenset(path for path in then.keys() & now.keys() if differs(path)),
    )


def write_manifest(path: Path, manifest: Mapping[str, FileState]) -> None:
    """Write a manifest as JSON."""
    from forge.files import replace_file  # noqa: PLC0415  (a build of nothing writes none)

    said = {name: [state.stats, state.content] for name, state in manifest.items()}
    replace_file(path, json.dumps(said).encode())


def read_manifest(path: Path) -> InputManifest | None:
    """Return the manifest in a file, or None when there is none that can be read."""
    try:
        said = json.loads(path.read_bytes())
        return {name: FileState(stats, content) for name, (stats, content) in said.items()}
    except (OSError, ValueError, TypeError, AttributeError, RecursionError):
        return None
