"""Contents of the files outside the workspace that builds have read, such as system headers.

Many packages read the same files. While a build only restores packages, each file is checked once; from the
first step that runs, it is checked each time, since a step may write anywhere.
"""

from __future__ import annotations

import contextlib
import os
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.build.inputs.fingerprints import contents_of, digest_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from forge.build.inputs.fingerprints import FileTable
    from forge.cache.relocation import Relocator


@frozen
class FileSnapshot:
    """External files and answers at one moment: path and content by relocatable path."""

    files: Mapping[str, tuple[str, str]]

    @property
    def contents(self) -> dict[str, str]:
        """The content of each file by relocatable path."""
        return {word: said for word, (_, said) in self.files.items()}

    @property
    def record(self) -> tuple[tuple[str, ...], str]:
        """The paths, and the digest of their contents."""
        found = dict(self.files.values())
        return tuple(found), digest_of(found, found)


class ExternalInputs:
    """Files outside one workspace, by relocatable path."""

    def __init__(self, relocator: Relocator, table: FileTable, programs: FileTable) -> None:
        """Look up contents in `table`, those of programs in `programs`, which outlives build folders."""
        self._relocator = relocator
        self._table = table
        self._programs = programs
        self._read_programs: set[str] = set()
        self._known: dict[str, tuple[str, str]] = {}
        self._caching = True

    def stop_caching(self) -> None:
        """Check every file each time from now on, since a step is about to run."""
        self._caching = False
        self._known = {}

    def look(self, words: Iterable[str]) -> FileSnapshot:
        """Return the contents of files; the same snapshot is used for a key and for the record."""
        known = self._known if self._caching else {}
        found = {}
        for word in words:
            if word not in known:
                known[word] = self._look(word)
            found[word] = known[word]
        return FileSnapshot(found)

    def _look(self, word: str) -> tuple[str, str]:
        path = self._relocator.absolutize_input(word)
        if not os.access(path, os.X_OK) or os.path.isdir(path):  # noqa: PTH112
            return path, contents_of((path,), self._table)[path]
        # Compilers and CMake have tens of megabytes: clean builds should not read them again.
        self._read_programs.add(path)
        return path, contents_of((path,), self._programs)[path]

    def save(self) -> None:
        """Save the table of programs, restricted to those of this build."""
        if self._read_programs:
            self._programs.forget_others(self._read_programs)
            with contextlib.suppress(OSError):  # a read-only home folder
                self._programs.save()
