"""ActionResult of Bazel's remote execution API v2, to bytes and back, as far as forge uses it.

The message has some twenty fields; forge writes three and skips the others. A package for all of protobuf
would be loaded for that by every build that asks a cache. What servers send may be anything: reading takes
time in proportion to the bytes, and ends with a value or a ValueError.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from forge.caching.model import ActionResult, Digest, OutputFile

if TYPE_CHECKING:
    from collections.abc import Iterator

LARGEST: Final = 16 << 20
"""How many bytes of a message are read: 100,000 files take less."""

_VARINT, _FIXED64, _BYTES, _GROUP, _GROUP_ENDS, _FIXED32 = range(6)
_FILES, _EXIT_CODE, _STDOUT = 2, 4, 5
_PATH, _DIGEST, _EXECUTABLE = 1, 2, 4
_HASH, _SIZE = 1, 2
_DEEPEST: Final = 100
"""How deep groups may stand inside each other; as many as protobuf's own readers allow."""

_SHA256: Final = re.compile(r"[0-9a-f]{64}")


def encode(result: ActionResult) -> bytes:
    """Return the message; a path that is no UTF-8 is a ValueError."""
    message = bytearray()
    for file in result.files:
        digest = _text(_HASH, file.digest.hash) + _number(_SIZE, file.digest.size)
        message += _counted(
            _FILES,
            _text(_PATH, file.path) + _counted(_DIGEST, digest) + _number(_EXECUTABLE, int(file.executable)),
        )
    return bytes(message + (_counted(_STDOUT, result.stdout) if result.stdout else b""))


def decode(data: bytes) -> ActionResult:
    """Read a message; a ValueError says what forge cannot use: malformed bytes, or what no file can be."""
    if len(data) > LARGEST:
        raise ValueError(f"the message has {len(data)} bytes, more than {LARGEST}")
    files: list[OutputFile] = []
    stdout = b""
    for number, value in _fields(data):
        if number == _FILES and isinstance(value, bytes):
            files.append(_file(value))
        elif number == _EXIT_CODE and isinstance(value, int) and value & 0xFFFF_FFFF:
            raise ValueError("it is the result of something that failed")
        elif number == _STDOUT and isinstance(value, bytes):
            stdout = value
    return ActionResult(tuple(files), stdout)


def _file(data: bytes) -> OutputFile:
    """Read an OutputFile, which names a file below some folder."""
    path, executable, digest = "", False, _Draft()
    for number, value in _fields(data):
        if number == _PATH and isinstance(value, bytes):
            path = value.decode()
        elif number == _DIGEST and isinstance(value, bytes):
            digest.read(value)
        elif number == _EXECUTABLE and isinstance(value, int):
            executable = value != 0
    if not path or path.startswith("/") or ".." in path.split("/") or "\0" in path:
        raise ValueError(f"{path!r} is no name of a file")
    return OutputFile(path, digest.made(), executable)


class _Draft:
    """A Digest while it is read; a message may give it in several parts, of which later ones win."""

    def __init__(self) -> None:
        self.hash, self.size = "", 0

    def read(self, data: bytes) -> None:
        """Take over what one part says."""
        for number, value in _fields(data):
            if number == _HASH and isinstance(value, bytes):
                self.hash = value.decode()
            elif number == _SIZE and isinstance(value, int):
                self.size = value

    def made(self) -> Digest:
        """Return the digest, if it can be one; numbers from 2**63 on stand for negative ones."""
        if not _SHA256.fullmatch(self.hash):
            raise ValueError(f"{self.hash[:100]!r} is no SHA-256")
        if self.size >= 1 << 63:
            raise ValueError("a file has a negative size")
        return Digest(self.hash, self.size)


def _fields(data: bytes) -> Iterator[tuple[int, int | bytes]]:
    """Yield the fields of a message by number: numbers as int, texts and messages as bytes.

    What has four or eight bytes, and what stands in groups, is passed over: no field of forge is like that.
    """
    at, groups = 0, list[int]()
    while at < len(data):
        tag, at = _varint(data, at)
        number, kind = tag >> 3, tag & 7
        if not 0 < number < 1 << 29:
            raise ValueError("a field has a number that there is not")
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
    """Open or close a group, a kind of message that nobody has written for twenty years."""
    if kind == _GROUP and len(groups) < _DEEPEST:
        groups.append(number)
    elif kind != _GROUP_ENDS or not groups or groups.pop() != number:
        raise ValueError("a field has a kind that there is not, or not there")


def _varint(data: bytes, at: int) -> tuple[int, int]:
    """Return a number and where it ends: seven bits in each byte, the lowest first, 64 bits at most."""
    if at < len(data) and data[at] < 0x80:  # noqa: PLR2004  (the bit that says that more follow)
        return data[at], at + 1
    value = 0
    for place, byte in enumerate(data[at : at + 10]):
        value |= (byte & 0x7F) << (7 * place)
        if byte < 0x80:  # noqa: PLR2004  (as above)
            return value & 0xFFFF_FFFF_FFFF_FFFF, at + place + 1
    raise ValueError("a number does not end")


def _number(field: int, value: int) -> bytes:
    return _encoded(field << 3 | _VARINT) + _encoded(value) if value else b""


def _text(field: int, text: str) -> bytes:
    return _counted(field, text.encode()) if text else b""


def _counted(field: int, value: bytes) -> bytes:
    return _encoded(field << 3 | _BYTES) + _encoded(len(value)) + value


def _encoded(value: int) -> bytes:
    parts = bytearray()
    while value >= 0x80:  # noqa: PLR2004  (as in _varint)
        parts.append(value & 0x7F | 0x80)
        value >>= 7
    parts.append(value)
    return bytes(parts)
