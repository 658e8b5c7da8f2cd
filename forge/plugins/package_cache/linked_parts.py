"""Compute a digest of a program or shared library that is the same in each install folder."""

from __future__ import annotations

import hashlib
import re
import struct
from typing import TYPE_CHECKING

from forge.build.inputs.elf import DYNAMIC, NAMES, SHT_DYNAMIC, SHT_DYNSYM, SYMBOL, read_library, text_at

if TYPE_CHECKING:
    from collections.abc import Iterator
    from mmap import mmap

_VERNEED, _VERNAUX = struct.Struct("<HHIII"), struct.Struct("<IHHII")
_SHT_VERNEED, _DT_STRSZ = 0x6FFFFFFE, 10
_ZEROS = re.compile(rb"\0+")


def linked_parts(content: bytes | mmap) -> str:
    """Return a digest of a program or shared library that does not depend on its run path.

    CMake links with the folders of libraries as run path, and overwrites them with zeros when it installs.
    The zeros still change the offsets of later tables, and the build ID was computed before. Returns '' for
    other files, and for files that contain more than sections.
    """
    try:
        library = read_library(content)
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
            elif section.type == SHT_DYNAMIC:
                entries = [
                    (tag, text_at(strings, value) if tag in NAMES else names.get(value, value))
                    for tag, value in DYNAMIC.iter_unpack(body)
                    if tag != _DT_STRSZ
                ]
            elif section.type == SHT_DYNSYM:
                entries = [(text_at(strings, name), *rest) for name, *rest in SYMBOL.iter_unpack(body)]
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
        yield version, text_at(strings, file)
        each = at + first
        for _ in range(count):
            *needed, name, step = _VERNAUX.unpack_from(body, each)
            yield *needed, text_at(strings, name)
            each += step
        at += following
