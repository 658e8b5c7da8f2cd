"""The build loop: start ready tasks, wait for an event, repeat."""

from __future__ import annotations

import queue
import signal
import threading
from typing import TYPE_CHECKING

from forge.base.signals import handle_signals
from forge.build.events import Aborted, Finished, Fresh, Output, Started

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator

    from forge.build.events import Event
    from forge.build.tasks import BuildPlan, Task
    from forge.execution.runner import Runner
    from forge.execution.scheduler import Scheduler

_MAX_PENDING_OUTPUT = 200
"""The number of output events that may wait for the loop; beyond it, workers block."""


class Inbox:
    """The queue of messages from workers and signal handlers to the loop."""

    def __init__(self) -> None:
        """Start empty."""
        self._messages: queue.SimpleQueue[Event | BaseException] = queue.SimpleQueue()
        self._output_slots = threading.Semaphore(_MAX_PENDING_OUTPUT)

    def put(self, message: Event | BaseException) -> None:
        """Add a message; output blocks while too much of it is pending. Safe in a signal handler."""
        if isinstance(message, Output):
            self._output_slots.acquire()
        # SimpleQueue.put is reentrant, so a signal handler may call it.
        self._messages.put(message)

    def get(self) -> Event | BaseException:
        """Wait for the next message."""
        message = self._messages.get()
        if isinstance(message, Output):
            self._output_slots.release()
        return message


def execute(
    plan: BuildPlan, runner: Runner, scheduler: Scheduler, resolve: Callable[[Task], Task | None]
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

    def submit(task: Task) -> None:
        active.add(task.name)
        # The scheduler limits their number; importing concurrent.futures would cost 10 ms.
        threading.Thread(target=_run_in_thread, args=(runner, task, inbox.put), name=task.name).start()

    with handle_signals(lambda number: inbox.put(KeyboardInterrupt(number))):
        try:
            while True:
                yield from _start(plan, scheduler, resolve, submit)
                if not scheduler.running:
                    break
                message = inbox.get()
                if isinstance(message, KeyboardInterrupt):
                    interrupts += 1
                    scheduler.stop("interrupted")
                    runner.interrupt(kill=_should_kill(message, interrupts))
                elif isinstance(message, BaseException):
                    crash = crash or message
                    scheduler.stop("an internal error")
                    runner.finish_steps()
                else:
                    if isinstance(message, Finished | Aborted):
                        active.discard(message.task)
                    scheduler.note(message)
                    if scheduler.stopped and isinstance(message, Finished):
                        runner.finish_steps()
                    yield message
        finally:
            _finish_active(inbox, runner, active)
    if crash:
        raise crash
    if interrupts:
        raise KeyboardInterrupt


def _should_kill(message: KeyboardInterrupt, count: int) -> bool:
    """Return True for a repeated interrupt; a closed terminal sends SIGHUP more than once by itself."""
    return count > 1 and message.args != (signal.SIGHUP,)


def _finish_active(inbox: Inbox, runner: Runner, active: set[str]) -> None:
    """Terminate the active tasks; there are some only if the loop was left by an error of the caller."""
    if active:
        runner.interrupt(kill=False)
    while active:
        message = inbox.get()
        if isinstance(message, KeyboardInterrupt):
            runner.interrupt(kill=True)
        elif isinstance(message, Finished | Aborted):
            active.discard(message.task)


def _start(
    plan: BuildPlan,
    scheduler: Scheduler,
    resolve: Callable[[Task], Task | None],
    submit: Callable[[Task], object],
) -> Iterator[Event]:
    """Yield the events of starting ready tasks; an up-to-date task makes its dependents ready at once."""
    while events := scheduler.advance():
        for event in events:
            task = resolve(plan.tasks[event.task]) if isinstance(event, Started) else None
            if task is not None:
                # The journal must record this before any file is touched.
                yield Started(task.name, task.inputs)
                submit(task)
            elif isinstance(event, Started):
                fresh = Fresh(event.task)
                scheduler.note(fresh)
                yield fresh
            else:
                yield event


def _run_in_thread(runner: Runner, task: Task, put: Callable[[Event | BaseException], None]) -> None:
    """Run one task in a worker thread; pass any exception to the loop and end the task in any case."""
    try:
        runner.run(task, put)
    except BaseException as error:
        put(error)
        put(Aborted(task.name, 0.0))
