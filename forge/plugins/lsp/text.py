"""Positions in files: lines and columns that count from 0, in characters."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from forge.base.errors import Location
from forge.base.frozen import frozen

_WORD = re.compile(r"[\w/:<>=.\[\]-]+|\S")


@frozen
class Span:
    """A part of a line, from column `start` up to `end`."""

    line: int
    start: int
    end: int

    def contains(self, line: int, column: int) -> bool:
        """Return whether a cursor is in this part, or directly after it."""
        return line == self.line and self.start <= column <= self.end


@frozen
class Place:
    """A part of a file."""

    path: Path
    span: Span


@frozen
class Edit:
    """The replacement of a part of a file."""

    path: Path
    span: Span
    text: str


def span_at(location: Location | None, lines: Sequence[str]) -> Span:
    """Return the word at a location.

    The whole line without a column, and the first line without a line number.
    """
    line = max(0, min(((location.line if location else None) or 1), len(lines)) - 1)
    text = lines[line] if lines else ""
    if location is None or location.line is None or location.column is None:
        return Span(line, len(text) - len(text.lstrip()), max(len(text.rstrip()), 1))
    start = min(location.column - 1, len(text))
    word = _WORD.match(text, start)
    return Span(line, start, word.end() if word else max(start + 1, len(text)))
