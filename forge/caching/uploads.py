"""What was built goes to the store of a team while the build goes on."""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import TYPE_CHECKING

from forge.caching.model import StoreFault
from forge.caching.patience import LONGEST, RATE
from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from forge.caching.model import ActionResult, Digest, Store


@frozen
class _Upload:
    key: str
    result: ActionResult
    blobs: Mapping[Digest, Path]


class Uploads:
    """Sends results to a store, a few at a time: first the blobs of each, then what leads to them.

    Its threads end with forge, wherever they are: a store that has a part of a result's blobs has nothing
    that leads to them.
    """

    def __init__(self, store: Store, *, most: int = 4) -> None:
        """Send at most so many results at a time; no thread is started yet."""
        self._store, self._most = store, most
        self._change = threading.Condition()
        self._waiting: deque[_Upload] = deque()
        self._ends: dict[str, float] = {}
        self._error: BaseException | None = None
        self._threads = self._failed = 0
        self._moved = time.monotonic()
        self._kept: set[Digest] = set()

    def add(self, key: str, result: ActionResult, blobs: Mapping[Digest, Path]) -> None:
        """Send this when there is time; the files must stay where they are until `finish` returns."""
        with self._change:
            self._waiting.append(_Upload(key, result, blobs))
            self._moved = time.monotonic()
            if self._threads == self._most:
                return
            self._threads += 1
        threading.Thread(target=self._work, name="forge-uploads", daemon=True).start()

    def finish(self, seconds: float) -> int:
        """Wait for all to be sent, no longer than so many seconds without progress.

        Returns how many results the store has not got.
        """
        with self._change:
            self._moved = time.monotonic()
            while self._threads and (left := self._patience(seconds)) > 0:
                self._change.wait(left)
            unsent = self._threads + len(self._waiting) + self._failed
            self._waiting.clear()
            if self._error is not None:
                raise self._error
            return unsent

    def _patience(self, seconds: float) -> float:
        """Return for how long to wait for the next sign of life; large blobs have more time."""
        return min(LONGEST, max((self._moved, *self._ends.values())) + seconds - time.monotonic())

    def _work(self) -> None:
        """Send one result after the other until there is none."""
        while (upload := self._next()) is not None:
            error: BaseException | None = None
            try:
                self._send(upload)
            except BaseException as raised:  # noqa: BLE001  (raised again where all is awaited)
                error = raised
            with self._change:
                self._ends.pop(upload.key, None)
                self._moved = time.monotonic()
                self._failed += error is not None
                if not isinstance(error, StoreFault | None):
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
        """Note a sign of life, and until when the next one is not late."""
        with self._change:
            self._moved = time.monotonic()
            self._ends[upload.key] = self._moved + size / RATE
            self._change.notify_all()
