"""The store of a team: which kind a URL means, and what happens when it fails."""

from __future__ import annotations

import contextlib
import threading
import time
from typing import TYPE_CHECKING, Final
from urllib.parse import urlsplit

from forge.caching.faults import BlobFault, WritingRefused
from forge.caching.model import StoreFault
from forge.caching.patience import LONGEST, RATE
from forge.caching.urls import HTTP, check

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from forge.caching.model import ActionResult, Digest, Store

_FORGIVEN: Final = 1.0
"""Seconds that an answer may take, before the waiting counts as a fault of the server."""


def open_remote(
    url: str, *, seconds: float, writable: bool, variables: Mapping[str, str], report: Callable[[str], None]
) -> Remote:
    """Return the store that a URL names; nobody is asked yet.

    Each request may take `seconds`, and one more for each mebibyte. The first fault of the store as a whole
    is reported, once, and nothing more is asked of it. A URL that cannot be one is a ForgeError.
    """
    check(url)
    seconds = min(seconds, LONGEST)
    store: Store
    if urlsplit(url).scheme in HTTP:
        from forge.caching.http_store import HttpStore  # noqa: PLC0415  (each kind needs a library)

        store = HttpStore(url, seconds, variables)
    else:
        from forge.caching.fsspec_store import FsspecStore  # noqa: PLC0415  (as above)

        store = FsspecStore(url, seconds)
    return Remote(store, seconds, report, writable=writable)


class Remote:
    """A store that is given up after its first fault, so that no build waits for it twice.

    Reading never raises a fault of the store as a whole: from then on it has nothing. Writing does, so that
    whoever writes knows what was not kept; without the right to write it does nothing.
    """

    def __init__(
        self, store: Store, seconds: float, report: Callable[[str], None], *, writable: bool
    ) -> None:
        """Trust a store for now."""
        self.name, self.writable = store.name, writable
        self._store, self._seconds, self._report = store, seconds, report
        self._lock = threading.Lock()
        self._readable = self._accepting = True
        self._slow = 0.0

    def result(self, key: str) -> ActionResult | None:
        """Return what a key leads to, or None."""
        with self._reading(0):
            if self._readable:
                return self._store.result(key)
        return None

    def fetch(self, digest: Digest, target: Path) -> bool:
        """Write a blob to `target`, a new file; tell if there is one."""
        with self._reading(digest.size):
            if self._readable:
                return self._store.fetch(digest, target)
        return False

    def put_result(self, key: str, result: ActionResult) -> None:
        """Let a key lead to a result, whose blobs are there already."""
        if self._may_write():
            with self._writing():
                self._store.put_result(key, result)

    def put(self, digest: Digest, source: Path) -> None:
        """Keep the bytes of a file."""
        if self._may_write():
            with self._writing():
                self._store.put(digest, source)

    def close(self) -> None:
        """Let go of connections; whoever still waits is left without an answer, and nobody is blamed."""
        with self._lock:
            self._readable = self._accepting = False
        self._store.close()

    @contextlib.contextmanager
    def _reading(self, size: int) -> Iterator[None]:
        """Give the store up when it fails, or when all its slow answers together took too long."""
        begun = time.monotonic()
        try:
            yield
        except BlobFault:
            raise
        except StoreFault as fault:
            self._give_up(fault)
        late = time.monotonic() - begun - size / RATE - _FORGIVEN
        if late > 0:
            with self._lock:
                self._slow += late
            if self._slow > self._seconds:
                self._give_up(
                    StoreFault(f"{self.name}: it is slow, this build has waited {self._slow:.1f} s for it")
                )

    def _may_write(self) -> bool:
        if self.writable and not (self._readable and self._accepting):
            raise StoreFault(f"{self.name}: it is not asked again")
        return self.writable

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        """Give the store up when it fails; one that refuses may still be read."""
        try:
            yield
        except BlobFault:
            raise
        except WritingRefused as fault:
            self._stop_writing(fault)
            raise
        except StoreFault as fault:
            self._give_up(fault)
            raise

    def _give_up(self, fault: StoreFault) -> None:
        """Ask nothing more, tell why, and let nobody wait who asked before."""
        with self._lock:
            first, self._readable = self._readable, False
        if first:
            self._store.close()
            self._report(f"{fault}; it is not asked again")

    def _stop_writing(self, fault: StoreFault) -> None:
        with self._lock:
            first, self._accepting = self._accepting, False
        if first:
            self._report(f"{fault}; nothing more is sent to it")
