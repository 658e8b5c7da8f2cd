"""The data model of the package cache, and the protocol of remote stores."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from forge.base.frozen import frozen

if TYPE_CHECKING:
    from forge.build.model import BuildRecord
    from forge.build.tasks import Task

RESTORED = "from the cache"
"""The remark for a package that was restored instead of built."""


class PackageCache(Protocol):
    """The cache behind `--cache`, which is a plugin."""

    notes: Mapping[str, str]
    """The result of storing or restoring each package, as text."""

    def find(self, task: Task) -> Any | None:
        """Return the result of a task that can be restored, or None if it must be built."""

    def restore(self, task: Task, found: Any) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Write a result into the task's prefix; return the paths of its files and empty folders."""

    def keep(self, task: Task, record: BuildRecord) -> BuildRecord:
        """Store the installed files of a task; return its record with the digest of its tree."""

    def remark(self, name: str) -> str:
        """Return the remarks of the cache about a package, or ''."""

    def finish(self) -> None:
        """Publish the results that wait for the end of all packages."""


@frozen
class CacheEntry:
    """An entry of a plugin in the user's cache; it can be recreated."""

    kind: str
    """A noun in the singular, such as 'source'."""
    name: str
    path: Path
    size: int
    used: float
    """The time of the last use."""


@frozen
class Digest:
    """The name of a blob: the SHA-256 of its bytes in lower-case hex, and its size in bytes."""

    hash: str
    size: int


@frozen
class OutputFile:
    path: str
    digest: Digest


@frozen
class ActionResult:
    """The result of a key: ActionResult of Bazel's remote execution API; larger data are blobs of `files`."""

    files: tuple[OutputFile, ...] = ()
    stdout: bytes = b""


class StoreError(Exception):
    """The operation of a store that failed, and the reason, for users; it never fails a build."""


class BlobError(StoreError):
    """One blob or result is corrupt or too large for the store; others are not affected."""


@frozen
class RemoteOptions:
    """The parameters of a remote store; a request may take `seconds`, and one more for each mebibyte."""

    seconds: float
    writable: bool
    variables: Mapping[str, str]
    warn: Callable[[str], object]


class RemoteStore(Protocol):
    """Stores results by key and blobs by digest on a server; keys are 64 lower-case hex digits.

    Several threads use it. The only StoreError that it raises is BlobError: after any other fault it warns
    once, and appears to be empty from then on.
    """

    name: str
    """The URL without passwords, for messages."""

    def result(self, key: str) -> ActionResult | None:
        """Return the result stored for a key, or None."""

    def fetch(self, digest: Digest, target: Path) -> bool:
        """Write a blob to the new file `target` and verify it; return False if the store does not have it."""

    def upload(self, key: str, result: ActionResult, blobs: Mapping[Digest, Path]) -> None:
        """Store a result after its blobs, perhaps in the background; do nothing if the store is read-only."""

    def finish(self) -> int:
        """Wait for the uploads; return how many results were not uploaded."""

    def close(self) -> None:
        """Abort unfinished requests and close all connections."""
