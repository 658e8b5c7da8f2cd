"""What the files outside of the workspace say that builds have read, such as headers of the system.

A hundred packages read the same ones. As long as a build only restores, each is looked at once; from the
first step on that runs, each time, since a step may write anywhere.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.caching import processor
from forge.digests import contents_of, digest_of
from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from forge.caching.relocation import Places
    from forge.digests import FileTable


@frozen
class Seen:
    """Files as they were at one moment: path and contents by the word for the path; the processor, too."""

    files: Mapping[str, tuple[str, str]]

    @property
    def contents(self) -> dict[str, str]:
        """What each file says, by the word for it."""
        return {word: said for word, (_, said) in self.files.items()}

    @property
    def record(self) -> tuple[tuple[str, ...], str]:
        """The paths, and the digest of what they say."""
        found = dict(seen for word, seen in self.files.items() if word != processor.WORD)
        return tuple(found), digest_of(found, found)


class Outside:
    """Files outside of one workspace, by their names with the workspace's paths put aside."""

    def __init__(self, places: Places, table: FileTable) -> None:
        """Remember how to put paths in again, and where contents are looked up."""
        self._places = places
        self._table = table
        self._known: dict[str, tuple[str, str]] = {}
        self._trusting = True

    def distrust(self) -> None:
        """Look at every file each time from now on: a step is about to run."""
        self._trusting = False
        self._known = {}

    def look(self, words: Iterable[str]) -> Seen:
        """Return what files say, one look for a key and for the record of what it leads to."""
        known = self._known if self._trusting else {}
        found = {}
        for word in words:
            if word not in known:
                known[word] = self._look(word)
            found[word] = known[word]
        return Seen(found)

    def _look(self, word: str) -> tuple[str, str]:
        if word == processor.WORD:
            return word, processor.processor()
        path = self._places.settled_word(word)
        return path, contents_of((path,), self._table)[path]
