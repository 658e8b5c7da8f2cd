"""What a package printed, as much of it as a person would look at: its beginning and its end; pure."""

from __future__ import annotations

import re
from collections import deque

_MOST = 1_000_000
"""Bytes of the beginning, which has the first error, and as many of the end, which has the last words."""

_LEFT_OUT = b"[... the log has what stood here ...]\n"


def split_lines(output: bytes) -> list[bytes]:
    """Return the lines of output with their ends; the last may have none. A carriage return ends no line."""
    return [line for line in re.split(rb"(?<=\n)", output) if line]


class Excerpt:
    """Output of both streams in its order; of a flood the middle is left out."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._first: list[tuple[bytes, bool]] = []
        self._last: deque[tuple[bytes, bool]] = deque()
        self._room = _MOST
        self._kept = 0
        self._whole = True

    def add(self, lines: bytes, *, stderr: bool) -> None:
        """Take in what came next."""
        if self._room > 0:
            self._first.append((lines, stderr))
            self._room -= len(lines)
            return
        self._last.append((lines, stderr))
        self._kept += len(lines)
        while self._kept > _MOST and len(self._last) > 1:
            self._kept -= len(self._last.popleft()[0])
            self._whole = False

    @property
    def everything(self) -> bytes:
        """What is kept of both streams."""
        middle = () if self._whole else (_LEFT_OUT,)
        first, last = (b for b, _ in self._first), (b for b, _ in self._last)
        return b"".join((*first, *middle, *last))

    @property
    def errors(self) -> bytes:
        """What is kept of stderr."""
        return b"".join(lines for lines, stderr in (*self._first, *self._last) if stderr)
