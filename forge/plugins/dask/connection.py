"""The connection to the workers of one build: submit tasks to Dask, send commands, receive events."""

from __future__ import annotations

import contextlib
import pickle
import threading
import uuid
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from forge.base.errors import HostError, Problem
from forge.build.events import Aborted, Finished, Output, StepStarted
from forge.execution.runner import GRACE_SECONDS, changed_variables
from forge.plugins.dask import worker
from forge.plugins.dask.messages import ACK_INTERVAL, FINISH, INTERRUPT, KILL, RemoteTask, Router, TaskRequest
from forge.plugins.dask.step_runner import locked

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from distributed import Future

    from forge.build.events import Event
    from forge.build.tasks import Task
    from forge.execution.options import JobOptions
    from forge.plugins.dask.cluster import Cluster
    from forge.plugins.dask.messages import Mailbox

_GIVE_UP, _ENDED, _LOST = "give up", "ended", "lost"
"""The client's own messages: a worker did not stop in time; Dask has ended the task; its result was lost."""

_RETRIES = 1
"""The number of retries of Dask after an internal error; it always retries if a worker dies."""
_MESSAGE_SECONDS = 10.0
_RELEASE_SECONDS = 15.0
"""The time limit for the programs of a lost worker to end."""


class Connection:
    """The executor on the workers; thread-safe. Close it when all tasks have ended."""

    def __init__(self, cluster: Cluster, jobs: JobOptions, resources: tuple[tuple[str, float], ...]) -> None:
        self.cluster = cluster
        self.slots = cluster.slots
        self.topic = f"forge-{uuid.uuid4().hex}"
        self.command = ""
        """The last command sent to all workers; empty while the build continues."""
        self._jobs = jobs
        self._resources = dict(resources) or None
        self._client = cluster.client
        self._router = Router()
        self._client.subscribe_topic(self.topic, self._router.deliver)

    def run(
        self,
        task: Task,
        environment: Mapping[str, str],
        put: Callable[[Event], None],
        restart: Callable[[], Mapping[str, str]],
    ) -> Finished | Aborted | None:
        """Run the steps of a task on some worker, and again on another one if it dies."""
        lock = self.cluster.folder / f"{task.name}.lock"
        key = f"{self.topic}-{task.name}"

        def remote_task(attempts: int) -> RemoteTask:
            nonlocal environment
            if attempts:
                _await_release(lock)
                environment = restart()
            return RemoteTask(task, environment, self._jobs, lock)

        mailbox = self._router.open(key)
        future = self._client.submit(
            worker.run_remote_task,
            self.topic,
            key,
            key=key,
            pure=False,
            retries=_RETRIES,
            resources=self._resources,
            workers=list(self.cluster.allowed_workers) or None,
        )
        future.add_done_callback(lambda _: mailbox.note(_ENDED))
        call = Call(self, task.name, remote_task, mailbox, future)
        if self.command:
            mailbox.note(self.command)
        try:
            for event in call.events():
                match event:
                    case StepStarted(_, step):
                        # Unlike the worker's variables, these are relative to the environment of this
                        # machine.
                        put(replace(event, environment=changed_variables({**environment, **dict(step.env)})))
                    case Finished(code=0):
                        return None
                    case Finished() | Aborted():
                        return event
                    case _:
                        put(event)
            return None
        finally:
            self._router.close(key)
            call.close()

    def deliver_task(self, request: TaskRequest, remote_task: RemoteTask) -> None:
        packed = pickle.dumps(remote_task)
        # If the worker has died meanwhile, another one will request the task.
        with contextlib.suppress(OSError, TimeoutError):
            self._client.run(worker.deliver_task, request.attempt, packed, workers=[request.address])

    def acknowledge_messages(self, request: TaskRequest) -> None:
        with contextlib.suppress(OSError, TimeoutError):
            self._client.run(worker.acknowledge, request.attempt, workers=[request.address])

    def finish_steps(self) -> None:
        """Let running steps finish and start no further step."""
        if not self.command:
            self._broadcast(FINISH)

    def interrupt(self, *, kill: bool) -> None:
        """Terminate everything on all workers; workers that do not respond are abandoned after a while."""
        self._broadcast(KILL if kill else INTERRUPT)
        # After an interrupt, the runner escalates twice.
        timeout = GRACE_SECONDS if kill else 4 * GRACE_SECONDS
        _later(timeout, partial(self._router.note, _GIVE_UP))

    def close(self) -> None:
        """Unsubscribe and remove the messages from the scheduler."""
        with contextlib.suppress(Exception):  # the build has ended, so errors do not matter
            self._client.unsubscribe_topic(self.topic)
            self._client.run_on_scheduler(worker.forget, self.topic)

    def _broadcast(self, command: str) -> None:
        self.command = command
        self._router.note(command)
        # Do not use the loop's thread, since the scheduler may respond slowly.
        threading.Thread(target=self._send_command, args=(command,), daemon=True).start()

    def _send_command(self, command: str) -> None:
        with contextlib.suppress(Exception):  # unreachable workers are abandoned after the timeout
            self._client.run(worker.send_command, self.topic, command)


class Call:
    """One task submitted to the cluster."""

    def __init__(
        self,
        connection: Connection,
        name: str,
        remote_task: Callable[[int], RemoteTask],
        mailbox: Mailbox,
        future: Future[Any],
    ) -> None:
        self._connection = connection
        self._name = name
        self._make_remote_task = remote_task
        self._mailbox = mailbox
        self._future = future
        self._attempts = 0
        self._request: TaskRequest | None = None
        self._until_ack = ACK_INTERVAL

    def events(self) -> Iterator[Event]:
        """Yield events until the task has ended."""
        while True:
            message = self._mailbox.get()
            if isinstance(message, TaskRequest):
                events = self._receive(message)
            elif isinstance(message, str):
                events = self._handle_command(message)
            else:
                events = (message,)
                self._until_ack -= 1
                if not self._until_ack and self._request:
                    self._until_ack = ACK_INTERVAL
                    self._connection.acknowledge_messages(self._request)
            yield from events
            if events and isinstance(events[-1], Finished | Aborted):
                return

    def close(self) -> None:
        """Cancel the task unless it is done; a worker that runs it terminates it."""
        if not self._future.done():
            with contextlib.suppress(OSError, TimeoutError):
                self._future.cancel()

    def _receive(self, request: TaskRequest) -> tuple[Event, ...]:
        """Deliver the task unless the build is being stopped."""
        if self._connection.command:
            return (Aborted(self._name, 0.0),)
        before, self._request, self._until_ack = self._request, request, ACK_INTERVAL
        self._mailbox.follow(request.attempt)
        remote_task = self._make_remote_task(self._attempts)
        self._attempts += 1
        self._connection.deliver_task(request, remote_task)
        if before is None:
            return ()
        message = f"the worker on {before.host} was lost; '{self._name}' is restarted on {request.host}"
        return (self._output(message),)

    def _handle_command(self, command: str) -> tuple[Event, ...]:
        """Handle a message of the client itself."""
        aborted = Aborted(self._name, 0.0)
        if command == _ENDED:
            return self._ended()
        if command == _LOST:
            raise HostError(Problem(f"the worker's result for '{self._name}' was not received"))
        if command == _GIVE_UP:
            where = f"the worker on {self._request.host}" if self._request else "the scheduler"
            return (self._output(f"{where} does not respond and is abandoned"), aborted)
        return () if self._mailbox.attempt else (aborted,)

    def _ended(self) -> tuple[Event, ...]:
        """Return the events after Dask has ended the task: none while its last message is in transit."""
        status = self._future.status
        if status == "finished":
            _later(_MESSAGE_SECONDS, partial(self._mailbox.note, _LOST))
            return ()
        if status != "error":
            hint = "check that it is still running, and that the task was not cancelled there"
            where = self._connection.cluster.address
            raise HostError(Problem(f"the scheduler at '{where}' dropped the task '{self._name}'", hint=hint))
        error = self._future.exception()
        if type(error).__name__ == "KilledWorker":
            cause = "every worker that ran it died; see the logs of the workers"
        else:
            cause = str(error) or type(error).__name__
        return (self._output(f"'{self._name}' failed: {cause}"), Finished(self._name, 1, 0.0))

    def _output(self, text: str) -> Output:
        return Output(self._name, f"forge: {text}\n".encode(errors="replace"), stderr=True)


def _later(seconds: float, callback: Callable[[], object]) -> None:
    timer = threading.Timer(seconds, callback)
    timer.daemon = True
    timer.start()


def _await_release(lock: Path) -> None:
    """Wait until no program of an earlier attempt runs; raise HostError if this takes too long."""
    try:
        with locked(lock, _RELEASE_SECONDS):
            pass
    except TimeoutError:
        hint = "end the processes that still run on the lost worker, then build again"
        raise HostError(Problem(f"'{lock}' is still locked by a lost worker", hint=hint)) from None
