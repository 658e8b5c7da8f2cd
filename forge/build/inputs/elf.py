"""Read the sections of ELF programs and shared libraries (System V gABI)."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from forge.base.frozen import frozen

if TYPE_CHECKING:
    from mmap import mmap

_IDENT = b"\x7fELF\x02\x01\x01"
"""64 bits, little-endian; files of other machines are not read."""
_HEADER = struct.Struct("<16xHHIQQQIHHHHHH")
_SECTION = struct.Struct("<IIQQQQIIQQ")
_SEGMENT = struct.Struct("<IIQQQQQQ")
_ET_DYN, _SHT_NOBITS, _PT_GNU_RELRO = 3, 8, 0x6474E552
SYMBOL = struct.Struct("<IBBHQQ")
DYNAMIC = struct.Struct("<qQ")
SHT_DYNAMIC, SHT_DYNSYM = 6, 11
NAMES = frozenset({1, 14, 15, 29})
"""DT_NEEDED, DT_SONAME, DT_RPATH and DT_RUNPATH, whose values are names in the string table."""


@frozen
class Section:
    name: str
    type: int
    flags: int
    body: bytes
    link: int
    alignment: int
    address: int
    size: int


@frozen
class Library:
    machine: tuple[int, int, bytes]
    """The machine, its flags, and the ABI of the operating system."""
    sections: tuple[Section, ...]
    relro: tuple[tuple[int, int], ...]
    """The addresses that are read-only after relocation."""
    end: int
    """The end of the table of sections, usually the end of the file."""


def read_library(content: bytes | mmap) -> Library | None:
    """Return the sections of a shared library; None for any other file."""
    if content[: len(_IDENT)] != _IDENT:
        return None
    type_, machine, _, _, segments, start, flags, _, segment_size, segment_count, size, count, names_at = (
        _HEADER.unpack_from(content)
    )
    if type_ != _ET_DYN or not start or size != _SECTION.size:
        return None
    headers = [_SECTION.unpack_from(content, start + number * size) for number in range(count)]
    _, _, _, _, names_offset, names_size, *_ = headers[names_at]
    names = content[names_offset : names_offset + names_size]
    sections = []
    for name, kind, attributes, address, offset, length, link, _, alignment, _ in headers:
        body = b"" if kind == _SHT_NOBITS else content[offset : offset + length]
        sections.append(
            Section(text_at(names, name), kind, attributes, body, link, alignment, address, length)
        )
    relro = tuple(
        (address, address + extent)
        for kind, _, _, address, _, _, extent, _ in (
            _SEGMENT.unpack_from(content, segments + number * segment_size) for number in range(segment_count)
        )
        if kind == _PT_GNU_RELRO
    )
    return Library((machine, flags, content[7:9]), tuple(sections), relro, start + count * size)


def text_at(strings: bytes, at: int) -> str:
    return strings[at : strings.index(b"\0", at)].decode(errors="surrogateescape")
