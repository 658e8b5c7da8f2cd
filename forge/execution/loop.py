"""The build loop: start ready tasks, wait for an event, repeat."""

from __future__ import annotations

import queue
import signal
import threading
from typing import TYPE_CHECKING

from forge.base.signals import handle_signals
from forge.build.events import Aborted, Finished, Fresh, Output, Skipped, Started

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    from forge.build.events import Event
    from forge.build.tasks import BuildPlan, Task
    from forge.execution.runner import TaskRunner
    from forge.execution.scheduler import Scheduler

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
                # A task that is up to date makes its dependents ready at once.
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
                    # A closed terminal sends SIGHUP more than once by itself.
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
            # Some tasks are still active only if the loop was left by an error of the caller.
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
