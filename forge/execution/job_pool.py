"""The job pool limits the number of concurrent jobs: each running job holds a token.

A package acquires a token before its first step and releases it after its last. It represents the one job
that the jobserver protocol grants each program implicitly. All other tokens are in the jobserver pool, where
ninja, make and compilers take them. So there are never more jobs than tokens, and no token is idle while
there is work.
"""

from __future__ import annotations

import contextlib
import json
import threading
import time
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.env_vars import own_cache
from forge.base.errors import Problem
from forge.base.files import write_if_changed
from forge.base.layout import STYLES_FILE
from forge.build.tasks import StepKind
from forge.execution.jobserver import MAX_JOBS, TOKEN, common_style, create_pool, join_pool, supported_styles
from forge.execution.makeflags import MakeFlags, read_make_flags
from forge.toolchain.resources import is_overloaded, processors

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from forge.build.recipes.context import BuildContext
    from forge.build.tasks import Step
    from forge.execution.jobserver import TokenPool
    from forge.execution.options import JobOptions

_IMPLICIT_TOKEN = b""
"""The implicit token of a parent make for this process; it is never in the pool."""

_PERIOD_SECONDS = 0.25
"""The interval of memory and load checks."""
_PAUSE_SECONDS = 0.005
"""The time that a released token waits for the next package before tools may take it."""

_MAX_STORED_STYLES = 8
"""Workspaces and virtual environments have different tools, and share the file."""
PARALLEL_TESTS = "CTEST_PARALLEL_LEVEL"
_JOB_VARIABLES = frozenset({"MAKEFLAGS", "MFLAGS", "CMAKE_BUILD_PARALLEL_LEVEL"})
"""Variables that set the number of jobs, which forge replaces."""


class JobPool:
    """The tokens of one build. Close it when all packages have ended.

    `jobserver_tools` are the tools ('ninja', 'make') that take tokens from `pool`; others get a fixed share.
    While `is_overloaded` reports that memory or load do not permit more jobs, tokens are held back, except
    that one package may always run.
    """

    def __init__(
        self,
        jobs: int,
        pool: TokenPool | None = None,
        jobserver_tools: frozenset[str] = frozenset(),
        flags: MakeFlags = MakeFlags(),  # noqa: B008  (frozen)
        is_overloaded: Callable[[], bool] = lambda: False,
    ) -> None:
        """Start with all tokens free, or with the implicit token of a parent make."""
        # Tools would block when returning more tokens than the pipe can hold.
        jobs = min(jobs, pool.room if pool is not None and not pool.joined else MAX_JOBS)
        self.jobs = jobs
        self.local = jobs
        """The number of jobs for this machine: all, unless a distributed compiler takes some."""
        self._pool = pool
        self._jobserver_tools = jobserver_tools
        self._flags = flags
        self._is_overloaded = is_overloaded
        self._free_tokens = [_IMPLICIT_TOKEN] if pool is not None and pool.joined else [TOKEN] * jobs
        self._waiting: list[object] = []
        self._alone: list[object] = []
        """Packages that run alone, or wait until they can."""
        self._running = 0
        self._overloaded = False
        self._idle_checks = 0
        self._stopped = False
        self._closed = False
        self._changed = threading.Condition()
        self._wake = threading.Event()
        self._threads: list[threading.Thread] = []

    @contextmanager
    def package(self) -> Iterator[bool]:
        """Hold a token for a package; yield False if the build was stopped before one was free."""
        ticket = object()
        with self._changed:
            self._begin()
            self._waiting.append(ticket)
            self._changed.notify_all()
            while not self._stopped and (
                not self._free_tokens
                or self._waiting[0] is not ticket
                or self._alone
                or (self._overloaded and self._running)
            ):
                self._changed.wait()
            self._waiting.remove(ticket)
            token = None if self._stopped else self._free_tokens.pop()
            self._running += token is not None
            self._changed.notify_all()
        self._wake.set()
        try:
            yield token is not None
        finally:
            if token is not None:
                with self._changed:
                    self._free_tokens.append(token)
                    self._running -= 1
                    self._changed.notify_all()
                self._wake.set()

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Wait until no other package runs, and let none start. The package must hold a token.

        Packages that wait to be alone run nothing, so they do not wait for each other to end.
        """
        ticket = object()
        with self._changed:
            self._alone.append(ticket)
            self._changed.wait_for(
                lambda: self._stopped or (self._alone[0] is ticket and self._running <= len(self._alone))
            )
        try:
            yield
        finally:
            with self._changed:
                self._alone.remove(ticket)
                self._changed.notify_all()

    @contextmanager
    def tools(
        self, step: Step, variables: Mapping[str, str], *, alone: bool = False
    ) -> Iterator[tuple[dict[str, str], tuple[int, ...]]]:
        """Yield the environment of a step, based on `variables`, and the descriptors that it inherits.

        A step that is `alone` runs one job.
        """
        environment = without_job_variables(variables)
        tool = "ninja" if (step.cwd / "build.ninja").is_file() else "make"
        if step.tests_at_once and PARALLEL_TESTS not in environment and not alone:
            with self._share(step.tests_at_once) as jobs:
                yield {**self._without_jobserver(environment, 1), PARALLEL_TESTS: str(jobs)}, ()
        elif alone or step.kind is not StepKind.BUILD:
            yield self._without_jobserver(environment, 1), ()
        elif self._pool is not None and tool in self._jobserver_tools:
            environment["MAKEFLAGS"] = self._flags.line(self.jobs, self._pool.auth)
            yield environment, self._pool.descriptors
        else:
            with self._share() as jobs:
                environment = self._without_jobserver(environment, jobs)
                if Path(step.argv[0]).name == "make":
                    environment["MAKEFLAGS"] = self._flags.line(jobs)
                yield environment, ()

    def stop(self) -> None:
        with self._changed:
            self._stopped = True
            self._changed.notify_all()

    def close(self) -> None:
        """Return the tokens of a parent make and stop."""
        self.stop()
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._wake.set()
        if self._pool is not None:
            self._pool.wake()
        for thread in self._threads:
            thread.join()
        if self._pool is not None:
            if self._pool.joined:
                self._return_to_pool(len(self._free_tokens))
            self._pool.close()

    def _without_jobserver(self, variables: dict[str, str], jobs: int) -> dict[str, str]:
        """Return the environment of a program without jobserver; `cmake --build` reads its number of jobs."""
        flags = self._flags.line()
        return {
            **variables,
            **({"MAKEFLAGS": flags} if flags else {}),
            "CMAKE_BUILD_PARALLEL_LEVEL": str(jobs),
            "CARGO_BUILD_JOBS": str(jobs),
        }

    def _begin(self) -> None:
        """Start the threads with the first package; a build with nothing to do needs none."""
        if self._threads:
            return
        self._overloaded = self._is_overloaded()
        self._threads.append(threading.Thread(target=self._watch, daemon=True))
        if self._pool is not None:
            self._threads.append(threading.Thread(target=self._collect, args=(self._pool,), daemon=True))
        for thread in self._threads:
            thread.start()

    @contextmanager
    def _share(self, most: int = MAX_JOBS) -> Iterator[int]:
        """Yield the number of jobs for a tool without jobserver support: the free tokens, up to its share.

        It does not wait for more: two packages that hold tokens and wait for each other would deadlock.
        """
        taken: list[bytes] = []
        with self._changed:
            share = min(most, self.jobs // max(1, self._running + len(self._waiting)))
            while len(taken) < share - 1 and not self._overloaded:
                if self._free_tokens:
                    taken.append(self._free_tokens.pop())
                elif self._pool and (token := self._pool.take_now()):
                    taken.append(token)
                else:
                    break
        try:
            yield 1 + len(taken)
        finally:
            with self._changed:
                self._free_tokens += taken
                self._changed.notify_all()
            self._wake.set()

    def _collect(self, pool: TokenPool) -> None:
        """Take tokens out of the pool while packages wait for one or memory is short."""
        while True:
            with self._changed:
                self._changed.wait_for(
                    lambda: self._closed or self._overloaded or len(self._waiting) > len(self._free_tokens)
                )
                if self._closed:
                    return
            token = pool.take()
            with self._changed:
                if self._closed and not pool.joined:
                    return
                if token:
                    self._free_tokens.append(token)
                self._changed.notify_all()
            self._wake.set()

    def _watch(self) -> None:
        """Check memory and load periodically, and put tokens that no package waits for into the pool."""
        overloaded, checked = self._overloaded, time.monotonic()
        while not self._closed:
            woken = self._wake.wait(_PERIOD_SECONDS)
            if woken and not self._closed:
                self._wake.clear()
                time.sleep(_PAUSE_SECONDS)
            # Do not check at each wake-up, since a check reads about twenty files.
            if time.monotonic() - checked >= _PERIOD_SECONDS:
                overloaded, checked = self._is_overloaded(), time.monotonic()
            with self._changed:
                self._overloaded = overloaded
                if not woken:
                    # If no token is left although nothing runs, a tool was killed while holding them.
                    lost = bool(self._waiting) and not self._running and not self._free_tokens
                    self._idle_checks = self._idle_checks + 1 if lost else 0
                    self._free_tokens += [TOKEN] * self.jobs if self._idle_checks > 1 else []
                if not overloaded:
                    self._return_to_pool(len(self._free_tokens) - len(self._waiting))
                self._changed.notify_all()

    def _return_to_pool(self, count: int) -> None:
        if self._pool is not None and count > 0:
            tokens = [token for token in self._free_tokens if token != _IMPLICIT_TOKEN]
            returned = self._pool.give(b"".join(tokens[:count]))
            self._free_tokens = [_IMPLICIT_TOKEN] * (len(self._free_tokens) - len(tokens)) + tokens[returned:]


def without_job_variables(variables: Mapping[str, str]) -> dict[str, str]:
    return {name: value for name, value in variables.items() if name not in _JOB_VARIABLES}


def open_job_pool(
    options: JobOptions,
    context: BuildContext,
    variables: Mapping[str, str],
    *,
    compiles: bool,
    remote_slots: int,
    warn: Callable[[Iterable[Problem]], object],
) -> JobPool:
    """Return the job pool of a build: that of a parent make, else a new one with the requested size.

    Without a requested number, the `remote_slots` of a distributed compiler are added to the local
    processors. If the build `compiles`, its tools share one jobserver style, because one may start the other;
    supported styles are detected by trial.
    """
    flags = read_make_flags(variables.get("MAKEFLAGS", ""))
    level = variables.get("CMAKE_BUILD_PARALLEL_LEVEL", "")
    jobs = options.jobs or flags.jobs or (int(level) if level.isdigit() else 0)
    local = jobs or processors()
    jobs = jobs or local + (0 if flags.auth else remote_slots)
    pool = join_pool(flags.auth) if flags.auth and not options.jobs else None
    if flags.auth and pool is None and not options.jobs:
        hint = "start the make rule with '+', or pass --jobs to forge"
        warn([Problem("cannot connect to the jobserver of the parent make", hint=hint)])
    supported = _styles(context, variables) if compiles else {}
    style = pool.style if pool else common_style(supported)
    if pool is None and style is not None:
        pool = create_pool(style, jobs)
    tools = frozenset(name for name, styles in supported.items() if style in styles)
    overloaded = partial(is_overloaded, options.memory_limit, context.load_limit)
    job_pool = JobPool(jobs, pool, tools, flags, overloaded)
    job_pool.local = min(local, job_pool.jobs)
    return job_pool


def _styles(context: BuildContext, variables: Mapping[str, str]) -> dict[str, frozenset[str]]:
    """Return the jobserver styles that each tool supports; results are cached by tool version."""
    file = (own_cache(variables) or context.layout.build) / STYLES_FILE
    identity = "\n".join(
        f"{name} {identity}" for name, identity in context.tools if name in {"ninja", "make"}
    )
    stored = {}
    with contextlib.suppress(OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        stored = json.loads(file.read_bytes())["styles"]
        return {name: frozenset(styles) for name, styles in stored[identity].items()}
    tools = {"ninja": context.ninja, "make": context.make}
    supported = {name: supported_styles(name, tool, variables) for name, tool in tools.items() if tool}
    others = [*stored.items()][-_MAX_STORED_STYLES + 1 :] if isinstance(stored, dict) else []
    styles = {name: sorted(of_tool) for name, of_tool in supported.items()}
    with contextlib.suppress(OSError):  # read-only cache folder
        write_if_changed(file, json.dumps({"styles": {**dict(others), identity: styles}}))
    return supported


def open_test_job_pool(options: JobOptions, variables: Mapping[str, str]) -> JobPool:
    """Return the job pool with one job per package under test; a parent make may provide it."""
    flags = read_make_flags(variables.get("MAKEFLAGS", ""))
    pool = join_pool(flags.auth) if flags.auth and not options.jobs else None
    short = partial(is_overloaded, options.memory_limit, options.load_limit or flags.load)
    return JobPool(options.jobs or flags.jobs or processors(), pool, flags=flags, is_overloaded=short)
