"""Compute a digest of the ABI of a shared library.

Everything that linking with it depends on (ELF, System V gABI). A linker reads the dynamic symbols of a
shared library, not its code: linking with a library of the same ABI produces an identical program. A program
that is not position-independent holds copies of the variables that it uses. Their location and size follow
from size, alignment and section of each symbol that is not a function, whatever its type says; symbols of the
same variable refer to one copy.
"""

from __future__ import annotations

import hashlib
import re
import struct
from typing import TYPE_CHECKING

from forge.base.files import open_regular
from forge.base.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterator
    from mmap import mmap

_IDENT = b"\x7fELF\x02\x01\x01"
"""64 bits, little-endian; libraries of other machines have no known interface."""
_HEADER = struct.Struct("<16xHHIQQQIHHHHHH")
_SECTION = struct.Struct("<IIQQQQIIQQ")
_SYMBOL = struct.Struct("<IBBHQQ")
_DYNAMIC = struct.Struct("<qQ")
_VERNEED, _VERNAUX = struct.Struct("<HHIII"), struct.Struct("<IHHII")
_SEGMENT = struct.Struct("<IIQQQQQQ")

_ET_DYN = 3
_SHT_DYNAMIC, _SHT_NOBITS, _SHT_DYNSYM, _SHT_VERNEED = 6, 8, 11, 0x6FFFFFFE
_PT_GNU_RELRO = 0x6474E552
_FUNCTIONS = frozenset({2, 10})
"""STT_FUNC and STT_GNU_IFUNC."""
_SHN_UNDEF, _SHN_LORESERVE = 0, 0xFF00
_NAMES = frozenset({1, 14, 15, 29})
"""DT_NEEDED, DT_SONAME, DT_RPATH and DT_RUNPATH, whose values are names in the string table."""
_FLAGS = frozenset({16, 22, 30, 0x6FFFFFFB})
"""DT_SYMBOLIC, DT_TEXTREL, DT_FLAGS and DT_FLAGS_1."""
_WHOLE = (
    *(".gnu.version", ".gnu.version_d", ".gnu.version_r", ".note.gnu.property"),
    *(".gnu.attributes", ".ARM.attributes", ".riscv.attributes"),
)
_WARNING = ".gnu.warning"
_DT_STRSZ = 10
_ZEROS = re.compile(rb"\0+")


@frozen
class _Section:
    name: str
    type: int
    flags: int
    body: bytes
    link: int
    alignment: int
    address: int
    size: int


@frozen
class _Library:
    machine: tuple[int, int, bytes]
    """The machine, its flags, and the ABI of the operating system."""
    sections: tuple[_Section, ...]
    relro: tuple[tuple[int, int], ...]
    """The addresses that are read-only after relocation."""
    end: int
    """The end of the table of sections, usually the end of the file."""


def abi_digest(path: str) -> str:
    """Return a digest of a shared library's interface; '' if a file has no interface or an unknown one."""
    try:
        with open(path, "rb", opener=open_regular) as stream:
            content = stream.read()
        library = _read(content)
        if library is None:
            return ""
        digest = hashlib.blake2b(digest_size=16)
        for line in _lines(library):
            digest.update(repr(line).encode() + b"\n")
    except (OSError, ValueError, LookupError, struct.error):
        return ""
    return digest.hexdigest()


def linked_parts(content: bytes | mmap) -> str:
    """Return a digest of a program or shared library that does not depend on its run path.

    CMake links with the folders of libraries as run path, and overwrites them with zeros when it installs.
    The zeros still change the offsets of later tables, and the build ID was computed before. Returns '' for
    other files, and for files that contain more than sections.
    """
    try:
        library = _read(content)
        if library is None or library.end != len(content):
            return ""
        strings = next((section.body for section in library.sections if section.name == ".dynstr"), b"")
        names = {section.address: section.name for section in library.sections if section.address}
        digest = hashlib.sha256(repr(library.machine).encode())
        for section in library.sections:
            body, size = section.body, section.size
            entries: object = None
            if section.name == ".dynstr":
                body, size = _ZEROS.sub(b"\0", body), 0
            elif section.name == ".note.gnu.build-id":
                body = b""
            elif section.type == _SHT_DYNAMIC:
                entries = [
                    (tag, _text(strings, value) if tag in _NAMES else names.get(value, value))
                    for tag, value in _DYNAMIC.iter_unpack(body)
                    if tag != _DT_STRSZ
                ]
            elif section.type == _SHT_DYNSYM:
                entries = [(_text(strings, name), *rest) for name, *rest in _SYMBOL.iter_unpack(body)]
            elif section.type == _SHT_VERNEED:
                entries = [*_needed_versions(body, strings)]
            description = (section.name, section.type, section.flags, section.alignment, size, entries)
            digest.update(repr(description).encode(errors="surrogateescape"))
            digest.update(body if entries is None else b"")
    except (ValueError, LookupError, struct.error):
        return ""
    return digest.hexdigest()


def _needed_versions(body: bytes, strings: bytes) -> Iterator[object]:
    """Yield the contents of a section of needed versions."""
    at, following = 0, 1
    while following:
        version, count, file, first, following = _VERNEED.unpack_from(body, at)
        yield version, _text(strings, file)
        each = at + first
        for _ in range(count):
            *needed, name, step = _VERNAUX.unpack_from(body, each)
            yield *needed, _text(strings, name)
            each += step
        at += following


def _read(content: bytes | mmap) -> _Library | None:
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
            _Section(_text(names, name), kind, attributes, body, link, alignment, address, length)
        )
    relro = tuple(
        (address, address + extent)
        for kind, _, _, address, _, _, extent, _ in (
            _SEGMENT.unpack_from(content, segments + number * segment_size) for number in range(segment_count)
        )
        if kind == _PT_GNU_RELRO
    )
    return _Library((machine, flags, content[7:9]), tuple(sections), relro, start + count * size)


def _lines(library: _Library) -> Iterator[object]:
    """Yield the facts that linkers use; raises LookupError for a library without dynamic symbols."""
    yield library.machine
    sections = library.sections
    for section in sections:
        if section.name in _WHOLE or section.name.startswith(_WARNING):
            yield section.name, section.body
    dynamic = next((section for section in sections if section.type == _SHT_DYNAMIC), None)
    if dynamic is None:
        raise LookupError("there is no dynamic section")
    for tag, value in _DYNAMIC.iter_unpack(dynamic.body):
        if tag in _NAMES:
            yield tag, _text(sections[dynamic.link].body, value)
        elif tag in _FLAGS:
            yield tag, value
    yield from _symbols(library)


def _symbols(library: _Library) -> Iterator[object]:
    symbols = next((section for section in library.sections if section.type == _SHT_DYNSYM), None)
    if symbols is None:
        raise LookupError("there are no dynamic symbols")
    texts = library.sections[symbols.link].body
    first: dict[tuple[int, int], int] = {}
    """The first symbol at each address."""
    for number, (name, info, other, home, value, size) in enumerate(_SYMBOL.iter_unpack(symbols.body)):
        if home == _SHN_UNDEF:
            place: object = "undefined"
        elif home >= _SHN_LORESERVE:
            place = home, value, size
        elif info & 15 in _FUNCTIONS:
            place = "function"
        else:
            place = _variable(library, home, value, size)
            if size:
                place = place, first.setdefault((home, value), number)
        yield _text(texts, name), info, other, place


def _variable(library: _Library, home: int, value: int, size: int) -> tuple[object, ...]:
    """Return the properties of a variable's address that linkers use; without a size, nothing is copied."""
    section = library.sections[home]
    read_only = any(start <= value < end for start, end in library.relro)
    alignment = (section.alignment, value % max(section.alignment, 1)) if size else ()
    return size, section.name, section.flags, read_only, alignment


def _text(strings: bytes, at: int) -> str:
    return strings[at : strings.index(b"\0", at)].decode(errors="surrogateescape")
