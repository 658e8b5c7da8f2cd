"""Upload results to the remote store in the background of a build."""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.cache.deadline import MAX_SECONDS, RATE
from forge.cache.model import StoreError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from forge.cache.model import ActionResult, Digest, Store


@frozen
class _Upload:
    key: str
    result: ActionResult
    blobs: Mapping[Digest, Path]


class Uploads:
    """Sends results to a store, a few at a time: first the blobs of each, then the result.

    Its threads end with forge at any point: a store never has a result whose blobs are incomplete.
    """

    def __init__(self, store: Store, *, limit: int = 4) -> None:
        """Send at most `limit` results at a time; threads are started on demand."""
        self._store, self._limit = store, limit
        self._change = threading.Condition()
        self._waiting: deque[_Upload] = deque()
        self._deadlines: dict[str, float] = {}
        self._error: BaseException | None = None
        self._threads = self._failed = 0
        self._last_progress = time.monotonic()
        self._kept: set[Digest] = set()

    def add(self, key: str, result: ActionResult, blobs: Mapping[Digest, Path]) -> None:
        """Queue a result; its files must not be moved until `finish` returns."""
        with self._change:
            self._waiting.append(_Upload(key, result, blobs))
            self._last_progress = time.monotonic()
            if self._threads == self._limit:
                return
            self._threads += 1
        threading.Thread(target=self._work, name="forge-uploads", daemon=True).start()

    def finish(self, seconds: float) -> int:
        """Wait for all uploads, but at most `seconds` without progress.

        Returns the number of results that were not uploaded.
        """
        with self._change:
            self._last_progress = time.monotonic()
            while self._threads and (left := self._remaining(seconds)) > 0:
                self._change.wait(left)
            unsent = self._threads + len(self._waiting) + self._failed
            self._waiting.clear()
            if self._error is not None:
                raise self._error
            return unsent

    def _remaining(self, seconds: float) -> float:
        """Return the remaining seconds until progress is overdue; large blobs have more time."""
        return min(
            MAX_SECONDS, max((self._last_progress, *self._deadlines.values())) + seconds - time.monotonic()
        )

    def _work(self) -> None:
        """Send results until the queue is empty."""
        while (upload := self._next()) is not None:
            error: BaseException | None = None
            try:
                self._send(upload)
            except BaseException as raised:
                error = raised
            with self._change:
                self._deadlines.pop(upload.key, None)
                self._last_progress = time.monotonic()
                self._failed += error is not None
                if not isinstance(error, StoreError | None):
                    self._error = error
                self._change.notify_all()

    def _next(self) -> _Upload | None:
        with self._change:
            if self._waiting:
                return self._waiting.popleft()
            self._threads -= 1
            self._change.notify_all()
            return None

    def _send(self, upload: _Upload) -> None:
        for digest, path in upload.blobs.items():
            if digest not in self._kept:
                self._expect(upload, digest.size)
                self._store.put(digest, path)
                self._kept.add(digest)
        self._expect(upload, 0)
        self._store.put_result(upload.key, upload.result)

    def _expect(self, upload: _Upload, size: int) -> None:
        """Record progress, and the deadline for the next."""
        with self._change:
            self._last_progress = time.monotonic()
            self._deadlines[upload.key] = self._last_progress + size / RATE
            self._change.notify_all()
