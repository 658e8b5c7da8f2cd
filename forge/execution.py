"""The one loop of a build: start what is ready, take in what happens, repeat."""

from __future__ import annotations

import queue
import signal
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

from forge.model import Aborted, Finished, Fresh, Started

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from forge.model import BuildPlan, Event, Task
    from forge.runner import Runner
    from forge.schedule import Board


def execute(
    plan: BuildPlan, runner: Runner, board: Board, settle: Callable[[Task], Task | None]
) -> Iterator[Event]:
    """Carry out the plan and yield each event, in the thread of the caller.

    `settle` is asked about each task once all that it needs has ended: it returns the task as it is to
    run, or None when it need not.
    An exception in a worker is raised here. An interrupt (Ctrl-C, SIGTERM) ends all programs, yields
    the rest of the events, and raises KeyboardInterrupt at the end; a second one kills.
    """
    inbox: queue.SimpleQueue[Event | BaseException] = queue.SimpleQueue()
    crash: BaseException | None = None
    interrupts = 0

    def submit(task: Task) -> None:
        # The board says how many there are at a time; concurrent.futures would cost 10 ms to load.
        threading.Thread(target=_work, args=(runner, task, inbox.put), name=task.name).start()

    with _interrupts_into(inbox.put):
        while True:
            yield from _start(plan, board, settle, submit)
            if not board.running:
                break
            received = inbox.get()
            if isinstance(received, KeyboardInterrupt):
                interrupts += 1
                board.stop("interrupted")
                runner.interrupt(kill=interrupts > 1)
            elif isinstance(received, BaseException):
                crash = crash or received
                board.stop("an internal error")
                runner.finish_steps()
            else:
                board.note(received)
                if board.stopped and isinstance(received, Finished):
                    runner.finish_steps()
                yield received
    if crash:
        raise crash
    if interrupts:
        raise KeyboardInterrupt


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


@contextmanager
def _interrupts_into(put: Callable[[BaseException], None]) -> Iterator[None]:
    """Turn SIGINT and SIGTERM into letters for the loop, so that no event is lost half-way."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        # SimpleQueue.put is safe to call from a signal handler: that is what it was made for.
        signal.signal(number, lambda *_: put(KeyboardInterrupt()))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
