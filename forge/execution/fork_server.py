"""A process that imports its modules once and then forks for each command that a client requests.

The child runs the command with the client's working directory, environment and output. The server ends when
its stdin is closed, that is, when the build that started it ends. Uses the standard library only, so that any
interpreter can run it.
"""

from __future__ import annotations

import contextlib
import fcntl
import gc
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from forge.base.frozen import frozen
from forge.execution.started import BUILD_FOLDER_VARIABLE, StartedProcesses
from forge.execution.worker_client import DECLINED, receive_exactly

_CREDENTIALS = struct.Struct("3i")
"""Process, user and group at the other end of a connection."""


@frozen
class Call:
    """A command line with its absolute working directory, its environment and the client."""

    argv: list[str]
    cwd: str
    environment: dict[str, str]
    client: int


@contextlib.contextmanager
def started_server(
    argv: Callable[[int], Sequence[str]], environment: Mapping[str, str] | None = None
) -> Iterator[str]:
    """Start the server; `argv` returns its command line for the descriptor of a listening socket.

    Yield the path of the socket, to which clients can connect at once: they wait until the server is ready.
    The server is stopped at the end of the block.
    """
    with tempfile.TemporaryDirectory(prefix="forge-") as folder:
        address = str(Path(folder) / "worker")
        with socket.socket(socket.AF_UNIX) as listener:
            listener.bind(address)
            listener.listen(128)
            process = subprocess.Popen(
                argv(listener.fileno()),
                env=environment,
                pass_fds=[listener.fileno()],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )
        try:
            yield address
        finally:
            assert process.stdin is not None
            process.stdin.close()
            process.wait()


def serve(
    descriptor: int,
    run: Callable[[Call], int],
    load: Callable[[], object] = lambda: None,
    prepare: Callable[[Call], bool] = lambda _: True,
) -> int:
    """Serve calls from a listening socket until stdin is closed.

    `run` runs a call in a fork and returns its exit code; `load` is called once, and `prepare` before each
    fork, in this process: it returns False for a call that is left to the client.
    """
    with socket.socket(fileno=descriptor) as listener:
        load()
        signal.signal(signal.SIGCHLD, _reap)
        while True:
            ready, _, _ = select.select([listener, sys.stdin], [], [])
            if sys.stdin in ready:
                return 0
            connection, _ = listener.accept()
            with connection, contextlib.suppress(OSError, ValueError):
                call, descriptors = _receive(connection)
                if prepare(call):
                    gc.freeze()  # otherwise each child would copy all objects when it collects garbage
                    if os.fork() == 0:
                        listener.close()
                        os._exit(_answer(connection, call, descriptors, run))
                else:
                    connection.sendall(bytes([DECLINED]))
                for received in descriptors:
                    os.close(received)


def _reap(_number: int, _frame: object) -> None:
    """Wait for ended children, which adds their processor time to this process; SIG_IGN would lose it."""
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass


def _receive(connection: socket.socket) -> tuple[Call, list[int]]:
    """Return a request: folder, number of arguments, arguments and variables, separated by NUL."""
    size, descriptors, _, _ = socket.recv_fds(connection, 4, 2)
    request = receive_exactly(connection, int.from_bytes(size, "big"))
    cwd, count, *words = map(os.fsdecode, request.split(b"\0"))
    argv, variables = words[: int(count)], words[int(count) :]
    environment = dict(variable.split("=", 1) for variable in variables)
    credentials = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    return Call(argv, cwd, environment, _CREDENTIALS.unpack(credentials)[0]), descriptors


def _answer(connection: socket.socket, call: Call, descriptors: list[int], run: Callable[[Call], int]) -> int:
    """Run a call in this forked process, in a group that ends with the client; send it the exit code."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    for target, descriptor in enumerate(descriptors, start=1):
        os.dup2(descriptor, target)

    def kill_if_disconnected(_number: int, _frame: object) -> None:
        with contextlib.suppress(BlockingIOError):
            if not connection.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT):
                os.killpg(0, signal.SIGKILL)

    os.setpgid(0, 0)
    if folder := call.environment.get(BUILD_FOLDER_VARIABLE):
        # The next build in this folder kills the process if it still runs. Its parent does not identify it,
        # because the server may have ended by then.
        StartedProcesses(Path(folder)).note(os.getpid())
    signal.signal(signal.SIGIO, kill_if_disconnected)
    fcntl.fcntl(connection, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(connection, fcntl.F_SETFL, fcntl.fcntl(connection, fcntl.F_GETFL) | os.O_ASYNC)
    os.chdir(call.cwd)
    os.environ.clear()
    os.environ.update(call.environment)
    sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115  (until the process ends)
    sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    try:
        code = run(call)
    except SystemExit as leaving:
        code = leaving.code if isinstance(leaving.code, int) else 1
    sys.stdout.flush()
    sys.stderr.flush()
    connection.sendall(bytes([code]))
    return 0
