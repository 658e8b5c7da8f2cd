"""The remote store: open it by URL, and disable it after a failure."""

from __future__ import annotations

import contextlib
import threading
import time
from typing import TYPE_CHECKING, Final
from urllib.parse import urlsplit

from forge.base.errors import ForgeError, Problem
from forge.cache.deadline import MAX_SECONDS, RATE
from forge.cache.model import BlobError, StoreError, WritingRefused

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from forge.cache.model import ActionResult, Digest, Store

HTTP: Final = frozenset({"http", "https"})


def check_url(url: str) -> None:
    """Raise ForgeError for an invalid URL; messages do not quote it, since it may contain a password."""
    try:
        parts = urlsplit(url)
        _ = parts.port
    except ValueError:
        parts = urlsplit("")
    is_http = parts.scheme in HTTP
    message, hint = "", "for example: --remote-cache http://HOST:PORT/FOLDER"
    if not parts.scheme or (is_http and not parts.hostname):
        message = "the remote cache is not a valid URL"
    elif not (url.isascii() or not is_http) or any(sign <= (" " if is_http else "\x1f") for sign in url):
        message, hint = "the URL of the remote cache contains invalid characters", "escape them, such as %20"
    elif is_http and (parts.query or parts.fragment):
        message, hint = (
            "the URL of the remote cache has a query or fragment ('?' or '#')",
            "remove it",
        )
    if message:
        raise ForgeError(Problem(message, hint=hint))


_TOLERATED_SECONDS: Final = 1.0
"""Response time in seconds that does not count as slow."""


def open_remote(
    url: str, *, seconds: float, writable: bool, variables: Mapping[str, str], report: Callable[[str], object]
) -> Remote:
    """Return the store for a URL without connecting to it.

    Each request may take `seconds`, and one more for each mebibyte. The first fault of the store as a whole
    is reported once, and the store is not used again. Raises ForgeError for an invalid URL.
    """
    check_url(url)
    seconds = min(seconds, MAX_SECONDS)
    store: Store
    if urlsplit(url).scheme in HTTP:
        from forge.cache.http_store import HttpStore

        store = HttpStore(url, seconds, variables)
    else:
        from forge.cache.fsspec_store import FsspecStore

        store = FsspecStore(url, seconds)
    return Remote(store, seconds, report, writable=writable)


class Remote:
    """A store that is disabled after its first fault, so that no build waits for it twice.

    Reading never raises a fault of the store as a whole: a disabled store appears empty. Writing does, so
    that the caller knows what was not stored; on a read-only store it does nothing.
    """

    def __init__(
        self, store: Store, seconds: float, report: Callable[[str], object], *, writable: bool
    ) -> None:
        """Wrap a store, which is enabled until its first fault."""
        self.name, self.writable = store.name, writable
        self._store, self._seconds, self._report = store, seconds, report
        self._lock = threading.Lock()
        self._readable = self._accepting = True
        self._slow = 0.0

    def result(self, key: str) -> ActionResult | None:
        """Return the result stored for a key, or None."""
        with self._reading(0):
            if self._readable:
                return self._store.result(key)
        return None

    def fetch(self, digest: Digest, target: Path) -> bool:
        """Write a blob to the new file `target`; return False if the store does not have it."""
        with self._reading(digest.size):
            if self._readable:
                return self._store.fetch(digest, target)
        return False

    def put_result(self, key: str, result: ActionResult) -> None:
        """Store a result, whose blobs must be stored already."""
        if self._can_write():
            with self._writing():
                self._store.put_result(key, result)

    def put(self, digest: Digest, source: Path) -> None:
        """Store the bytes of a file."""
        if self._can_write():
            with self._writing():
                self._store.put(digest, source)

    def close(self) -> None:
        """Close all connections; pending requests are abandoned without reporting a fault."""
        with self._lock:
            self._readable = self._accepting = False
        self._store.close()

    @contextlib.contextmanager
    def _reading(self, size: int) -> Iterator[None]:
        """Disable the store if it fails, or if the total time of slow responses exceeds the limit."""
        started = time.monotonic()
        try:
            yield
        except BlobError:
            raise
        except StoreError as fault:
            self._give_up(fault)
        late = time.monotonic() - started - size / RATE - _TOLERATED_SECONDS
        if late > 0:
            with self._lock:
                self._slow += late
            if self._slow > self._seconds:
                self._give_up(
                    StoreError(f"{self.name}: too slow, this build has waited {self._slow:.1f} s for it")
                )

    def _can_write(self) -> bool:
        if self.writable and not (self._readable and self._accepting):
            raise StoreError(f"{self.name}: disabled for this build")
        return self.writable

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        """Disable the store if it fails; if it rejects writing, it may still be read."""
        try:
            yield
        except BlobError:
            raise
        except WritingRefused as fault:
            self._stop_writing(fault)
            raise
        except StoreError as fault:
            self._give_up(fault)
            raise

    def _give_up(self, fault: StoreError) -> None:
        """Disable the store, report the reason once, and abort pending requests."""
        with self._lock:
            first, self._readable = self._readable, False
        if first:
            self._store.close()
            self._report(f"{fault}; disabled for this build")

    def _stop_writing(self, fault: StoreError) -> None:
        with self._lock:
            first, self._accepting = self._accepting, False
        if first:
            self._report(f"{fault}; uploads are disabled for this build")
