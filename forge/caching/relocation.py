"""Paths of a workspace in what it installed: put aside before it is kept, put in again where it is restored.

Only text can be rewritten. A program or library with such a path in it works, or is right, only where it
was made: its package is not shared across paths.
"""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING

from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterator
    from mmap import mmap
    from pathlib import Path

    from forge.layout import Layout

_MARK = b"@FORGE_"
"""How the words begin that stand for paths; what has it already cannot be told from what forge wrote."""

_WORDS = {"install": b"@FORGE_INSTALL@", "build": b"@FORGE_BUILD@", "root": b"@FORGE_ROOT@"}
_NAME = rb"\w\x80-\xff-"
_GOES_ON = rb"(?:[" + _NAME + rb"]|\.[" + _NAME + rb"])"
"""What follows a path that is the beginning of another folder's name."""
_UNCLEAR = rb"[+@~%]"
"""What may go on a name, or end it."""
_GLUED = rb"(?<![." + _NAME + rb"])(?:-[A-Z]|-isystem|-iquote|-idirafter)"
"""Options of compilers that a path follows without a blank."""

PLAIN, SPACED, ODD = "plain", "spaced", "odd"
"""How paths stand in scripts: as they are, in quotes, or in ways that differ from language to language."""


@frozen
class Bound:
    """Why a file holds only for the paths where it was made; `place` names one of these."""

    place: str


class Places:
    """The folders of one workspace, and how to put their paths aside in bytes and words."""

    def __init__(self, root: Path, layout: Layout) -> None:
        """Remember the folders; equal ones and those within others are told apart by length."""
        self.root = root
        found = {"install": str(layout.install), "build": str(layout.build), "root": str(root)}
        self.kind = _kind_of("".join(found.values()))
        """What has been written for one kind of paths may lack the quotes that another takes."""
        # The longest first: install and build usually lie below the root.
        ordered = sorted(found.items(), key=lambda entry: -len(entry[1]))
        self.paths = tuple((name, path.encode(errors="surrogateescape")) for name, path in ordered)
        either = b"|".join(re.escape(path) for _, path in self.paths)
        before = rb"(?:(?<![." + _NAME + rb"])|(" + _GLUED + rb"))"
        # A lookahead keeps to the longest path: what is unclear about that is not taken for one above it.
        longest = rb"(?=((?:" + either + rb")(?!" + _GOES_ON + rb")))\2"
        self._ours = re.compile(before + longest + rb"(?!" + _UNCLEAR + rb")")
        spelled = {other for _, path in self.paths for other in _other_spellings(path)}
        known = [re.escape(path) for _, path in self.paths] + [re.escape(path) for path in sorted(spelled)]
        self._any = re.compile(b"(?:" + b"|".join(known) + rb")(?!" + _GOES_ON + rb")")
        self._of_word = {_WORDS[name]: path for name, path in self.paths}
        self._word_of = {path: _WORDS[name] for name, path in reversed(self.paths)}
        self._words = re.compile(b"|".join(re.escape(word) for word in _WORDS.values()))

    def loosened(self, content: bytes) -> bytes | Bound:
        """Return a file's bytes with the workspace's paths put aside, or why that cannot be done."""
        if not self.occur_in(content):
            return content
        if b"\0" in content or _MARK in content:
            return Bound(self.name_in(content))
        loose = self._ours.sub(lambda match: (match[1] or b"") + self._word_of[match[2]], content)
        return Bound(self.name_in(loose)) if self._any.search(loose) else loose

    def occur_in(self, content: bytes | mmap) -> bool:
        """Tell if a path of the workspace stands in a file, or what could be taken for one put aside."""
        return self._any.search(content) is not None or content.find(_MARK) >= 0

    def name_in(self, content: bytes | mmap) -> str:
        """Return in words what was found in a file."""
        match = self._any.search(content)
        if match is None:
            return "a word of forge's own"
        return next((_NAMES[name] for name, path in self.paths if match[0].startswith(path)), _NAMES["root"])

    def settled(self, content: bytes) -> bytes:
        """Return bytes that `loosened` returned with the paths of this workspace put in."""
        return self._words.sub(lambda match: self._of_word[match[0]], content)

    def loose_word(self, word: str) -> str:
        """Return an option or a path with the workspace's paths put aside, as far as that goes."""
        content = word.encode(errors="surrogateescape")
        loose = self._ours.sub(lambda match: (match[1] or b"") + self._word_of[match[2]], content)
        return loose.decode(errors="surrogateescape")

    def settled_word(self, word: str) -> str:
        """Return what `loose_word` returned with the paths of this workspace put in."""
        return self.settled(word.encode(errors="surrogateescape")).decode(errors="surrogateescape")


_NAMES = {
    "install": "the path of the install folder",
    "build": "the path of the build folder",
    "root": "the path of the workspace",
}


def _kind_of(paths: str) -> str:
    if re.fullmatch(r"[\w/.+-]*", paths):
        return PLAIN
    return SPACED if re.fullmatch(r"[\w/.+ -]*", paths) else ODD


def _other_spellings(path: bytes) -> Iterator[bytes]:
    """Yield how else a path may stand in a file: in the system's own spelling, escaped, or as a URL."""
    real = os.path.realpath(path)
    for spelled in {path, real}:
        if spelled != path:
            yield spelled
        if re.search(rb"[^\w/.+-]", spelled):
            yield re.sub(rb"([^\w/.+-])", rb"\\\1", spelled)
            yield re.sub(rb"([^\w/.+-])", rb"$\1", spelled)
            yield re.sub(
                rb"[^\w/.+~-]", lambda match: b"".join(b"%%%02X" % byte for byte in match[0]), spelled
            )
            yield spelled.replace(b" ", b"\\040")
