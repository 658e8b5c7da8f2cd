"""A warm forge for the many short commands of one build: `forge.worker SOCKET [MODULE ...]`.

Each interface package calls `forge interface generate`, and most of that call is starting an interpreter
and loading what it needs. The worker has loaded everything once; for each call it forks, and the child
runs the same command line with the caller's folder, variables and output. It ends when its standard
input does, that is with the build that started it, however that ends.
"""

from __future__ import annotations

import contextlib
import fcntl
import importlib
import json
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from forge import cli
from forge.interpreter import own_command
from forge.started import VARIABLE as BUILD_FOLDER
from forge.started import StartedProcesses
from forge.worker_client import VARIABLE, receive_exactly

if TYPE_CHECKING:
    from collections.abc import Iterator

_WARM = (
    "forge.commands.interface",
    "forge.interfaces.rendering",
    "forge.interfaces.parsing",
    "jinja2",
    "lark",
)


@contextlib.contextmanager
def worker(*modules: str) -> Iterator[dict[str, str]]:
    """Start a worker and yield the variables that lead its clients to it; it ends with the block.

    `modules` are loaded beside those of the interface compiler.
    """
    with tempfile.TemporaryDirectory(prefix="forge-") as folder:
        address = str(Path(folder) / "worker")
        process = subprocess.Popen(
            own_command("-m", "forge.worker", address, *modules),
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            yield {VARIABLE: address}
        finally:
            assert process.stdin is not None  # noqa: S101  (asked for above)
            process.stdin.close()
            process.wait()


def main(address: str, *modules: str) -> int:
    """Serve until standard input ends."""
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(address)
        listener.listen(64)
        for module in (*_WARM, *modules):
            importlib.import_module(module)
        # The system takes away children that ended; nobody waits for them.
        signal.signal(signal.SIGCHLD, signal.SIG_IGN)
        while True:
            ready, _, _ = select.select([listener, sys.stdin], [], [])
            if sys.stdin in ready:
                return 0
            connection, _ = listener.accept()
            if os.fork() == 0:
                listener.close()
                os._exit(_serve(connection))
            connection.close()


def _serve(connection: socket.socket) -> int:
    """Run one call in this forked process and tell the caller how it ended."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    size, descriptors, _, _ = socket.recv_fds(connection, 4, 2)
    call = json.loads(receive_exactly(connection, int.from_bytes(size, "big")))
    for target, descriptor in enumerate(descriptors, start=1):
        os.dup2(descriptor, target)
    _end_with(connection, call["environment"].get(BUILD_FOLDER))
    os.chdir(call["cwd"])
    os.environ.clear()
    os.environ.update(call["environment"])
    sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115  (until the process ends)
    sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    try:
        code = _run(call["argv"])
    except SystemExit as leaving:
        code = leaving.code if isinstance(leaving.code, int) else 1
    sys.stdout.flush()
    sys.stderr.flush()
    connection.sendall(bytes([code]))
    return 0


def _run(argv: list[str]) -> int:
    """Run a command line of forge, or a program of its own after '-m'."""
    if argv[:1] != ["-m"]:
        return cli.main(argv)
    code: int = importlib.import_module(argv[1]).main(argv[2:])
    return code


def _end_with(connection: socket.socket, folder: str | None) -> None:
    """End this process, and what it starts, when the caller at the other end does, as in an interrupt.

    Where the caller belongs to a build, the next one in that folder ends it otherwise.
    """

    def look(_number: int, _frame: object) -> None:
        with contextlib.suppress(BlockingIOError):
            if not connection.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT):
                os.killpg(0, signal.SIGKILL)

    os.setpgid(0, 0)
    if folder:
        # Nobody could tell it from other children of the worker once that has ended.
        StartedProcesses(Path(folder)).note(os.getpid())
    signal.signal(signal.SIGIO, look)
    fcntl.fcntl(connection, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(connection, fcntl.F_SETFL, fcntl.fcntl(connection, fcntl.F_GETFL) | os.O_ASYNC)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
