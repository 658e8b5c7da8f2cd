"""Compute a digest of the ABI of a shared library: all that linking with it depends on (ELF, System V gABI).

A linker reads the dynamic symbols of a shared library, not its code: linking with a library of the same ABI
produces an identical program.
"""

from __future__ import annotations

import hashlib
import re
import struct
from dataclasses import field
from typing import TYPE_CHECKING

from forge.base.files import open_regular
from forge.base.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

SHARED_LIBRARY = re.compile(r"/lib[^/]+\.so(\.[\d.]+)?$")
"""Paths of shared libraries, by the names that linkers look for."""

_IDENT = b"\x7fELF\x02\x01\x01"
"""64 bits, little-endian; libraries of other machines have no known interface."""
_HEADER = struct.Struct("<16xHHIQQQIHHHHHH")
_SECTION = struct.Struct("<IIQQQQIIQQ")
_SYMBOL = struct.Struct("<IBBHQQ")
_DYNAMIC = struct.Struct("<qQ")

_ET_DYN = 3
_SHT_DYNAMIC, _SHT_NOBITS, _SHT_DYNSYM = 6, 8, 11
_STT_OBJECT, _STT_COMMON, _STT_TLS = 1, 5, 6
_SHN_UNDEF, _SHN_LORESERVE = 0, 0xFF00
_NAMES = frozenset({1, 14, 15, 29})
"""DT_NEEDED, DT_SONAME, DT_RPATH and DT_RUNPATH, whose values are names in the string table."""
_FLAGS = frozenset({16, 22, 30, 0x6FFFFFFB})
"""DT_SYMBOLIC, DT_TEXTREL, DT_FLAGS and DT_FLAGS_1."""
_WHOLE = (".gnu.version", ".gnu.version_d", ".gnu.version_r", ".note.gnu.property")
_WARNING = ".gnu.warning"


@frozen
class _Section:
    type: int
    flags: int
    body: bytes
    link: int
    alignment: int


@frozen
class _Library:
    machine: int
    flags: int
    sections: tuple[_Section, ...] = ()
    names: Mapping[str, int] = field(default_factory=dict)


def abi_digest(path: str) -> str:
    """Return a digest of a shared library's interface; '' for a file that has none, or an unknown one."""
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


def _read(content: bytes) -> _Library | None:
    """Return the sections of a shared library; None for any other file."""
    if not content.startswith(_IDENT):
        return None
    type_, machine, _, _, _, start, flags, _, _, _, size, count, names_at = _HEADER.unpack_from(content)
    if type_ != _ET_DYN or not start or size != _SECTION.size:
        return None
    headers = [_SECTION.unpack_from(content, start + number * size) for number in range(count)]
    sections = []
    for _, kind, attributes, _, offset, length, link, _, alignment, _ in headers:
        body = b"" if kind == _SHT_NOBITS else content[offset : offset + length]
        sections.append(_Section(kind, attributes, body, link, alignment))
    texts = sections[names_at].body
    names = {_text(texts, header[0]): number for number, header in enumerate(headers)}
    return _Library(machine, flags, tuple(sections), names)


def _lines(library: _Library) -> Iterator[object]:
    """Yield the facts that linkers use; raises LookupError for a library without dynamic symbols."""
    yield library.machine, library.flags
    sections = library.sections
    for name, number in sorted(library.names.items()):
        if name in _WHOLE or name.startswith(_WARNING):
            yield name, sections[number].body
    dynamic = next((section for section in sections if section.type == _SHT_DYNAMIC), None)
    if dynamic is None:
        raise LookupError("there is no dynamic section")
    for tag, value in _DYNAMIC.iter_unpack(dynamic.body):
        if tag in _NAMES:
            yield tag, _text(sections[dynamic.link].body, value)
        elif tag in _FLAGS:
            yield tag, value
    symbols = next((section for section in sections if section.type == _SHT_DYNSYM), None)
    if symbols is None:
        raise LookupError("there are no dynamic symbols")
    texts = sections[symbols.link].body
    for name, info, other, home, value, size in _SYMBOL.iter_unpack(symbols.body):
        yield _text(texts, name), info, other, _data(sections, info & 15, home, value, size)


def _data(sections: tuple[_Section, ...], type_: int, home: int, value: int, size: int) -> object:
    """Return what a linker uses of a symbol's address and size: programs hold copies of variables."""
    if home == _SHN_UNDEF:
        return "undefined"
    if home >= _SHN_LORESERVE:
        return home, value, size
    if type_ not in {_STT_OBJECT, _STT_COMMON, _STT_TLS}:
        return "defined"
    section = sections[home]
    return size, section.flags, section.alignment, value % max(section.alignment, 1)


def _text(strings: bytes, at: int) -> str:
    return strings[at : strings.index(b"\0", at)].decode(errors="surrogateescape")
