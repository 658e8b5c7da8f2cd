"""Replace workspace paths in installed files by placeholders before caching, and insert them when restoring.

Only text can be rewritten. A program or library that contains such a path is correct only at the path where
it was built, so its package is not shared across paths.
"""

from __future__ import annotations

import os
import re
from enum import Enum
from typing import TYPE_CHECKING

from forge.base.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterator
    from mmap import mmap
    from pathlib import Path

    from forge.base.layout import Layout

_MARK = b"@FORGE_"
"""The prefix of all placeholders. A file that already contains it cannot be rewritten reliably."""

_PLACEHOLDERS = {"install": b"@FORGE_INSTALL@", "build": b"@FORGE_BUILD@", "root": b"@FORGE_ROOT@"}
_NAME = rb"\w\x80-\xff-"
_NAME_CONTINUES = rb"(?:[" + _NAME + rb"]|\.[" + _NAME + rb"])"
"""Characters after which the match is only the beginning of another folder's name."""
_AMBIGUOUS = rb"[+@~%]"
"""Characters that may either continue a name or end it."""
_GLUED = rb"(?<![." + _NAME + rb"])(?:-[A-Z]|-isystem|-iquote|-idirafter)"
"""Compiler options that are followed by a path without a blank."""


class QuotingClass(str, Enum):
    """How paths must be written in scripts: verbatim, quoted, or escaped differently in each language."""

    PLAIN = "plain"
    SPACED = "spaced"
    ODD = "odd"


@frozen
class NonRelocatable:
    """Why a file is valid only at its original paths; `occurrence` describes one of them."""

    occurrence: str


class Relocator:
    """Replaces the folders of one workspace in bytes and strings by placeholders and back."""

    def __init__(self, root: Path, layout: Layout) -> None:
        """Prepare the patterns for the install, build and root folders."""
        self.root = root
        found = {"install": str(layout.install), "build": str(layout.build), "root": str(root)}
        self.quoting = _quoting_of("".join(found.values()))
        """Scripts written for paths of one class may lack the quotes that another needs."""
        # The longest first: install and build usually lie below the root.
        ordered = sorted(found.items(), key=lambda entry: -len(entry[1]))
        self.paths = tuple((name, path.encode(errors="surrogateescape")) for name, path in ordered)
        either = b"|".join(re.escape(path) for _, path in self.paths)
        before = rb"(?:(?<![." + _NAME + rb"])|(" + _GLUED + rb"))"
        # The lookahead commits to the longest path, so an ambiguous match does not fall back to a parent.
        longest = rb"(?=((?:" + either + rb")(?!" + _NAME_CONTINUES + rb")))\2"
        self._paths_regex = re.compile(before + longest + rb"(?!" + _AMBIGUOUS + rb")")
        spelled = {other for _, path in self.paths for other in _other_spellings(path)}
        known = [re.escape(path) for _, path in self.paths] + [re.escape(path) for path in sorted(spelled)]
        self._any_spelling = re.compile(b"(?:" + b"|".join(known) + rb")(?!" + _NAME_CONTINUES + rb")")
        self._path_of = {_PLACEHOLDERS[name]: path for name, path in self.paths}
        self._placeholder_of = {path: _PLACEHOLDERS[name] for name, path in reversed(self.paths)}
        self._placeholders_regex = re.compile(b"|".join(re.escape(text) for text in _PLACEHOLDERS.values()))

    def relativize(self, content: bytes) -> bytes | NonRelocatable:
        """Return a file's bytes with placeholders for the workspace's paths, or why that is impossible."""
        if not self.occur_in(content):
            return content
        if b"\0" in content or _MARK in content:
            return NonRelocatable(self.name_in(content))
        relative = self._with_placeholders(content)
        return NonRelocatable(self.name_in(relative)) if self._any_spelling.search(relative) else relative

    def _with_placeholders(self, content: bytes) -> bytes:
        return self._paths_regex.sub(
            lambda match: (match[1] or b"") + self._placeholder_of[match[2]], content
        )

    def occur_in(self, content: bytes | mmap) -> bool:
        """Return True if a file contains a path of the workspace, or text that looks like a placeholder."""
        return self._any_spelling.search(content) is not None or content.find(_MARK) >= 0

    def name_in(self, content: bytes | mmap) -> str:
        """Describe the path found in a file."""
        match = self._any_spelling.search(content)
        if match is None:
            return "a placeholder of forge"
        return next((_NAMES[name] for name, path in self.paths if match[0].startswith(path)), _NAMES["root"])

    def absolutize(self, content: bytes) -> bytes:
        """Replace the placeholders in the result of `relativize` by the paths of this workspace."""
        return self._placeholders_regex.sub(lambda match: self._path_of[match[0]], content)

    def relativize_word(self, text: str) -> str:
        """Return an option or path with placeholders for the workspace's paths where possible."""
        relative = self._with_placeholders(text.encode(errors="surrogateescape"))
        return relative.decode(errors="surrogateescape")

    def absolutize_word(self, text: str) -> str:
        """Return what `relativize_word` returned with the paths of this workspace put in."""
        return self.absolutize(text.encode(errors="surrogateescape")).decode(errors="surrogateescape")


_NAMES = {
    "install": "the path of the install folder",
    "build": "the path of the build folder",
    "root": "the path of the workspace",
}


def _quoting_of(paths: str) -> QuotingClass:
    if re.fullmatch(r"[\w/.+-]*", paths):
        return QuotingClass.PLAIN
    return QuotingClass.SPACED if re.fullmatch(r"[\w/.+ -]*", paths) else QuotingClass.ODD


def _other_spellings(path: bytes) -> Iterator[bytes]:
    """Yield other spellings of a path: with symbolic links resolved, escaped, or as a URL."""
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
