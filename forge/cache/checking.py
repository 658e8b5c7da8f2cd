"""Transfer blobs and results: verify downloads, and read files for uploads."""

from __future__ import annotations

import contextlib
import hashlib
from typing import TYPE_CHECKING

from forge.cache.action_result import decode, encode
from forge.cache.model import BlobError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path
    from typing import BinaryIO

    from forge.cache.model import ActionResult, Digest


class BlobDownload:
    """A download into a file, which is kept only if `finish()` succeeded.

    Blocks may come from another thread. After the download was abandoned, the next block raises BlobError.
    """

    def __init__(self, store: str, digest: Digest, target: Path, stream: BinaryIO) -> None:
        """Start a download of `digest`; messages refer to the source as `store`."""
        self._what = f"{store}: blob {digest.hash[:12]}"
        self.digest, self._target, self._stream = digest, target, stream
        self._hash, self._size = hashlib.sha256(), 0
        self.is_complete = False

    def expect(self, size: int | None) -> None:
        """Raise BlobError if the announced size is wrong."""
        if size is not None and size != self.digest.size:
            raise BlobError(f"{self._what} has {size} bytes instead of {self.digest.size}")

    def write(self, block: bytes) -> None:
        """Write the next bytes; raises BlobError if there are too many."""
        self._size += len(block)
        if self._size > self.digest.size:
            raise BlobError(f"{self._what} has more than {self.digest.size} bytes")
        self._hash.update(block)
        try:
            self._stream.write(block)
        except OSError as error:
            raise BlobError(f"cannot write {self._target}: {error.strerror}") from None

    def finish(self) -> bool:
        """Verify size and hash of the complete blob; raises BlobError if they are wrong."""
        self.expect(self._size)
        if self._hash.hexdigest() != self.digest.hash:
            raise BlobError(f"{self._what} is corrupt: its content does not match its SHA-256")
        self.is_complete = True
        return True


@contextlib.contextmanager
def receiving(store: str, digest: Digest, target: Path) -> Iterator[BlobDownload]:
    """Yield a download into `target`; the file is removed after an error or without `finish()`."""
    arrival = None
    try:
        with target.open("xb", buffering=0) as stream:
            arrival = BlobDownload(store, digest, target, stream)
            yield arrival
    except OSError as error:
        raise BlobError(f"cannot write {target}: {error.strerror}") from None
    finally:
        if arrival is not None and not arrival.is_complete:
            target.unlink(missing_ok=True)


def read_blocks(source: Path, stream: BinaryIO, digest: Digest, block: int) -> Iterator[bytes]:
    """Yield the bytes of a file from its start; raises BlobError if it is shorter than `digest.size`."""
    stream.seek(0)
    left = digest.size
    while left:
        data = stream.read(min(block, left))
        if not data:
            raise BlobError(f"{source} was truncated during the upload")
        left -= len(data)
        yield data


def encode_result(result: ActionResult) -> bytes:
    """Return an encoded result; raises BlobError if it cannot be encoded."""
    try:
        return encode(result)
    except ValueError as error:
        raise BlobError(f"cannot encode a file name: {error}") from None


def decode_result(store: str, key: str, data: bytes | None) -> ActionResult | None:
    """Return the decoded result of a key, or None without data; raises BlobError if it is invalid."""
    try:
        return None if data is None else decode(data)
    except ValueError as error:
        raise BlobError(f"{store}: ac/{key[:12]} is not a valid result: {error}") from None


@contextlib.contextmanager
def open_source(source: Path) -> Iterator[BinaryIO]:
    """Open a file for uploading; raises BlobError if it cannot be read."""
    try:
        stream = source.open("rb")
    except OSError as error:
        raise BlobError(f"cannot read {source}: {error.strerror}") from None
    with stream:
        yield stream
