"""The data model of the package cache, and the Store protocol."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from forge.base.frozen import frozen

if TYPE_CHECKING:
    from pathlib import Path

RESTORED = "from the cache"
"""The remark for a package that was restored instead of built."""


@frozen
class Digest:
    """The name of a blob: the SHA-256 of its bytes in lower-case hex, and its size in bytes."""

    hash: str
    size: int


@frozen
class OutputFile:
    """A blob that belongs to a result, with its path within the result."""

    path: str
    digest: Digest
    executable: bool = False


@frozen
class ActionResult:
    """The fields that forge uses of ActionResult in Bazel's remote execution API: the result of a key.

    `stdout` contains a few bytes inside the message itself; larger data are blobs of `files`.
    """

    files: tuple[OutputFile, ...] = ()
    stdout: bytes = b""


class StoreError(Exception):
    """A store is unreachable, rejects a request, times out, or returns invalid data.

    The message is shown to users: the operation and the reason of its failure. It never fails a build.
    """


class Store(Protocol):
    """Stores results by key and blobs by digest. Every method may raise StoreError; stores are thread-safe.

    Keys are 64 lower-case hex digits.
    """

    name: str
    """The folder, or the URL without passwords, for messages."""

    def result(self, key: str) -> ActionResult | None:
        """Return the result stored for a key, or None."""

    def put_result(self, key: str, result: ActionResult) -> None:
        """Store a result, whose blobs must be stored already."""

    def fetch(self, digest: Digest, target: Path) -> bool:
        """Write a blob to the new file `target`; return False if the store does not have it.

        On True, size and SHA-256 have been verified. On False, `target` does not exist.
        """

    def put(self, digest: Digest, source: Path) -> None:
        """Store the bytes of the file `source`; the caller guarantees that `digest` is correct."""

    def close(self) -> None:
        """Close all connections."""


class BlobError(StoreError):
    """One blob or result is corrupt or too large for the store; others are not affected."""


class WritingRefused(StoreError):
    """The store rejects writing; it may still be read."""
