"""Tracks the read offset of a generated reader, as an expression: a constant, or `o` plus a constant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from forge.interfaces.python.cdr_text import HEADER_SIZE

if TYPE_CHECKING:
    from forge.interfaces.python.cdr_text import FunctionSource


@dataclass(slots=True)
class Cursor:
    """The offset of the next byte to read, including the header; alignment does not count the header."""

    lines: FunctionSource
    absolute: bool = True
    """True if the offset is `constant`, False if it is `o` plus `constant`."""
    constant: int = 0

    @property
    def expression(self) -> str:
        """The expression for the offset."""
        if self.absolute:
            return str(self.constant)
        return f"o + {self.constant}" if self.constant else "o"

    def store(self) -> None:
        """Emit the assignment of the offset to `o`."""
        if self.absolute or self.constant:
            self.lines.add(f"o = {self.expression}")
        self._mark_stored()

    def advance(self, size: str) -> None:
        """Emit the line that skips as many bytes as the expression `size`."""
        self.lines.add(f"o += {size}" if self.expression == "o" else f"o = {self.expression} + {size}")
        self._mark_stored()

    def align(self, alignment: int) -> None:
        """Emit the line that skips padding of unknown size."""
        self.lines.add(f"o = {_rounded(self.expression, alignment)}")
        self._mark_stored()

    def pad(self, padding: int | None, alignment: int, count: str | None) -> None:
        """Emit the lines that skip the padding before elements; an empty sequence has none.

        `count` is the expression for the number of elements, or None for an array.
        """
        if padding == 0:
            return
        if count is not None:
            self.store()
            skip = f"o += {padding}" if padding else f"o = {_rounded('o', alignment)}"
            self.lines.add(f"if {count}:", f"    {skip}")
        elif padding:
            self.constant += padding
        else:
            self.align(alignment)

    def check_available(self, length: str) -> str:
        """Emit the lines that reject data with fewer remaining bytes; return the name of the end offset."""
        self.store()
        end = self.lines.names.new("end")
        self.lines.add(f"{end} = o + {length}", f"if {end} > size:", "    raise _pieces.Refused")
        return end

    def move_to(self, end: str, *, last: bool) -> None:
        """Emit the assignment of `o` after the data, unless nothing follows."""
        if not last:
            self.lines.add(f"o = {end}")

    def _mark_stored(self) -> None:
        self.absolute, self.constant = False, 0


def _rounded(offset: str, alignment: int) -> str:
    if alignment <= HEADER_SIZE:
        return f"{offset} + {alignment - 1} & -{alignment}"
    return f"({offset} + {alignment - 1 - HEADER_SIZE} & -{alignment}) + {HEADER_SIZE}"
