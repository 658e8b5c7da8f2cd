"""Blobs that come from elsewhere: written to a new file, and kept only if they are what was asked for."""

from __future__ import annotations

import contextlib
import hashlib
from typing import TYPE_CHECKING

from forge.caching.action_result import decode, encode
from forge.caching.faults import BlobFault

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path
    from typing import BinaryIO

    from forge.caching.model import ActionResult, Digest


class Arrival:
    """A blob on its way into a file, which is there afterwards if `whole()` was reached.

    Blocks may come from another thread. When nobody waits for that any more, its next block is refused.
    """

    def __init__(self, store: str, digest: Digest, target: Path, stream: BinaryIO) -> None:
        """Expect the bytes of `digest` from a store that messages call so."""
        self._what = f"{store}: blob {digest.hash[:12]}"
        self.digest, self._target, self._stream = digest, target, stream
        self._hash, self._size = hashlib.sha256(), 0
        self.is_whole = False

    def expect(self, size: int | None) -> None:
        """Refuse at once what is announced with another size."""
        if size is not None and size != self.digest.size:
            raise BlobFault(f"{self._what} has {size} bytes there, and should have {self.digest.size}")

    def write(self, block: bytes) -> None:
        """Take the next bytes; more than there should be are refused."""
        self._size += len(block)
        if self._size > self.digest.size:
            raise BlobFault(f"{self._what} has more than the {self.digest.size} bytes that it should have")
        self._hash.update(block)
        try:
            self._stream.write(block)
        except OSError as error:
            raise BlobFault(f"cannot write {self._target}: {error.strerror}") from None

    def whole(self) -> bool:
        """Say that all has come; what is not as it should be is a fault."""
        self.expect(self._size)
        if self._hash.hexdigest() != self.digest.hash:
            raise BlobFault(f"{self._what} is spoilt: it has another SHA-256 than its name says")
        self.is_whole = True
        return True


@contextlib.contextmanager
def arriving(store: str, digest: Digest, target: Path) -> Iterator[Arrival]:
    """Give what a blob is written to; without `whole()`, and after an error, there is no file."""
    arrival = None
    try:
        with target.open("xb", buffering=0) as stream:
            arrival = Arrival(store, digest, target, stream)
            yield arrival
    except OSError as error:
        raise BlobFault(f"cannot write {target}: {error.strerror}") from None
    finally:
        if arrival is not None and not arrival.is_whole:
            target.unlink(missing_ok=True)


def departing(source: Path, stream: BinaryIO, digest: Digest, block: int) -> Iterator[bytes]:
    """Yield the bytes of a file from its beginning, as many as its digest says; fewer are a fault."""
    stream.seek(0)
    left = digest.size
    while left:
        data = stream.read(min(block, left))
        if not data:
            raise BlobFault(f"{source} became shorter while it was sent")
        left -= len(data)
        yield data


def encoded(result: ActionResult) -> bytes:
    """Return a result as it is sent; one that cannot be a message is a fault of its own."""
    try:
        return encode(result)
    except ValueError as error:
        raise BlobFault(f"the name of a file cannot be sent: {error}") from None


def decoded(store: str, key: str, data: bytes | None) -> ActionResult | None:
    """Return the result that a store has for a key, if any; bytes that are none are a fault of their own."""
    try:
        return None if data is None else decode(data)
    except ValueError as error:
        raise BlobFault(f"{store}: ac/{key[:12]} is no result: {error}") from None


@contextlib.contextmanager
def opened(source: Path) -> Iterator[BinaryIO]:
    """Open a file that is to be sent; one that cannot be read is a fault of that blob alone."""
    try:
        stream = source.open("rb")
    except OSError as error:
        raise BlobFault(f"cannot read {source}: {error.strerror}") from None
    with stream:
        yield stream
