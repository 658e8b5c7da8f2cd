"""Compute a digest of the ABI of a shared library.

Everything that linking with it depends on. A linker reads the dynamic symbols of a shared library, not its
code: linking with a library of the same ABI produces an identical program. A program that is not
position-independent holds copies of the variables that it uses. Their location and size follow from size,
alignment and section of each symbol that is not a function, whatever its type says; symbols of the same
variable refer to one copy.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator

from forge.base.files import open_regular
from forge.build.inputs.elf import (
    DYNAMIC,
    NAMES,
    SHT_DYNAMIC,
    SHT_DYNSYM,
    SYMBOL,
    Library,
    read_library,
    text_at,
)

_FUNCTIONS = frozenset({2, 10})
"""STT_FUNC and STT_GNU_IFUNC."""
_SHN_UNDEF, _SHN_LORESERVE = 0, 0xFF00
_FLAGS = frozenset({16, 22, 30, 0x6FFFFFFB})
"""DT_SYMBOLIC, DT_TEXTREL, DT_FLAGS and DT_FLAGS_1."""
_WHOLE = (
    *(".gnu.version", ".gnu.version_d", ".gnu.version_r", ".note.gnu.property"),
    *(".gnu.attributes", ".ARM.attributes", ".riscv.attributes"),
)
_WARNING = ".gnu.warning"


def abi_digest(path: str) -> str:
    """Return a digest of a shared library's interface; '' if a file has no interface or an unknown one."""
    try:
        with open(path, "rb", opener=open_regular) as stream:
            content = stream.read()
        library = read_library(content)
        if library is None:
            return ""
        digest = hashlib.blake2b(digest_size=16)
        for line in _lines(library):
            digest.update(repr(line).encode() + b"\n")
    except (OSError, ValueError, LookupError, struct.error):
        return ""
    return digest.hexdigest()


def _lines(library: Library) -> Iterator[object]:
    """Yield the facts that linkers use; raises LookupError for a library without dynamic symbols."""
    yield library.machine
    sections = library.sections
    for section in sections:
        if section.name in _WHOLE or section.name.startswith(_WARNING):
            yield section.name, section.body
    dynamic = next((section for section in sections if section.type == SHT_DYNAMIC), None)
    if dynamic is None:
        raise LookupError("there is no dynamic section")
    for tag, value in DYNAMIC.iter_unpack(dynamic.body):
        if tag in NAMES:
            yield tag, text_at(sections[dynamic.link].body, value)
        elif tag in _FLAGS:
            yield tag, value
    yield from _symbols(library)


def _symbols(library: Library) -> Iterator[object]:
    symbols = next((section for section in library.sections if section.type == SHT_DYNSYM), None)
    if symbols is None:
        raise LookupError("there are no dynamic symbols")
    texts = library.sections[symbols.link].body
    first: dict[tuple[int, int], int] = {}
    """The first symbol at each address."""
    for number, (name, info, other, home, value, size) in enumerate(SYMBOL.iter_unpack(symbols.body)):
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
        yield text_at(texts, name), info, other, place


def _variable(library: Library, home: int, value: int, size: int) -> tuple[object, ...]:
    """Return the properties of a variable's address that linkers use; without a size, nothing is copied."""
    section = library.sections[home]
    read_only = any(start <= value < end for start, end in library.relro)
    alignment = (section.alignment, value % max(section.alignment, 1)) if size else ()
    return size, section.name, section.flags, read_only, alignment
