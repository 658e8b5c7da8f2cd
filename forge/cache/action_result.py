"""Encode and decode the fields that forge uses of ActionResult in Bazel's remote execution API v2.

The message has some twenty fields; forge writes three and skips the others. This avoids importing a protobuf
package in every build with a cache. Servers may send anything: decoding takes linear time and returns a value
or raises ValueError.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from forge.cache.model import ActionResult, Digest, OutputFile

if TYPE_CHECKING:
    from collections.abc import Iterator

MAX_SIZE: Final = 16 << 20
"""The maximum size of a message in bytes; 100,000 files take less."""

_VARINT, _FIXED64, _BYTES, _GROUP, _GROUP_ENDS, _FIXED32 = range(6)
_FILES, _EXIT_CODE, _STDOUT = 2, 4, 5
_PATH, _DIGEST, _EXECUTABLE = 1, 2, 4
_HASH, _SIZE = 1, 2
_MAX_DEPTH: Final = 100
"""The maximum nesting of groups, as in protobuf's own parsers."""

_SHA256: Final = re.compile(r"[0-9a-f]{64}")


def encode(result: ActionResult) -> bytes:
    """Return the message; raises ValueError for a path that is not valid UTF-8."""
    message = bytearray()
    for file in result.files:
        digest = _text(_HASH, file.digest.hash) + _number(_SIZE, file.digest.size)
        message += _counted(
            _FILES,
            _text(_PATH, file.path) + _counted(_DIGEST, digest) + _number(_EXECUTABLE, int(file.executable)),
        )
    return bytes(message + (_counted(_STDOUT, result.stdout) if result.stdout else b""))


def decode(data: bytes) -> ActionResult:
    """Decode a message; raises ValueError for malformed bytes and invalid files."""
    if len(data) > MAX_SIZE:
        raise ValueError(f"the message has {len(data)} bytes, more than {MAX_SIZE}")
    files: list[OutputFile] = []
    stdout = b""
    for number, value in _fields(data):
        if number == _FILES and isinstance(value, bytes):
            files.append(_file(value))
        elif number == _EXIT_CODE and isinstance(value, int) and value & 0xFFFF_FFFF:
            raise ValueError("it is the result of a failed action")
        elif number == _STDOUT and isinstance(value, bytes):
            stdout = value
    return ActionResult(tuple(files), stdout)


def _file(data: bytes) -> OutputFile:
    """Decode an OutputFile, which has a relative path."""
    path, executable, digest = "", False, _Draft()
    for number, value in _fields(data):
        if number == _PATH and isinstance(value, bytes):
            path = value.decode()
        elif number == _DIGEST and isinstance(value, bytes):
            digest.read(value)
        elif number == _EXECUTABLE and isinstance(value, int):
            executable = value != 0
    if not path or path.startswith("/") or ".." in path.split("/") or "\0" in path:
        raise ValueError(f"{path!r} is not a valid file name")
    return OutputFile(path, digest.digest(), executable)


class _Draft:
    """A partially decoded Digest; a message may contain it in several parts, of which later ones win."""

    def __init__(self) -> None:
        self.hash, self.size = "", 0

    def read(self, data: bytes) -> None:
        """Decode one part."""
        for number, value in _fields(data):
            if number == _HASH and isinstance(value, bytes):
                self.hash = value.decode()
            elif number == _SIZE and isinstance(value, int):
                self.size = value

    def digest(self) -> Digest:
        """Return the digest; raises ValueError if invalid. Values from 2**63 represent negative sizes."""
        if not _SHA256.fullmatch(self.hash):
            raise ValueError(f"{self.hash[:100]!r} is not a SHA-256")
        if self.size >= 1 << 63:
            raise ValueError("a file has a negative size")
        return Digest(self.hash, self.size)


def _fields(data: bytes) -> Iterator[tuple[int, int | bytes]]:
    """Yield the fields of a message by number: varints as int, strings and messages as bytes.

    Fixed-size fields and groups are skipped, since forge uses none.
    """
    at, groups = 0, list[int]()
    while at < len(data):
        tag, at = _varint(data, at)
        number, kind = tag >> 3, tag & 7
        if not 0 < number < 1 << 29:
            raise ValueError("invalid field number")
        value: int | bytes | None = None
        if kind == _VARINT:
            value, at = _varint(data, at)
        elif kind == _BYTES:
            length, at = _varint(data, at)
            value, at = data[at : at + length], at + length
        elif kind in {_FIXED32, _FIXED64}:
            at += 4 if kind == _FIXED32 else 8
        else:
            _nest(groups, number, kind)
        if at > len(data):
            raise ValueError("the message ends in the middle of a field")
        if value is not None and not groups:
            yield number, value
    if groups:
        raise ValueError("the message ends in the middle of a group")


def _nest(groups: list[int], number: int, kind: int) -> None:
    """Open or close a group, a deprecated wire type."""
    if kind == _GROUP and len(groups) < _MAX_DEPTH:
        groups.append(number)
    elif kind != _GROUP_ENDS or not groups or groups.pop() != number:
        raise ValueError("invalid wire type")


def _varint(data: bytes, at: int) -> tuple[int, int]:
    """Return a varint and its end: seven bits in each byte, the lowest first, 64 bits at most."""
    if at < len(data) and data[at] < 0x80:
        return data[at], at + 1
    value = 0
    for index, byte in enumerate(data[at : at + 10]):
        value |= (byte & 0x7F) << (7 * index)
        if byte < 0x80:
            return value & 0xFFFF_FFFF_FFFF_FFFF, at + index + 1
    raise ValueError("unterminated varint")


def _number(field: int, value: int) -> bytes:
    return _encoded(field << 3 | _VARINT) + _encoded(value) if value else b""


def _text(field: int, text: str) -> bytes:
    return _counted(field, text.encode()) if text else b""


def _counted(field: int, value: bytes) -> bytes:
    return _encoded(field << 3 | _BYTES) + _encoded(len(value)) + value


def _encoded(value: int) -> bytes:
    parts = bytearray()
    while value >= 0x80:
        parts.append(value & 0x7F | 0x80)
        value >>= 7
    parts.append(value)
    return bytes(parts)
