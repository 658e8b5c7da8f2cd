"""Formats durations and lists of names, computes digests of texts, and shortens long output."""

from __future__ import annotations

import hashlib
import re
from collections import deque
from collections.abc import Iterable, Sequence

_MOST = 1_000_000
"""Bytes kept of the beginning, with the first error, and of the end of output."""

_LEFT_OUT = b"[... output truncated; the log has the full output ...]\n"

_NAMES_SHOWN = 3


def duration(seconds: float) -> str:
    """Format seconds like colcon: 0.15s, 12.3s, 1min 5s, 1h 2min 3s."""
    if seconds < 9.995:
        return f"{seconds:.2f}s"
    if seconds < 59.95:
        return f"{seconds:.1f}s"
    whole_seconds = round(seconds)
    hours, rest = divmod(whole_seconds, 3600)
    minutes, rest = divmod(rest, 60)
    return f"{hours}h {minutes}min {rest}s" if hours else f"{minutes}min {rest}s"


def counted(number: int, noun: str) -> str:
    """Return '1 job', or '2 jobs'."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def quoted_names(names: Iterable[str]) -> str:
    return ", ".join(f"'{name}'" for name in names)


def listed(names: Sequence[str], most: int = _NAMES_SHOWN) -> str:
    """Return the first few names and the number of others."""
    shown = quoted_names(names[:most])
    return f"{shown} and {len(names) - most} more" if len(names) > most else shown


def digest(*parts: str, size: int = 8) -> str:
    """Return the BLAKE2b digest of the parts in this order as hexadecimal digits; file names may be bytes."""
    return hashlib.blake2b("\0".join(parts).encode(errors="surrogateescape"), digest_size=size).hexdigest()


def split_lines(output: bytes) -> list[bytes]:
    """Split output into lines with their line endings; a carriage return does not end a line."""
    return [line for line in re.split(rb"(?<=\n)", output) if line]


class Excerpt:
    """Output of stdout and stderr in order, without the middle if it is long."""

    def __init__(self) -> None:
        self._first: list[tuple[bytes, bool]] = []
        self._last: deque[tuple[bytes, bool]] = deque()
        self._room = _MOST
        self._kept = 0
        self._whole = True

    def add(self, lines: bytes, *, stderr: bool) -> None:
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
        middle = () if self._whole else (_LEFT_OUT,)
        first, last = (b for b, _ in self._first), (b for b, _ in self._last)
        return b"".join((*first, *middle, *last))

    @property
    def errors(self) -> bytes:
        return b"".join(lines for lines, stderr in (*self._first, *self._last) if stderr)
