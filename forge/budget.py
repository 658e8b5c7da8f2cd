"""How many jobs run at a time: a token for each, whether a package or a compiler of its has it.

A package takes a token before its first step, which stands for the one job that each of its programs may
run unasked, and gives it back after the last. All others lie in the pool, where ninja, make and
compilers find them. So jobs never outnumber tokens, and no token lies idle while there is work.
"""

from __future__ import annotations

import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

from forge.jobserver import MOST_JOBS, TOKEN
from forge.makeflags import MakeFlags

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from forge.jobserver import Pool
    from forge.model import Step

BUILD = "build"
"""The label of steps whose tool divides its work into jobs."""

_UNASKED = b""
"""The token that a make above us gave by starting us; it never was in the pool, nor goes there."""

_PERIOD_SECONDS = 0.25
"""How often memory and load are looked at."""
_PAUSE_SECONDS = 0.005
"""How long a token that came back waits for the next package before tools may have it."""


class Budget:
    """The tokens of one build. Close it when all packages have ended.

    `pool` is where tools get theirs, `fluent` the tools ('ninja', 'make') that do; the others get a fixed
    share. While `short` says that memory or load does not allow more, tokens are held back, but a package
    may always run when no other does.
    """

    def __init__(
        self,
        jobs: int,
        pool: Pool | None = None,
        fluent: frozenset[str] = frozenset(),
        flags: MakeFlags = MakeFlags(),  # noqa: B008  (frozen)
        short: Callable[[], bool] = lambda: False,
    ) -> None:
        """Begin with all tokens in hand, or with the one that a make above gave us."""
        # More tokens than the pipe holds would block who gives one back.
        jobs = min(jobs, pool.room if pool is not None and not pool.joined else MOST_JOBS)
        self.jobs = jobs
        self.local = jobs
        """How many of the jobs are for this machine: all, unless a farm takes some."""
        self._pool = pool
        self._fluent = fluent
        self._flags = flags
        self._is_short = short
        self._hand = [_UNASKED] if pool is not None and pool.joined else [TOKEN] * jobs
        self._waiting: list[object] = []
        self._running = 0
        self._short = False
        self._idle_looks = 0
        self._stopped = False
        self._closed = False
        self._changed = threading.Condition()
        self._stir = threading.Event()
        self._threads: list[threading.Thread] = []

    @contextmanager
    def package(self) -> Iterator[bool]:
        """Hold a token for a package; yields False when the build was stopped before there was one."""
        token = self._acquire()
        try:
            yield token is not None
        finally:
            if token is not None:
                self._release(token)

    @contextmanager
    def tools(
        self, step: Step, variables: Mapping[str, str]
    ) -> Iterator[tuple[dict[str, str], tuple[int, ...]]]:
        """Yield the environment of a step on top of `variables`, and the descriptors that it inherits."""
        found = without_jobs(variables)
        if step.label != BUILD:
            yield self._alone(found, 1), ()
        elif self._pool is not None and self._tool(step) in self._fluent:
            found["MAKEFLAGS"] = self._flags.line(self.jobs, self._pool.auth)
            yield found, self._pool.descriptors
        else:
            with self._share() as jobs:
                yield self._alone(found, jobs), ()

    def stop(self) -> None:
        """Let no further package begin."""
        with self._changed:
            self._stopped = True
            self._changed.notify_all()

    def close(self) -> None:
        """Give every token back that is not ours, and end."""
        self.stop()
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._stir.set()
        if self._pool is not None:
            self._pool.wake()
        for thread in self._threads:
            thread.join()
        if self._pool is not None:
            if self._pool.joined:
                self._give_away(len(self._hand))
            self._pool.close()

    def _alone(self, variables: dict[str, str], jobs: int) -> dict[str, str]:
        """Return the environment of a program that shares with nobody; `cmake --build` reads how much."""
        flags = self._flags.line()
        return {
            **variables,
            **({"MAKEFLAGS": flags} if flags else {}),
            "CMAKE_BUILD_PARALLEL_LEVEL": str(jobs),
        }

    def _tool(self, step: Step) -> str:
        return "ninja" if (step.cwd / "build.ninja").is_file() else "make"

    def _acquire(self) -> bytes | None:
        me = object()
        with self._changed:
            self._begin()
            self._waiting.append(me)
            self._changed.notify_all()
            while not self._stopped and not self._may_begin(me):
                self._changed.wait()
            self._waiting.remove(me)
            token = None if self._stopped else self._hand.pop()
            self._running += token is not None
            self._changed.notify_all()
        self._stir.set()
        return token

    def _begin(self) -> None:
        """Start our threads with the first package: a build with nothing to do has none."""
        if self._threads:
            return
        self._short = self._is_short()
        self._threads.append(threading.Thread(target=self._watch, daemon=True))
        if self._pool is not None:
            self._threads.append(threading.Thread(target=self._collect, args=(self._pool,), daemon=True))
        for thread in self._threads:
            thread.start()

    def _may_begin(self, me: object) -> bool:
        return bool(self._hand) and self._waiting[0] is me and not (self._short and self._running)

    def _release(self, token: bytes) -> None:
        with self._changed:
            self._hand.append(token)
            self._running -= 1
            self._changed.notify_all()
        self._stir.set()

    @contextmanager
    def _share(self) -> Iterator[int]:
        """Yield how many jobs a tool may run that does not speak with us: what is free, up to its share.

        To wait for more while holding one would be a deadlock when two packages do so.
        """
        taken: list[bytes] = []
        with self._changed:
            share = self.jobs // max(1, self._running + len(self._waiting))
            while len(taken) < share - 1 and not self._short:
                if self._hand:
                    taken.append(self._hand.pop())
                elif self._pool and (token := self._pool.take_now()):
                    taken.append(token)
                else:
                    break
        try:
            yield 1 + len(taken)
        finally:
            with self._changed:
                self._hand += taken
                self._changed.notify_all()
            self._stir.set()

    def _collect(self, pool: Pool) -> None:
        """Take tokens out of the pool while packages wait for one, or memory is short."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closed or self._wanting())
                if self._closed:
                    return
            token = pool.take()
            with self._changed:
                if self._closed and not pool.joined:
                    return
                if token:
                    self._hand.append(token)
                self._changed.notify_all()
            self._stir.set()

    def _wanting(self) -> bool:
        return self._short or len(self._waiting) > len(self._hand)

    def _watch(self) -> None:
        """Look at memory and load from time to time, and put tokens that no package wants into the pool."""
        short, looked = self._short, time.monotonic()
        while not self._closed:
            stirred = self._stir.wait(_PERIOD_SECONDS)
            if stirred and not self._closed:
                self._stir.clear()
                time.sleep(_PAUSE_SECONDS)
            # Not whenever a token moves: that is some twenty files to read.
            if time.monotonic() - looked >= _PERIOD_SECONDS:
                short, looked = self._is_short(), time.monotonic()
            with self._changed:
                self._short = short
                if not stirred:
                    self._replace_lost()
                if not short:
                    self._give_away(len(self._hand) - len(self._waiting))
                self._changed.notify_all()

    def _replace_lost(self) -> None:
        """Make new tokens when nothing runs and yet there are none: a tool was killed that had them."""
        lost = bool(self._waiting) and not self._running and not self._hand
        self._idle_looks = self._idle_looks + 1 if lost else 0
        if self._idle_looks > 1:
            self._hand += [TOKEN] * self.jobs

    def _give_away(self, count: int) -> None:
        if self._pool is not None and count > 0:
            tokens = [token for token in self._hand if token != _UNASKED]
            given = self._pool.give(b"".join(tokens[:count]))
            self._hand = [_UNASKED] * (len(self._hand) - len(tokens)) + tokens[given:]


def without_jobs(variables: Mapping[str, str]) -> dict[str, str]:
    """Return an environment without what a make above us, or the user, says of jobs."""
    return {name: value for name, value in variables.items() if name not in _SPOKEN}


_SPOKEN = frozenset({"MAKEFLAGS", "MFLAGS", "CMAKE_BUILD_PARALLEL_LEVEL"})
"""Variables that say something of jobs, which is ours to say."""
