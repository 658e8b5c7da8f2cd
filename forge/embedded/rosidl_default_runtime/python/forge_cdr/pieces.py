"""Shared by generated writers and readers: tables of Structs, and conversions of other values.

Everything is little-endian, for little-endian machines. Padding depends on the start offset of a Struct, so
each function that creates one takes that offset, relative to the first byte after the header, which is at -4.
If the offset is only known at run time, there is a Struct for each of its eight remainders in
`table[o & 7]`; `o` includes the four bytes of the header.
"""

from __future__ import annotations

import struct
from array import array
from functools import cache
from struct import Struct
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

HEADER: Final = 0x100
"""The header of classic CDR in little endian, as a uint32 of that order: 00 01 00 00."""

HEADER_BYTES: Final = b"\0\1\0\0"
LITTLE_ENDIAN: Final = 0x100
"""The part of a header with the encoding, as a uint16; the other half contains options, which are ignored."""

REMEMBERED: Final = 512
"""The Structs of longer strings are not cached, so that no input can exhaust memory."""

_SIZES: Final = {code: struct.calcsize(f"<{code}") for code in "xc?bBhHiIqQfd"}
_HIGHEST_UNIT: Final = "\uffff"
_HIGHEST_CHAR: Final = 127


class Refused(ValueError):
    """Generated code does not support the value or data; the generic codec handles it or reports an error."""


@cache
def fixed(codes: str, start: int) -> Struct:
    """Return the Struct of a run that starts at an offset with this remainder; see `layout`."""
    return Struct(f"<{layout(codes, start)[0]}")


@cache
def phased(codes: str) -> tuple[Struct, ...]:
    """Return the Structs of a run by the remainder of its offset."""
    return tuple(fixed(codes, o - 4) for o in range(8))


class Texts(dict[int, Struct]):
    """The Structs for a string and the adjacent runs, by the length of the string."""

    def __init__(self, before: str, after: str, start: int, *, reading: bool) -> None:
        """Store the formats of both runs, and the offset of the first one."""
        super().__init__()
        text, end = layout(before, start)
        self._before = text
        self._after = after
        self._end = end
        self._reading = reading

    def __missing__(self, length: int) -> Struct:
        """Create the Struct for one length; a reader's length includes the NUL, a writer's does not."""
        if self._reading:
            end = self._end + length
            text = f"{length - 1}sB" if length else "0s0s"
        else:
            end = self._end + length + 1
            text = f"{length + 1}s"  # Struct appends the NUL: it pads with zeros
        made = Struct(f"<{self._before}{text}{layout(self._after, end)[0]}")
        if length < REMEMBERED:
            self[length] = made
        return made


@cache
def texts(before: str, after: str, start: int) -> Texts:
    """Return the table of Structs for writing a string."""
    return Texts(before, after, start, reading=False)


@cache
def phased_texts(before: str, after: str) -> tuple[Texts, ...]:
    """Return the tables for writing a string by the remainder of the offset of the run before it."""
    return tuple(texts(before, after, o - 4) for o in range(8))


@cache
def read_texts(after: str, start: int) -> Texts:
    """Return the table of Structs for reading a string: the text, its last byte, the run after it."""
    return Texts("", after, start, reading=True)


@cache
def phased_read_texts(after: str) -> tuple[Texts, ...]:
    """Return the tables for reading a string by the remainder of its offset."""
    return tuple(read_texts(after, o - 4) for o in range(8))


def paddings(alignment: int) -> tuple[bytes, ...]:
    """Return the padding before a value of that alignment by the remainder of the offset."""
    return tuple(bytes(-(o - 4) % alignment) for o in range(8))


def layout(codes: str, start: int) -> tuple[str, int]:
    """Return the format of a run with padding for the struct module, and the offset after it.

    Codes are format characters of the struct module, one per value; '9d' means nine doubles as bytes.
    """
    offset, words = start, []
    for code in codes.split():
        size = _SIZES[code[-1]]
        padding = -offset % size
        if padding:
            words.append(f"{padding}x")
        count = int(code[:-1] or 1)
        words.append(code if len(code) == 1 else f"{count * size}s")
        offset += padding + count * size
    return "".join(words), offset


def unterminated(text: bytes, last: int) -> bytes:
    """Return the text of a string without terminating NUL, including its last byte."""
    return text + bytes((last,))


def to_flags(values: Iterable[object]) -> bytes:
    """Return a byte for each boolean."""
    return bytes(map(bool, values))


def from_flags(values: bytes | memoryview) -> list[bool]:
    """Return a boolean for each byte."""
    return list(map(bool, values))


def to_octets(values: Collection[bytes]) -> bytes:
    """Return the octets as bytes; raises Refused unless all are bytes of length 1."""
    if any(map((1).__ne__, map(len, values))):
        raise Refused
    return b"".join(values)


def from_octets(values: bytes | memoryview) -> list[bytes]:
    """Return each byte by itself."""
    return [bytes((value,)) for value in values]


def to_chars(values: Iterable[str]) -> bytes:
    """Return a byte for each character of IDL's char."""
    made = bytes(map(ord, values))
    if made and max(made) > _HIGHEST_CHAR:
        raise Refused
    return made


def from_chars(values: bytes | memoryview) -> list[str]:
    """Return a character for each byte."""
    return list(str(values, "ascii"))


def to_wchars(values: Iterable[str]) -> bytes:
    """Return four bytes for each character of IDL's wchar."""
    made = array("I", map(ord, values))
    if made and max(made) > ord(_HIGHEST_UNIT):
        raise Refused
    return made.tobytes()


def from_wchars(values: bytes | memoryview) -> list[str]:
    """Return a character for each four bytes."""
    return list(map(wchar, memoryview(values).cast("I")))


def to_wide(text: str) -> bytes:
    """Return the UTF-16 code units of a text in four bytes each; raises UnicodeEncodeError."""
    if text.isascii() or max(text) <= _HIGHEST_UNIT:
        return text.encode("utf-32-le")
    return array("I", memoryview(text.encode("utf-16-le")).cast("H").tolist()).tobytes()


def from_wide(units: bytes | memoryview) -> str:
    """Return the text of UTF-16 code units of four bytes each; raises ValueError if they are invalid."""
    try:
        text = str(units, "utf-32-le")
    except UnicodeDecodeError:  # pairs of units, or no text at all
        values = memoryview(units).cast("I").tolist()
        if max(values) > ord(_HIGHEST_UNIT):
            raise
        return str(array("H", values), "utf-16-le")
    if not text.isascii() and max(text) > _HIGHEST_UNIT:
        raise Refused
    return text


def to_char(character: str) -> int:
    """Return the code of a char; raises Refused if it is out of range."""
    return to_chars((character,))[0]


def to_wchar(character: str) -> int:
    """Return the code unit of a wchar; raises Refused if there are two."""
    if character > _HIGHEST_UNIT:
        raise Refused
    return ord(character)


def char(code: int) -> str:
    """Return the character of a code; raises Refused if it is out of range."""
    if code > _HIGHEST_CHAR:
        raise Refused
    return chr(code)


def wchar(unit: int) -> str:
    """Return the character of a code unit."""
    if unit > ord(_HIGHEST_UNIT):
        raise Refused
    return chr(unit)
