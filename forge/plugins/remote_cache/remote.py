"""The remote store of a build: disabled after its first fault; results are uploaded in the background."""

from __future__ import annotations

import contextlib
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final, TypeVar

from forge.cache.model import ActionResult, BlobError, Digest, RemoteOptions, StoreError
from forge.plugins.remote_cache.deadline import RATE
from forge.plugins.remote_cache.store import Backend, Store, WritingRefused

_Answer = TypeVar("_Answer")

_TOLERATED_SECONDS: Final = 1.0
"""Response time in seconds that does not count as slow."""


class Remote:
    """A store that is disabled after its first fault, so that no build waits for it twice.

    Reading never raises a fault of the store as a whole: a disabled store appears empty. Threads of uploads
    end with forge at any point; even then, a store never has a result whose blobs are incomplete.
    """

    def __init__(self, backend: Backend, url: str, options: RemoteOptions, *, uploaders: int = 4) -> None:
        """Use the backend of a URL until its first fault; upload up to `uploaders` results at a time."""
        self._store = Store(backend, url, options.seconds)
        self.name = self._store.name
        self._options, self._limit = options, uploaders
        self._change = threading.Condition()
        self._readable, self._writable = True, options.writable
        self._slow = 0.0
        self._waiting: deque[tuple[str, ActionResult, Mapping[Digest, Path]]] = deque()
        self._threads = self._failed = 0
        self._uploaded: set[Digest] = set()
        self._error: Exception | None = None

    def result(self, key: str) -> ActionResult | None:
        """Return the result stored for a key, or None."""
        return self._read(lambda: self._store.result(key), 0)

    def fetch(self, digest: Digest, target: Path) -> bool:
        """Write a verified blob to the new file `target`; return False if the store does not have it."""
        return bool(self._read(lambda: self._store.fetch(digest, target), digest.size))

    def upload(self, key: str, result: ActionResult, blobs: Mapping[Digest, Path]) -> None:
        """Queue a result, whose files must not be moved until `finish` returns."""
        if not self._options.writable:
            return
        with self._change:
            self._waiting.append((key, result, blobs))
            if self._threads < self._limit:
                with contextlib.suppress(RuntimeError):  # no further thread can be started
                    threading.Thread(target=self._work, name="forge-uploads", daemon=True).start()
                    self._threads += 1

    def finish(self) -> int:
        """Wait for all uploads, which the deadline of each request limits; return how many failed."""
        with self._change:
            self._change.wait_for(lambda: not self._threads)
            if self._error is not None:
                raise self._error
            return self._failed + len(self._waiting)

    def close(self) -> None:
        """Close all connections; pending requests are abandoned without reporting a fault."""
        with self._change:
            self._readable = self._writable = False
        self._store.close()

    def _read(self, job: Callable[[], _Answer], size: int) -> _Answer | None:
        """Disable the store if it fails, or if the total time of slow responses exceeds the limit."""
        if not self._readable:
            return None
        started, answer = time.monotonic(), None
        try:
            answer = job()
        except BlobError:
            raise
        except StoreError as fault:
            self._give_up(fault)
        late = time.monotonic() - started - size / RATE - _TOLERATED_SECONDS
        if late > 0:
            with self._change:
                self._slow += late
            if self._slow > self._options.seconds:
                waited = f"this build has waited {self._slow:.1f} s for it"
                self._give_up(StoreError(f"{self.name}: too slow, {waited}"))
        return answer

    def _work(self) -> None:
        """Upload results until none is waiting."""
        while True:
            with self._change:
                if not self._waiting:
                    self._threads -= 1
                    self._change.notify_all()
                    return
                upload = self._waiting.popleft()
            is_uploaded = False
            try:
                is_uploaded = self._upload(*upload)
            except Exception as error:
                self._error = error
            with self._change:
                self._failed += not is_uploaded

    def _upload(self, key: str, result: ActionResult, blobs: Mapping[Digest, Path]) -> bool:
        """Upload the blobs of a result, then the result; return False if that failed."""
        try:
            for digest, path in blobs.items():
                if self._writable and digest not in self._uploaded:
                    self._store.put(digest, path)
                    self._uploaded.add(digest)
            if self._writable:
                self._store.put_result(key, result)
                return True
        except BlobError:
            pass
        except StoreError as fault:
            self._give_up(fault)
        return False

    def _give_up(self, fault: StoreError) -> None:
        """Stop using the store, or only writing to it; report the reason once, and abort pending requests."""
        if isinstance(fault, WritingRefused):
            with self._change:
                first, self._writable = self._writable, False
            if first:
                self._options.warn(f"{fault}; uploads are disabled for this build")
            return
        with self._change:
            first, self._readable, self._writable = self._readable, False, False
        if first:
            self._store.close()
            self._options.warn(f"{fault}; disabled for this build")
