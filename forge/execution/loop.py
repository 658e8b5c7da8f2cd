"""The build loop: start the tasks that are ready according to the scheduler, wait for an event, repeat."""

from __future__ import annotations

import queue
import signal
import threading
from heapq import heappop, heappush
from typing import TYPE_CHECKING

from forge.base.graph import closures, reduced, reverse
from forge.base.signals import handle_signals
from forge.build.events import Aborted, Event, Finished, Fresh, Output, Skipped, Started

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Mapping

    from forge.build.tasks import BuildPlan, Task
    from forge.execution.runner import TaskRunner

_MAX_PENDING_OUTPUT = 200
"""The number of output events that may wait for the loop; beyond it, workers block."""


class Inbox:
    """The queue of messages from workers and signal handlers to the loop."""

    def __init__(self) -> None:
        self._messages: queue.SimpleQueue[Event | BaseException] = queue.SimpleQueue()
        self._output_slots = threading.Semaphore(_MAX_PENDING_OUTPUT)

    def put(self, message: Event | BaseException) -> None:
        """Add a message; output blocks while too much of it is pending. Safe in a signal handler."""
        if isinstance(message, Output):
            self._output_slots.acquire()
        # SimpleQueue.put is reentrant, so a signal handler may call it.
        self._messages.put(message)

    def get(self) -> Event | BaseException:
        message = self._messages.get()
        if isinstance(message, Output):
            self._output_slots.release()
        return message


def execute(
    plan: BuildPlan, runner: TaskRunner, scheduler: Scheduler, resolve: Callable[[Task], Task | None]
) -> Generator[Event]:
    """Run the plan and yield each event in the caller's thread.

    `resolve` is called for each task once its dependencies have finished: it returns the task with its final
    inputs, or None if it is up to date.
    An exception in a worker is raised here. An interrupt (Ctrl-C, SIGTERM, a closed terminal) terminates all
    programs, yields the remaining events, and raises KeyboardInterrupt at the end; a second one kills.
    Callers that stop early must close the generator, which also terminates all programs.
    """
    inbox = Inbox()
    crash: BaseException | None = None
    interrupts = 0
    active: set[str] = set()
    with handle_signals(lambda number: inbox.put(KeyboardInterrupt(number))):
        try:
            while True:
                # A task that is up to date makes its dependents ready immediately.
                while events := scheduler.advance():
                    for event in events:
                        if isinstance(event, Skipped):
                            yield event
                        elif task := resolve(plan.tasks[event.task]):
                            # The journal must record this before any file is touched.
                            yield Started(task.name, task.inputs)
                            # The scheduler limits them; importing concurrent.futures would cost 10 ms.
                            arguments = (task, inbox.put)
                            threading.Thread(target=runner.run, args=arguments, name=task.name).start()
                            active.add(task.name)
                        else:
                            fresh = Fresh(event.task)
                            scheduler.note(fresh)
                            yield fresh
                if not scheduler.running:
                    break
                message = inbox.get()
                if isinstance(message, KeyboardInterrupt):
                    interrupts += 1
                    scheduler.stop("interrupted")
                    # A closing terminal may send SIGHUP more than once.
                    kill = interrupts > 1 and message.args != (signal.SIGHUP,)
                    runner.executor.interrupt(kill=kill)
                elif isinstance(message, BaseException):
                    crash = crash or message
                    scheduler.stop("an internal error")
                    runner.executor.finish_steps()
                else:
                    if isinstance(message, Finished | Aborted):
                        active.discard(message.task)
                    scheduler.note(message)
                    if scheduler.stopped and isinstance(message, Finished):
                        runner.executor.finish_steps()
                    yield message
        finally:
            # Tasks are still active here only if an error in the caller ended the loop.
            if active:
                runner.executor.interrupt(kill=False)
            while active:
                message = inbox.get()
                if isinstance(message, KeyboardInterrupt):
                    runner.executor.interrupt(kill=True)
                elif isinstance(message, Finished | Aborted):
                    active.discard(message.task)
    if crash:
        raise crash
    if interrupts:
        raise KeyboardInterrupt


class Scheduler:
    """The waiting, running and finished tasks of a build; owned by the build loop.

    At most `limit` tasks run at a time (0: any number). Ready tasks on the critical path start first,
    according to the durations in `seconds`, then those with more dependents; with `in_order`, tasks start in
    plan order. After a failure no task starts, or with `continue_on_error` no task that needs the failed
    package. While others run, a task starts only if it `fits` into memory along with them; smaller ones may
    overtake it.
    """

    def __init__(
        self,
        plan: BuildPlan,
        limit: int,
        seconds: Mapping[str, float] | None = None,
        *,
        continue_on_error: bool = False,
        in_order: bool = False,
        fits: Callable[[str, frozenset[str]], bool] = lambda _name, _running: True,
    ) -> None:
        # Tasks list their transitive dependencies: millions of entries for a chain of thousands. Reduce them,
        # since they are visited whenever a task ends.
        direct = reduced(
            {name: (*task.needs, *task.after) for name, task in plan.tasks.items()}, [*plan.tasks]
        )
        self._needs = {name: frozenset(needs) for name, needs in direct.items()}
        self._dependents = reverse(self._needs)
        self._unfinished_needs = {name: len(needs) for name, needs in direct.items()}
        self._limit = limit or len(plan.tasks) + 1
        self._continue = continue_on_error
        self._fits = fits
        self.held: tuple[str, ...] = ()
        """Ready tasks that wait for memory."""
        self._running: set[str] = set()
        self._failed: dict[str, str] = {}
        self._stopped_by: str | None = None
        ordered = [*self._needs]
        if not in_order:
            weights = _weights(self._dependents, seconds or {})
            # Sorting is stable, so ties keep the plan's topological order.
            ordered.sort(key=weights.__getitem__, reverse=True)
        self._position = {name: position for position, name in enumerate(ordered)}
        self._waiting = dict.fromkeys(ordered)
        # Heaps of tasks that are ready, and of tasks that will never start because a dependency failed.
        self._ready = [
            (position, name) for position, name in enumerate(ordered) if not self._unfinished_needs[name]
        ]
        self._blocked: list[tuple[int, str]] = []

    @property
    def running(self) -> frozenset[str]:
        return frozenset(self._running)

    @property
    def stopped(self) -> bool:
        """Return True if no further task will start."""
        return self._stopped_by is not None

    def advance(self) -> list[Started | Skipped]:
        """Return the tasks that are skipped and the tasks that start now."""
        if self._stopped_by is not None:
            events: list[Started | Skipped] = [Skipped(name, self._stopped_by) for name in self._waiting]
            self._waiting.clear()
            return events
        events = []
        while self._blocked:
            _, name = heappop(self._blocked)
            if name in self._waiting:
                del self._waiting[name]
                because = min(self._failed[need] for need in self._needs[name] if need in self._failed)
                self._fail(name, because)
                events.append(Skipped(name, because))
        held = []
        while self._ready and len(self._running) < self._limit:
            position, name = heappop(self._ready)
            # One task may always run: waiting would not give it more memory.
            if self._running and not self._fits(name, self.running):
                held.append((position, name))
                continue
            del self._waiting[name]
            self._running.add(name)
            events.append(Started(name))
        for item in held:
            heappush(self._ready, item)
        self.held = tuple(name for _, name in held)
        return events

    def note(self, event: Event) -> None:
        """Record how a task ended; other events are ignored."""
        match event:
            case Finished(task, 0) | Fresh(task):
                self._running.discard(task)
                for dependent in self._dependents[task]:
                    self._unfinished_needs[dependent] -= 1
                    if not self._unfinished_needs[dependent]:
                        heappush(self._ready, (self._position[dependent], dependent))
            case Finished(task):
                self._fail(task, task)
                if not self._continue:
                    self.stop(task)
            case Aborted(task):
                self._fail(task, task)
            case _:
                pass

    def stop(self, because: str) -> None:
        """Start no further task; the first reason is kept."""
        self._stopped_by = self._stopped_by or because

    def _fail(self, name: str, because: str) -> None:
        self._running.discard(name)
        self._failed[name] = because
        for dependent in self._dependents[name]:
            heappush(self._blocked, (self._position[dependent], dependent))


def _weights(
    dependents: Mapping[str, frozenset[str]], seconds: Mapping[str, float]
) -> dict[str, tuple[float, int]]:
    """Return for each task the length of its critical path to the end and its number of dependents.

    `dependents` is in topological order. A task of unknown duration counts as the median; if no duration is
    known, all paths have length 0.
    """
    durations = sorted(seconds[name] for name in dependents if name in seconds)
    typical = durations[len(durations) // 2] if durations else 0.0
    backwards = [*dependents][::-1]
    waiting = closures(dependents, backwards)
    chain: dict[str, float] = {}
    for name in backwards:
        longest = max((chain[dependent] for dependent in dependents[name]), default=0.0)
        chain[name] = longest + seconds.get(name, typical)
    return {name: (chain[name], len(waiting[name])) for name in dependents}
