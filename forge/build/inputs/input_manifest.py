"""Input manifests: stat and content of each input at the start of a build, and how two manifests differ.

The digest of a whole tree (`Fingerprint`) shows that something changed. To reuse the outputs of an earlier
build, the names of the changed files are needed.
"""

from __future__ import annotations

import json
from dataclasses import field
from typing import TYPE_CHECKING

from forge.base.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path


@frozen
class FileState:
    """One file at one moment: `stats` are its size, times, inode and mode as text, `content` is a digest."""

    stats: str
    content: str


InputManifest = dict[str, FileState]
"""File states by absolute path; a path ending with '/' is a folder, whose content is its mode."""


@frozen
class Changes:
    """Absolute paths of files that were added, removed or modified."""

    added: frozenset[str] = field(default_factory=frozenset)
    removed: frozenset[str] = field(default_factory=frozenset)
    modified: frozenset[str] = field(default_factory=frozenset)

    def __or__(self, after: Changes) -> Changes:
        """Return the changes of both."""
        return Changes(self.added | after.added, self.removed | after.removed, self.modified | after.modified)

    def __bool__(self) -> bool:
        """Return True if anything changed."""
        return bool(self.added or self.removed or self.modified)

    @property
    def all(self) -> frozenset[str]:
        """All paths that changed in any way."""
        return self.added | self.removed | self.modified

    @property
    def names(self) -> frozenset[str]:
        """The paths that were added or removed."""
        return self.added | self.removed


def compare(
    then: Mapping[str, FileState], now: Mapping[str, FileState], *, by_stats: bool = False
) -> Changes:
    """Return the differences of two manifests.

    With `by_stats`, a file that was written counts as modified even if its content is the same: it may have
    had other content in between.
    """

    def differs(path: str) -> bool:
        before, after = then[path], now[path]
        return before.content != after.content or (by_stats and before.stats != after.stats)

    return Changes(
        added=frozenset(now.keys() - then.keys()),
        removed=frozenset(then.keys() - now.keys()),
        modified=frozenset(path for path in then.keys() & now.keys() if differs(path)),
    )


def write_manifest(path: Path, manifest: Mapping[str, FileState]) -> None:
    """Write a manifest as JSON."""
    from forge.base.files import replace_file

    data = {name: [state.stats, state.content] for name, state in manifest.items()}
    replace_file(path, json.dumps(data).encode())


def read_manifest(path: Path) -> InputManifest | None:
    """Return the manifest in a file, or None if it is missing or invalid."""
    try:
        data = json.loads(path.read_bytes())
        return {name: FileState(stats, content) for name, (stats, content) in data.items()}
    except (OSError, ValueError, TypeError, AttributeError, RecursionError):
        return None
