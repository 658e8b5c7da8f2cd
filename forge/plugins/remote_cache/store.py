"""Results and blobs on a backend: verified downloads, and a time limit for each request."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Final, Protocol, TypeVar

from forge.cache.model import ActionResult, BlobError, Digest, StoreError
from forge.plugins.remote_cache.action_result import MAX_SIZE, decode, encode
from forge.plugins.remote_cache.deadline import Deadline, DeadlineExceeded, TimeoutExecutor

_Answer = TypeVar("_Answer")

_BLOCK: Final = 1 << 16
"""Bytes to send at a time."""

_USER: Final = re.compile(r"(?<=//)[^/]*@")


class WritingRefused(StoreError):
    """The store rejects writing; it may still be read."""


class Backend(Protocol):
    """Files on a server, by the paths ac/KEY and cas/SHA-256.

    Several threads call it at a time, and may be abandoned. Any exception counts as a fault of the server,
    except FileNotFoundError, BlobError and WritingRefused, for which the reason is a sufficient message.
    """

    def read(self, path: str) -> Generator[bytes]:
        """Yield the bytes of a file in blocks; raises FileNotFoundError if it does not exist."""

    def size(self, path: str) -> int | None:
        """Return the size of a file, None if unknown; raises FileNotFoundError if it does not exist."""

    def write(self, path: str, size: int, blocks: Callable[[], Iterable[bytes]]) -> None:
        """Write a file atomically. To send it again after a fault, call `blocks` again."""

    def close(self) -> None:
        """Close all connections."""


class Store:
    """Stores results by key and blobs by digest. Every method may raise StoreError."""

    def __init__(self, backend: Backend, url: str, seconds: float) -> None:
        """Use the backend of a URL; each request may take `seconds`, and more for large files."""
        self.name = _USER.sub("", url).rstrip("/")
        user = _USER.search(url)
        self._secret = user[0] if user else None
        self._backend = backend
        self._seconds = seconds
        self._executor = TimeoutExecutor()
        self._rewrite_blobs = False

    def result(self, key: str) -> ActionResult | None:
        """Return the result stored for a key, or None."""

        def read(deadline: Deadline) -> ActionResult:
            data = bytearray()
            with closing(self._backend.read(f"ac/{key}")) as blocks:
                for block in deadline.metered(blocks):
                    data += block
                    if len(data) > MAX_SIZE:
                        raise BlobError(f"ac/{key[:12]} is too large for a result")
            try:
                return decode(bytes(data))
            except ValueError as error:
                raise BlobError(f"ac/{key[:12]} is not a valid result: {error}") from None

        return self._find(read)

    def put_result(self, key: str, result: ActionResult) -> None:
        """Store a result, whose blobs must be stored already."""
        try:
            data = encode(result)
        except ValueError as error:
            raise BlobError(f"{self.name}: cannot encode a file name: {error}") from None
        self._call(lambda deadline: self._backend.write(f"ac/{key}", len(data), lambda: (data,)))

    def fetch(self, digest: Digest, target: Path) -> bool:
        """Write a blob to the new file `target`; return False if the store does not have it.

        On True, size and SHA-256 have been verified. Otherwise `target` does not exist.
        """
        what = f"blob {digest.hash[:12]}"

        def download(deadline: Deadline) -> bool:
            hasher, size = hashlib.sha256(), 0
            with closing(self._backend.read(f"cas/{digest.hash}")) as blocks:
                for block in deadline.metered(blocks):
                    size += len(block)
                    if size > digest.size:
                        raise BlobError(f"{what} has more than {digest.size} bytes")
                    hasher.update(block)
                    try:
                        stream.write(block)
                    except OSError as error:
                        raise BlobError(f"cannot write {target}: {error.strerror}") from None
            if size != digest.size:
                raise BlobError(f"{what} has {size} bytes instead of {digest.size}")
            if hasher.hexdigest() != digest.hash:
                raise BlobError(f"{what} is corrupt: its content does not match its SHA-256")
            return True

        complete = None
        try:
            stream = target.open("xb")
            try:
                with stream:
                    complete = self._find(download)
            finally:
                if not complete:
                    target.unlink(missing_ok=True)
        except OSError as error:
            raise BlobError(f"cannot write {target}: {error.strerror}") from None
        except BlobError:
            self._rewrite_blobs = True
            raise
        return bool(complete)

    def put(self, digest: Digest, source: Path) -> None:
        """Store a blob unless it exists; after a corrupt download, existing blobs are overwritten."""
        path = f"cas/{digest.hash}"

        def exists(_: Deadline) -> bool:
            return self._backend.size(path) in {None, digest.size}

        def write(deadline: Deadline) -> None:
            blocks = lambda: deadline.metered(_blocks(source, digest.size))  # noqa: E731
            self._backend.write(path, digest.size, blocks)

        if self._rewrite_blobs or not self._find(exists):
            self._call(write)

    def close(self) -> None:
        """Abort pending requests and close all connections."""
        self._executor.close()
        self._backend.close()

    def _find(self, job: Callable[[Deadline], _Answer]) -> _Answer | None:
        """Run a job that reads a file until its deadline; return None if the file does not exist."""

        def read(deadline: Deadline) -> _Answer | None:
            try:
                return job(deadline)
            except FileNotFoundError:
                return None

        return self._call(read)

    def _call(self, job: Callable[[Deadline], _Answer]) -> _Answer:
        """Run a job until its deadline; messages of its exceptions begin with the name of the store."""
        try:
            return self._executor.run(self._seconds, job)
        except DeadlineExceeded:
            raise StoreError(f"{self.name}: timed out after {self._seconds:g} s") from None
        except StoreError as fault:
            raise type(fault)(f"{self.name}: {fault}") from None
        except Exception as error:
            line = str(error).partition("\n")[0]
            text = f"{type(error).__name__}{line and ': '}{line}"[:300]
            text = text.replace(self._secret, "") if self._secret else text
            raise StoreError(f"{self.name}: {text}") from None


def _blocks(source: Path, remaining: int) -> Iterator[bytes]:
    """Yield the first `remaining` bytes of a file; raises BlobError if it is shorter."""
    try:
        with source.open("rb") as stream:
            while remaining:
                block = stream.read(min(_BLOCK, remaining))
                if not block:
                    raise BlobError(f"{source} was truncated during the upload")
                remaining -= len(block)
                yield block
    except OSError as error:
        raise BlobError(f"cannot read {source}: {error.strerror}") from None
