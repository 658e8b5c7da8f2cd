"""The line to the workers of one build: submits tasks to Dask, hands over errands, tells, listens."""

from __future__ import annotations

import contextlib
import pickle
import threading
import uuid
from typing import TYPE_CHECKING, Any

from forge.cluster.model import FINISH, INTERRUPT, KILL, LETTERS, Knock, Lacks
from forge.cluster.post import Post
from forge.cluster.remote_task import attend, forget, hand_over, more, supply, tell
from forge.errors import EnvironmentFault, Problem
from forge.model import Aborted, Finished, Output
from forge.runner import GRACE_SECONDS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from distributed import Future

    from forge.cluster.connection import Cluster
    from forge.cluster.model import Errand, Terms
    from forge.cluster.post import Box
    from forge.cluster.sources import Stock
    from forge.model import Event

_GIVE_UP, _ENDED, _LOST = "give up", "ended", "lost"
"""Our own words: who was told to end does not answer; Dask says the task ended; its last letter is lost."""

_FURTHER_TRIES = 1
"""How often Dask tries again what ended by a fault of its own; after the death of a worker it does anyway."""
_LETTER_SECONDS = 10.0


class Line:
    """What the runners of a cluster speak through; threads share it. Close it when all tasks have ended."""

    def __init__(self, cluster: Cluster, terms: Terms) -> None:
        """Subscribe to what workers will say; nothing is submitted yet."""
        self.cluster = cluster
        self.terms = terms
        self.topic = f"forge-{uuid.uuid4().hex}"
        self.stock: Stock | None = None
        """The archives of sources, where workers do not see our folders."""
        self.word = ""
        """What all were told last; empty while the build goes on."""
        self._client = cluster.client
        self._post = Post()
        self._client.subscribe_topic(self.topic, self._post.deliver)

    def events(self, name: str, errand: Callable[[int, Knock], Errand]) -> Iterator[Event]:
        """Have a task carried out by some worker and yield what happens, the last a Finished or an Aborted.

        `errand` is asked when a worker knocks for the task, with the number of attempts before: there is a
        further one when a worker died.
        """
        key = f"{self.topic}-{name}"
        box = self._post.open(key)
        call = Call(self, name, errand, box, self._submit(key, box))
        if self.word:
            box.note(self.word)
        try:
            yield from call.events()
        finally:
            self._post.close(key)
            call.close()

    def hand_over(self, knock: Knock, errand: Errand) -> None:
        """Give a worker the errand that it asked for."""
        packed = pickle.dumps(errand)
        # One that has died meanwhile needs nothing: another will knock.
        with contextlib.suppress(OSError, TimeoutError):
            self._client.run(hand_over, knock.visit, packed, workers=[knock.address])

    def digest(self, source: Path) -> str:
        """Return the digest of the archive of a package's folder; raises Unshippable."""
        assert self.stock is not None  # noqa: S101  (else nobody asks)
        return self.stock.digest(source)

    def supply(self, lacks: Lacks) -> None:
        """Give a worker the archives that it lacks, piece by piece."""
        assert self.stock is not None  # noqa: S101  (else nobody speaks of archives)
        with contextlib.suppress(OSError, TimeoutError):
            for digest in lacks.digests:
                for piece, last in self.stock.pieces(digest):
                    self._client.run(supply, lacks.visit, digest, piece, last=last, workers=[lacks.address])

    def make_room(self, knock: Knock) -> None:
        """Tell a worker that the next letters were read."""
        with contextlib.suppress(OSError, TimeoutError):
            self._client.run(more, knock.visit, workers=[knock.address])

    def finish_steps(self) -> None:
        """Let running steps end, and nothing begin."""
        if not self.word:
            self._tell(FINISH)

    def interrupt(self, *, kill: bool) -> None:
        """End everything on all workers now; who does not answer is left alone after a while."""
        self._tell(KILL if kill else INTERRUPT)
        # A gentle word is repeated twice, and harder each time.
        patience = GRACE_SECONDS if kill else 4 * GRACE_SECONDS
        _later(patience, lambda: self._post.each(lambda box: box.note(_GIVE_UP)))

    def close(self) -> None:
        """Let the scheduler forget what was said."""
        if self.stock:
            self.stock.close()
        with contextlib.suppress(Exception):  # whatever it is, the build has ended
            self._client.unsubscribe_topic(self.topic)
            self._client.run_on_scheduler(forget, self.topic)

    def _submit(self, key: str, box: Box) -> Future[Any]:
        future = self._client.submit(
            attend,
            self.topic,
            key,
            key=key,
            pure=False,
            retries=_FURTHER_TRIES,
            resources=dict(self.terms.resources) or None,
            workers=list(self.cluster.fit) or None,
        )
        future.add_done_callback(lambda _: box.note(_ENDED))
        return future

    def _tell(self, word: str) -> None:
        self.word = word
        self._post.each(lambda box: box.note(word))
        # Not in the loop's own thread: a scheduler may take its time.
        threading.Thread(target=self._pass_on, args=(word,), daemon=True).start()

    def _pass_on(self, word: str) -> None:
        with contextlib.suppress(Exception):  # who cannot be told is given up in time
            self._client.run(tell, self.topic, word)


class Call:
    """One task on its way through the cluster."""

    def __init__(
        self, line: Line, name: str, errand: Callable[[int, Knock], Errand], box: Box, future: Future[Any]
    ) -> None:
        """Begin before any worker has the task."""
        self._line = line
        self._name = name
        self._errand = errand
        self._box = box
        self._future = future
        self._attempts = 0
        self._knock: Knock | None = None
        self._unread = LETTERS

    def events(self) -> Iterator[Event]:
        """Yield what happens until the task has ended."""
        while True:
            letter = self._box.get()
            if isinstance(letter, Knock):
                said = self._receive(letter)
            elif isinstance(letter, Lacks):
                self._line.supply(letter)
                said = ()
            elif isinstance(letter, str):
                said = self._heed(letter)
            else:
                said = (letter,)
                self._count()
            yield from said
            if said and isinstance(said[-1], Finished | Aborted):
                return

    def close(self) -> None:
        """Let Dask forget the task; a worker that still has it ends it."""
        if not self._future.done():
            with contextlib.suppress(OSError, TimeoutError):
                self._future.cancel()

    def _count(self) -> None:
        """Take note that a letter was read."""
        self._unread -= 1
        if not self._unread and self._knock:
            self._unread = LETTERS
            self._line.make_room(self._knock)

    def _receive(self, knock: Knock) -> tuple[Event, ...]:
        """Hand the errand over, unless nothing is to begin any more."""
        if self._line.word:
            return (Aborted(self._name, 0.0),)
        before, self._knock, self._unread = self._knock, knock, LETTERS
        self._box.follow(knock.visit)
        errand = self._errand(self._attempts, knock)
        self._attempts += 1
        self._line.hand_over(knock, errand)
        if before is None:
            return ()
        said = f"the worker on {before.host} was lost; '{self._name}' begins again on {knock.host}"
        return (self._told(said),)

    def _heed(self, word: str) -> tuple[Event, ...]:
        """Do as our own words say."""
        aborted = Aborted(self._name, 0.0)
        if word == _ENDED:
            return self._ended()
        if word == _LOST:
            raise EnvironmentFault(Problem(f"the last word on '{self._name}' was lost on its way here"))
        if word == _GIVE_UP:
            where = f"the worker on {self._knock.host}" if self._knock else "the scheduler"
            return (self._told(f"{where} does not answer, and is left alone"), aborted)
        return () if self._box.visit else (aborted,)

    def _ended(self) -> tuple[Event, ...]:
        """Return what follows when Dask says the task ended: nothing while its last letter is under way."""
        status = self._future.status
        if status == "finished":
            _later(_LETTER_SECONDS, lambda: self._box.note(_LOST))
            return ()
        if status != "error":
            hint = "is it still running, and did nobody cancel the task there?"
            where = self._line.cluster.address
            raise EnvironmentFault(Problem(f"the scheduler at '{where}' gave '{self._name}' up", hint=hint))
        error = self._future.exception()
        if type(error).__name__ == "KilledWorker":
            cause = "every worker that took it up died; their own logs may say why"
        else:
            cause = str(error) or type(error).__name__
        return (self._told(f"'{self._name}' is given up: {cause}"), Finished(self._name, 1, 0.0))

    def _told(self, text: str) -> Output:
        return Output(self._name, f"forge: {text}\n".encode(errors="replace"), stderr=True)


def _later(seconds: float, do: Callable[[], object]) -> None:
    timer = threading.Timer(seconds, do)
    timer.daemon = True
    timer.start()
