"""The memory that packages need: measured while their steps run, and checked before the next package starts.

The peaks are in a separate file below the build folder: they decide when a package is built, not how.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import threading
import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from forge.base.files import write_if_changed
from forge.build.events import Aborted, Event, Finished
from forge.toolchain.resources import ROOT, Memory, MemoryLimit, default_memory_limit, memory

_PERIOD_SECONDS = 0.5
_PAGE = resource.getpagesize()
_KIB = 1024


class MeasuredMemory:
    """The current and peak memory use of packages, in bytes; owned by the build loop.

    A separate thread adds up the memory of the processes of each step.
    """

    def __init__(self, file: Path, limit: MemoryLimit | None = None) -> None:
        """Read the peaks of earlier builds; `limit` is the user's memory limit."""
        self._file = file
        self._limit = limit
        self.peaks: dict[str, int] = {}
        with contextlib.suppress(OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
            stored = json.loads(file.read_bytes())["peaks"]
            self.peaks = {name: peak for name, peak in stored.items() if isinstance(peak, int)}
        self._watched: dict[int, str] = {}
        self._now: dict[str, int] = {}
        self._highest: dict[str, int] = {}
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._closed = threading.Event()
        self._machine: tuple[float, Memory | None] = (0.0, None)

    def now(self, name: str) -> int:
        """Return the bytes that a running package uses."""
        return self._now.get(name, 0)

    def peak(self, name: str) -> int:
        """Return the peak of a package in this build and earlier ones, 0 if it is unknown."""
        return max(self.peaks.get(name, 0), self._highest.get(name, 0))

    def fits(self, name: str, running: Collection[str]) -> bool:
        """Return whether enough memory is left for one more package: the running ones may still grow.

        A package without a known peak fits.
        """
        peak = self.peaks.get(name, 0)
        asked, machine = self._machine
        if peak and time.monotonic() - asked > _PERIOD_SECONDS:
            self._machine = time.monotonic(), (machine := memory())
        if not peak or machine is None:
            return True
        growth = sum(max(0, self.peak(other) - self.now(other)) for other in running)
        return peak + growth <= (self._limit or default_memory_limit(machine)).left(machine)

    @contextmanager
    def watching(self, name: str, process: int) -> Iterator[None]:
        """Add up the memory of a process and its descendants while they run."""
        with self._lock:
            self._watched[process] = name
            if self._thread is None:
                self._thread = threading.Thread(target=self._watch, name="memory", daemon=True)
                self._thread.start()
        try:
            yield
        finally:
            with self._lock:
                del self._watched[process]

    def note_usage(self, name: str, usage: resource.struct_rusage) -> None:
        """Record the largest process of a step, which may have ended before the thread saw it.

        A child begins as a copy of this process, so the kernel never reports less than the size of this
        process.
        """
        if usage.ru_maxrss > resource.getrusage(resource.RUSAGE_SELF).ru_maxrss:
            self._raise(name, usage.ru_maxrss * _KIB)

    def note(self, event: Event) -> None:
        """Record the peak of a package that has ended.

        A build from an empty folder replaces it, others can only raise it.
        """
        if isinstance(event, Finished | Aborted):
            self._now.pop(event.task, None)
            seen = self._highest.pop(event.task, 0)
            record = event.record if isinstance(event, Finished) else None
            is_whole = record is not None and record.from_empty
            if seen:
                self.peaks[event.task] = seen if is_whole else max(seen, self.peaks.get(event.task, 0))

    def close(self) -> None:
        """Stop watching, and write the peaks; does nothing if the folder is not writable."""
        self._closed.set()
        if self._thread is not None:
            with contextlib.suppress(OSError):
                write_if_changed(self._file, json.dumps({"peaks": dict(sorted(self.peaks.items()))}) + "\n")

    def _watch(self) -> None:
        while not self._closed.wait(_PERIOD_SECONDS):
            with self._lock:
                watched = dict(self._watched)
            sums: dict[str, int] = {}
            for process, name in watched.items():
                sums[name] = sums.get(name, 0) + tree_memory(process)
            self._now = sums
            for name, size in sums.items():
                self._raise(name, size)

    def _raise(self, name: str, size: int) -> None:
        self._highest[name] = max(size, self._highest.get(name, 0))


def tree_memory(process: int, root: Path = ROOT) -> int:
    """Return the private bytes of a process and its descendants, without files and shared memory."""
    total, waiting = 0, [process]
    while waiting:
        folder = root / "proc" / str(waiting.pop())
        with contextlib.suppress(OSError, ValueError, IndexError):
            words = (folder / "statm").read_bytes().split()
            total += (int(words[1]) - int(words[2])) * _PAGE
            for thread in os.listdir(folder / "task"):  # noqa: PTH208  (names alone)
                children = (folder / "task" / thread / "children").read_bytes()
                waiting += map(int, children.split())
    return total
