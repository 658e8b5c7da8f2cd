"""Letters from workers to the threads that wait for them."""

from __future__ import annotations

import pickle
import queue
import threading
from typing import TYPE_CHECKING, Any

from forge.errors import EnvironmentFault, Problem

if TYPE_CHECKING:
    from collections.abc import Callable

    from forge.cluster.model import Knock, Lacks
    from forge.model import Event


class Box:
    """The letters to one task, whichever worker has it; `visit` is the attempt that counts."""

    def __init__(self) -> None:
        """Begin empty."""
        self.visit = ""
        self._expected = 0
        self._letters: queue.SimpleQueue[tuple[str, int, Any]] = queue.SimpleQueue()

    def put(self, visit: str, number: int, letter: object) -> None:
        """Add a letter: from a worker, or with no visit from ourselves."""
        self._letters.put((visit, number, letter))

    def note(self, word: str) -> None:
        """Add a word of our own."""
        self.put("", 0, word)

    def get(self) -> Event | Knock | Lacks | str:
        """Wait for the next letter that still matters: a knock, an event of the visit that counts, or ours.

        Raises EnvironmentFault when one was lost on the way.
        """
        while True:
            visit, number, letter = self._letters.get()
            if not visit or number == 0:
                return letter  # type: ignore[no-any-return]
            if visit != self.visit:
                continue
            self._expected += 1
            if number != self._expected:
                raise EnvironmentFault(Problem("what a worker said was lost on the way here"))
            return pickle.loads(letter)  # type: ignore[no-any-return]  # noqa: S301  (a worker of ours)

    def follow(self, visit: str) -> None:
        """From now on only this attempt counts."""
        self.visit = visit
        self._expected = 0


class Post:
    """Sorts what workers send; `deliver` is called in the event loop of the client."""

    def __init__(self) -> None:
        """Begin with nobody to write to."""
        self._boxes: dict[str, Box] = {}
        self._visits: dict[str, Box] = {}
        self._lock = threading.Lock()

    def open(self, key: str) -> Box:
        """Return the box of a task."""
        with self._lock:
            box = self._boxes[key] = Box()
            return box

    def close(self, key: str) -> None:
        """Let nothing more arrive for a task."""
        with self._lock:
            gone = self._boxes.pop(key, None)
            self._visits = {visit: box for visit, box in self._visits.items() if box is not gone}

    def deliver(self, event: tuple[float, dict[str, Any]]) -> None:
        """Take one letter as Dask brings it, with its time."""
        said = event[1]
        visit, number, letter = said["visit"], said["number"], said["letter"]
        with self._lock:
            if number == 0:
                key, letter = pickle.loads(letter)  # noqa: S301  (a worker of ours)
                if key in self._boxes:
                    self._visits[visit] = self._boxes[key]
            if visit in self._visits:
                self._visits[visit].put(visit, number, letter)

    def each(self, do: Callable[[Box], object]) -> None:
        """Do something with every box."""
        with self._lock:
            for box in self._boxes.values():
                do(box)
