"""The one loop of a build: start what is ready, take in what happens, repeat."""

from __future__ import annotations

import queue
import signal
import threading
from typing import TYPE_CHECKING

from forge.interrupts import caught
from forge.model import Aborted, Finished, Fresh, Output, Started

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator

    from forge.model import BuildPlan, Event, Task
    from forge.runner import Runner
    from forge.schedule import Board

_ROOM = 200
"""How many pieces of output may wait for the loop; who prints more than it can take has to wait, too."""


class Inbox:
    """Letters of the workers, and of whoever interrupts, to the one loop."""

    def __init__(self) -> None:
        """Begin empty."""
        self._letters: queue.SimpleQueue[Event | BaseException] = queue.SimpleQueue()
        self._room = threading.Semaphore(_ROOM)

    def put(self, letter: Event | BaseException) -> None:
        """Put a letter into the box; output waits while there is much of it. Safe in a signal handler."""
        if isinstance(letter, Output):
            self._room.acquire()
        # SimpleQueue.put is safe to call from a signal handler: that is what it was made for.
        self._letters.put(letter)

    def get(self) -> Event | BaseException:
        """Wait for the next letter."""
        letter = self._letters.get()
        if isinstance(letter, Output):
            self._room.release()
        return letter


def execute(
    plan: BuildPlan, runner: Runner, board: Board, settle: Callable[[Task], Task | None]
) -> Generator[Event]:
    """Carry out the plan and yield each event, in the thread of the caller.

    `settle` is asked about each task once all that it needs has ended: it returns the task as it is to
    run, or None when it need not.
    An exception in a worker is raised here. An interrupt (Ctrl-C, SIGTERM, a closed terminal) ends all
    programs, yields the rest of the events, and raises KeyboardInterrupt at the end; a second one kills.
    Whoever leaves before the end has to close what this returns: that ends all programs, too.
    """
    inbox = Inbox()
    crash: BaseException | None = None
    interrupts = 0
    at_work: set[str] = set()

    def submit(task: Task) -> None:
        at_work.add(task.name)
        # The board says how many there are at a time; concurrent.futures would cost 10 ms to load.
        threading.Thread(target=_work, args=(runner, task, inbox.put), name=task.name).start()

    with caught(lambda number: inbox.put(KeyboardInterrupt(number))):
        try:
            while True:
                yield from _start(plan, board, settle, submit)
                if not board.running:
                    break
                received = inbox.get()
                if isinstance(received, KeyboardInterrupt):
                    interrupts += 1
                    board.stop("interrupted")
                    runner.interrupt(kill=_is_impatient(received, interrupts))
                elif isinstance(received, BaseException):
                    crash = crash or received
                    board.stop("an internal error")
                    runner.finish_steps()
                else:
                    if isinstance(received, Finished | Aborted):
                        at_work.discard(received.task)
                    board.note(received)
                    if board.stopped and isinstance(received, Finished):
                        runner.finish_steps()
                    yield received
        finally:
            _see_out(inbox, runner, at_work)
    if crash:
        raise crash
    if interrupts:
        raise KeyboardInterrupt


def _is_impatient(received: KeyboardInterrupt, count: int) -> bool:
    """Tell if somebody asks again; a closed terminal says so more than once by itself."""
    return count > 1 and received.args != (signal.SIGHUP,)


def _see_out(inbox: Inbox, runner: Runner, at_work: set[str]) -> None:
    """End what still runs: that is something only where the loop was left by an error of its reader."""
    if at_work:
        runner.interrupt(kill=False)
    while at_work:
        received = inbox.get()
        if isinstance(received, KeyboardInterrupt):
            runner.interrupt(kill=True)
        elif isinstance(received, Finished | Aborted):
            at_work.discard(received.task)


def _start(
    plan: BuildPlan,
    board: Board,
    settle: Callable[[Task], Task | None],
    submit: Callable[[Task], object],
) -> Iterator[Event]:
    """Yield all that happens now; a task that turns out to be fresh makes others ready at once."""
    while events := board.advance():
        for event in events:
            task = settle(plan.tasks[event.task]) if isinstance(event, Started) else None
            if task is not None:
                # Noted before anything is touched.
                yield Started(task.name, task.parts)
                submit(task)
            elif isinstance(event, Started):
                fresh = Fresh(event.task)
                board.note(fresh)
                yield fresh
            else:
                yield event


def _work(runner: Runner, task: Task, put: Callable[[Event | BaseException], None]) -> None:
    """Run one task in a worker; whatever escapes reaches the loop, and the task ends in any case."""
    try:
        runner.run(task, put)
    except BaseException as error:  # noqa: BLE001  (handed to the loop, which raises it)
        put(error)
        put(Aborted(task.name, 0.0))
