"""How much memory a tree of processes holds, looked up in /proc again and again.

Counted is each process's proportional set: pages that several share are shared out among them, so that the
sum over a tree is what the tree takes. What lives shorter than the time between two looks is missed.
"""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

_SECONDS_BETWEEN = 0.02
_AT_FIRST = 0.001
_CLOSELY = 1.0
"""For so many seconds it is looked as often as above: short programs are looked at closely."""

_ENOUGH = 10
"""Looks that it takes to speak of a peak."""

_KILOBYTE = 1024
_PARENT = 1
_SET = "Pss:"


@dataclass(slots=True)
class Peak:
    """The most that a tree held in any look."""

    bytes: int = 0
    looks: int = 0
    _ended: threading.Event = field(default_factory=threading.Event)

    @property
    def megabytes(self) -> float | None:
        """Return the peak; None where the program was too short for it."""
        return self.bytes / 1e6 if self.looks >= _ENOUGH else None

    def watch(self, root: int) -> None:
        """Look until it is ended. Who belongs to the tree is asked less often: that takes longest."""
        start = asked = time.monotonic()
        tree = below(root)
        while not self._ended.wait(_AT_FIRST if time.monotonic() - start < _CLOSELY else _SECONDS_BETWEEN):
            if time.monotonic() - asked > _SECONDS_BETWEEN:
                tree, asked = below(root), time.monotonic()
            held = sum(map(_held, tree))
            self.looks += bool(held)
            self.bytes = max(self.bytes, held)

    def end(self) -> None:
        """Look no more."""
        self._ended.set()


@contextmanager
def watched(root: int) -> Iterator[Peak]:
    """Look at a process and what it starts, from a thread, until the block is left."""
    peak = Peak()
    thread = threading.Thread(target=peak.watch, args=(root,), daemon=True)
    thread.start()
    try:
        yield peak
    finally:
        peak.end()
        thread.join()


def below(root: int) -> set[int]:
    """Return a process and all that descend from it."""
    parents = dict(_parents())
    tree, more = {root}, True
    while more:
        found = {number for number, parent in parents.items() if parent in tree and number not in tree}
        tree |= found
        more = bool(found)
    return tree


def _parents() -> Iterator[tuple[int, int]]:
    for process in Path("/proc").iterdir():
        if process.name.isdigit():
            with suppress(OSError):
                words = (process / "stat").read_text(errors="replace").rpartition(")")[2].split()
                yield int(process.name), int(words[_PARENT])


def _held(process: int) -> int:
    """Return the bytes of a process's proportional set; 0 once it has gone."""
    with suppress(OSError):
        for line in Path(f"/proc/{process}/smaps_rollup").read_text().splitlines():
            if line.startswith(_SET):
                return int(line.split()[1]) * _KILOBYTE
    return 0
