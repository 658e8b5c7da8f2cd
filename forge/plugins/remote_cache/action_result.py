"""Encode and decode the fields that forge uses of ActionResult in Bazel's remote execution API v2.

The message has some twenty fields; forge writes three and skips the others. The protobuf package would take
longer to import than a build takes to decode the results of hundreds of packages. Servers may send anything:
decoding takes linear time and returns a value or raises ValueError.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, Final

from forge.cache.model import ActionResult, Digest, OutputFile

MAX_SIZE: Final = 16 << 20
"""The maximum size of a message in bytes; 100,000 files take less."""

_VARINT, _FIXED64, _BYTES, _GROUP, _GROUP_ENDS, _FIXED32 = range(6)
_FILES, _EXIT_CODE, _STDOUT = 2 << 3 | _BYTES, 4 << 3 | _VARINT, 5 << 3 | _BYTES
_PATH, _DIGEST = 1 << 3 | _BYTES, 2 << 3 | _BYTES
_HASH, _SIZE = 1 << 3 | _BYTES, 2 << 3 | _VARINT
"""Tags of fields: their number and type."""

_MAX_DEPTH: Final = 100
"""The maximum nesting of groups, as in protobuf's own parsers."""

_SHA256: Final = re.compile(r"[0-9a-f]{64}")


def encode(result: ActionResult) -> bytes:
    """Return the message; raises ValueError for a path that is not valid UTF-8."""
    message = bytearray()
    for file in result.files:
        digest = _counted(_HASH, file.digest.hash.encode()) + _number(_SIZE, file.digest.size)
        message += _counted(_FILES, _counted(_PATH, file.path.encode()) + _counted(_DIGEST, digest))
    return bytes(message + _counted(_STDOUT, result.stdout))


def decode(data: bytes) -> ActionResult:
    """Decode a message; raises ValueError for malformed bytes and invalid files."""
    if len(data) > MAX_SIZE:
        raise ValueError(f"the message has {len(data)} bytes, more than {MAX_SIZE}")
    files: list[OutputFile] = []
    stdout = b""
    for tag, value in _fields(data):
        if tag == _FILES:
            files.append(_file(value))
        elif tag == _EXIT_CODE and value & 0xFFFF_FFFF:
            raise ValueError("it is the result of a failed action")
        elif tag == _STDOUT:
            stdout = value
    return ActionResult(tuple(files), stdout)


def _file(data: bytes) -> OutputFile:
    """Decode an OutputFile: its path is relative, and sizes from 2**63 represent negative ones."""
    path, name, size = "", "", 0
    for tag, value in _fields(data):
        if tag == _PATH:
            path = value.decode()
        elif tag == _DIGEST:  # the message may have several parts; later ones win
            for part, content in _fields(value):
                if part == _HASH:
                    name = content.decode()
                elif part == _SIZE:
                    size = content
    if not path or path.startswith("/") or ".." in path.split("/") or "\0" in path:
        raise ValueError(f"{path!r} is not a valid file name")
    if not _SHA256.fullmatch(name):
        raise ValueError(f"{name[:100]!r} is not a SHA-256")
    if size >= 1 << 63:
        raise ValueError("a file has a negative size")
    return OutputFile(path, Digest(name, size))


def _fields(data: bytes) -> Iterator[tuple[int, Any]]:
    """Yield the fields of a message by tag: varints as int, strings and messages as bytes.

    Fixed-size fields and groups are skipped, since forge uses none.
    """
    offset, groups = 0, list[int]()
    while offset < len(data):
        tag, offset = _varint(data, offset)
        number, kind = tag >> 3, tag & 7
        if not 0 < number < 1 << 29:
            raise ValueError("invalid field number")
        value: int | bytes | None = None
        if kind == _VARINT:
            value, offset = _varint(data, offset)
        elif kind == _BYTES:
            length, offset = _varint(data, offset)
            value, offset = data[offset : offset + length], offset + length
        elif kind in {_FIXED32, _FIXED64}:
            offset += 4 if kind == _FIXED32 else 8
        elif kind == _GROUP and len(groups) < _MAX_DEPTH:  # a deprecated type
            groups.append(number)
        elif kind != _GROUP_ENDS or not groups or groups.pop() != number:
            raise ValueError("invalid wire type")
        if offset > len(data):
            raise ValueError("the message ends in the middle of a field")
        if value is not None and not groups:
            yield tag, value
    if groups:
        raise ValueError("the message ends in the middle of a group")


def _varint(data: bytes, offset: int) -> tuple[int, int]:
    """Return a varint and its end: seven bits in each byte, the lowest first, 64 bits at most."""
    if offset < len(data) and data[offset] < 0x80:
        return data[offset], offset + 1
    value = 0
    for index, byte in enumerate(data[offset : offset + 10]):
        value |= (byte & 0x7F) << (7 * index)
        if byte < 0x80:
            return value & 0xFFFF_FFFF_FFFF_FFFF, offset + index + 1
    raise ValueError("unterminated varint")


def _number(tag: int, value: int) -> bytes:
    return bytes([tag, *_encoded(value)]) if value else b""


def _counted(tag: int, value: bytes) -> bytes:
    return bytes([tag, *_encoded(len(value))]) + value if value else b""


def _encoded(value: int) -> bytes:
    parts = bytearray()
    while value >= 0x80:
        parts.append(value & 0x7F | 0x80)
        value >>= 7
    parts.append(value)
    return bytes(parts)
