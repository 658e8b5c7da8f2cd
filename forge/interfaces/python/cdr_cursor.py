"""Where a generated reader is in its data, as text: a number while that is known, then `o` and a number."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from forge.interfaces.python.cdr_text import HEADER_SIZE

if TYPE_CHECKING:
    from forge.interfaces.python.cdr_text import FunctionSource


@dataclass(slots=True)
class Cursor:
    """The offset of what is read next; it counts the header's bytes, alignment does not."""

    lines: FunctionSource
    known: bool = True
    """Whether the offset is `number`; else it is that much more than `o`."""
    number: int = 0

    @property
    def here(self) -> str:
        """The expression for the offset."""
        if self.known:
            return str(self.number)
        return f"o + {self.number}" if self.number else "o"

    def settle(self) -> None:
        """Add the line that makes `o` the offset itself."""
        if self.known or self.number:
            self.lines.add(f"o = {self.here}")
        self.be_at_o()

    def be_at_o(self) -> None:
        """Note that lines added elsewhere have set `o` to the offset."""
        self.known, self.number = False, 0

    def add_size(self, size: str) -> None:
        """Add the line that passes as many bytes as an expression says."""
        self.lines.add(f"o += {size}" if self.here == "o" else f"o = {self.here} + {size}")
        self.be_at_o()

    def align(self, alignment: int) -> None:
        """Add the line that passes padding of unknown size."""
        self.lines.add(f"o = {_rounded(self.here, alignment)}")
        self.be_at_o()

    def pad(self, padding: int | None, alignment: int, number: str | None) -> None:
        """Add the lines that pass the padding before elements, of which there may be none.

        `number` says how many there are; without one there are some.
        """
        if padding == 0:
            return
        if number is not None:
            self.settle()
            passed = f"o += {padding}" if padding else f"o = {_rounded('o', alignment)}"
            self.lines.add(f"if {number}:", f"    {passed}")
        elif padding:
            self.number += padding
        else:
            self.align(alignment)

    def ensure(self, length: str) -> str:
        """Add the lines that refuse data of fewer bytes; return the name of the offset behind them."""
        self.settle()
        end = self.lines.names.new("end")
        self.lines.add(f"{end} = o + {length}", f"if {end} > size:", "    raise _pieces.Refused")
        return end

    def go_on(self, end: str, *, last: bool) -> None:
        """Add the line that goes on behind an offset, unless nothing follows."""
        if not last:
            self.lines.add(f"o = {end}")


def _rounded(offset: str, alignment: int) -> str:
    """Return the expression that rounds an offset up."""
    if alignment <= HEADER_SIZE:
        return f"{offset} + {alignment - 1} & -{alignment}"
    return f"({offset} + {alignment - 1 - HEADER_SIZE} & -{alignment}) + {HEADER_SIZE}"
