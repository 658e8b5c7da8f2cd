"""The messages between the client and its workers, and their delivery to the threads that wait for them."""

from __future__ import annotations

import pickle
import queue
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from forge.base.errors import HostError, Problem
from forge.base.frozen import frozen
from forge.build.events import Event
from forge.build.tasks import Task
from forge.execution.options import JobOptions

FINISH, INTERRUPT, KILL = "finish", "interrupt", "kill"
"""Commands to the step runner on a worker: stop after this step, terminate, kill."""

ACK_INTERVAL = 100
"""The number of messages after which the client acknowledges them to the worker."""


@frozen
class TaskRequest:
    """A worker has accepted a task and requests its RemoteTask; `attempt` is the id of this attempt."""

    attempt: str
    address: str
    host: str


@frozen
class RemoteTask:
    """A task for a worker: steps to run in an environment prepared by the client.

    `jobs` are the limits for all tasks of a worker. `lock` is held while any program of this task runs.
    """

    task: Task
    environment: Mapping[str, str]
    jobs: JobOptions
    lock: Path


class Mailbox:
    """The messages of one task from any worker; `attempt` is the current attempt."""

    def __init__(self) -> None:
        self.attempt = ""
        self._expected = 0
        self._messages: queue.SimpleQueue[tuple[str, int, Any]] = queue.SimpleQueue()

    def put(self, attempt: str, number: int, content: object) -> None:
        self._messages.put((attempt, number, content))

    def note(self, command: str) -> None:
        self.put("", 0, command)

    def get(self) -> Event | TaskRequest | str:
        """Wait for the next task request, event of the current attempt, or message from the client.

        Raises HostError if a message was lost.
        """
        while True:
            attempt, number, content = self._messages.get()
            if not attempt or number == 0:
                return content  # type: ignore[no-any-return]
            if attempt != self.attempt:
                continue
            self._expected += 1
            if number != self._expected:
                raise HostError(Problem("a message from a worker was lost"))
            return pickle.loads(content)  # type: ignore[no-any-return]  # noqa: S301  (from a trusted worker)

    def follow(self, attempt: str) -> None:
        """Make this the current attempt; messages of others are ignored."""
        self.attempt = attempt
        self._expected = 0


class Router:
    """Distributes messages from workers; `deliver` is called in the client's event loop."""

    def __init__(self) -> None:
        self._mailboxes: dict[str, Mailbox] = {}
        self._attempts: dict[str, Mailbox] = {}
        self._lock = threading.Lock()

    def open(self, key: str) -> Mailbox:
        with self._lock:
            mailbox = self._mailboxes[key] = Mailbox()
            return mailbox

    def close(self, key: str) -> None:
        with self._lock:
            removed = self._mailboxes.pop(key, None)
            self._attempts = {
                attempt: mailbox for attempt, mailbox in self._attempts.items() if mailbox is not removed
            }

    def deliver(self, event: tuple[float, dict[str, Any]]) -> None:
        """Route one Dask event, a pair of time and message."""
        message = event[1]
        attempt, number, content = message["attempt"], message["number"], message["content"]
        with self._lock:
            if number == 0:
                key, content = pickle.loads(content)  # noqa: S301  (from a trusted worker)
                if key in self._mailboxes:
                    self._attempts[attempt] = self._mailboxes[key]
            if attempt in self._attempts:
                self._attempts[attempt].put(attempt, number, content)

    def note(self, command: str) -> None:
        with self._lock:
            for mailbox in self._mailboxes.values():
                mailbox.note(command)
