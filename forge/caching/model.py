"""Nouns of the package cache: what a store keeps, and what a store is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from forge.frozen import frozen

if TYPE_CHECKING:
    from pathlib import Path


RESTORED = "from the cache"
"""What is said of a package that was not built here."""


@frozen
class Digest:
    """A blob's name: the SHA-256 of its bytes in lower-case hex, and how many bytes they are."""

    hash: str
    size: int


@frozen
class OutputFile:
    """A blob that belongs to a result, under a name of the result's own."""

    path: str
    digest: Digest
    executable: bool = False


@frozen
class ActionResult:
    """What a key leads to, as far as forge uses the message of that name of Bazel's remote execution API.

    `stdout` are a few bytes kept in the message itself; large things are blobs of `files`.
    """

    files: tuple[OutputFile, ...] = ()
    stdout: bytes = b""


class StoreFault(Exception):  # noqa: N818  (it is told, and ends nothing)
    """A store cannot be reached, refuses, answers too late, or holds what it should not.

    The message is one for users: what was tried, and why it failed. No build fails over it.
    """


class Store(Protocol):
    """Keeps results by key and blobs by digest. Every method may raise StoreFault; threads may share a store.

    Keys are 64 lower-case hex digits.
    """

    name: str
    """What messages call it: the folder, or the URL without passwords."""

    def result(self, key: str) -> ActionResult | None:
        """Return what a key leads to, or None."""

    def put_result(self, key: str, result: ActionResult) -> None:
        """Let a key lead to a result, whose blobs are there already."""

    def fetch(self, digest: Digest, target: Path) -> bool:
        """Write a blob to `target`, a new file; tell if there is one.

        Size and SHA-256 were verified when this returns True; else there is no file at `target`.
        """

    def put(self, digest: Digest, source: Path) -> None:
        """Keep the bytes of the file `source`, of which `digest` is known to be true."""

    def close(self) -> None:
        """Let go of connections."""
