"""A preloaded forge process for the many short commands of one build: `forge.cli.worker SOCKET [MODULE ...]`.

Each interface package runs `forge interface generate`, which spends most of its time starting an interpreter
and importing modules. The worker imports everything once and forks for each request; the child runs the
command line with the caller's working directory, environment and output. The worker exits when its stdin is
closed, that is, whenever the build ends that started it.
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

from forge.cli.main import main as run_command
from forge.execution.started import BUILD_FOLDER_VARIABLE, StartedProcesses
from forge.execution.worker_client import WORKER_VARIABLE, receive_exactly
from forge.toolchain.interpreter import own_command

if TYPE_CHECKING:
    from collections.abc import Iterator

_WARM = (
    "forge.cli.commands.interface",
    "forge.interfaces.rendering",
    "forge.interfaces.read.parsing",
    "jinja2",
    "lark",
)


@contextlib.contextmanager
def worker(*modules: str) -> Iterator[dict[str, str]]:
    """Start a worker and yield the variables that let clients connect; stop it at the end of the block.

    `modules` are imported in addition to those of the interface compiler.
    """
    with tempfile.TemporaryDirectory(prefix="forge-") as folder:
        address = str(Path(folder) / "worker")
        process = subprocess.Popen(
            own_command("-m", "forge.cli.worker", address, *modules),
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            yield {WORKER_VARIABLE: address}
        finally:
            assert process.stdin is not None  # noqa: S101  (stdin=PIPE)
            process.stdin.close()
            process.wait()


def main(address: str, *modules: str) -> int:
    """Serve requests until stdin is closed."""
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(address)
        listener.listen(64)
        for module in (*_WARM, *modules):
            importlib.import_module(module)
        # The kernel reaps children, because nothing waits for them.
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
    """Run one request in this forked process and send its exit code to the caller."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    size, descriptors, _, _ = socket.recv_fds(connection, 4, 2)
    call = json.loads(receive_exactly(connection, int.from_bytes(size, "big")))
    for target, descriptor in enumerate(descriptors, start=1):
        os.dup2(descriptor, target)
    _end_with(connection, call["environment"].get(BUILD_FOLDER_VARIABLE))
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
    """Run a forge command line, or after '-m' the main function of a module."""
    if argv[:1] != ["-m"]:
        return run_command(argv)
    code: int = importlib.import_module(argv[1]).main(argv[2:])
    return code


def _end_with(connection: socket.socket, folder: str | None) -> None:
    """Kill this process group when the caller disconnects.

    If the caller belongs to a build, note the process, so that the next build in that folder can kill it
    otherwise.
    """

    def check_connection(_number: int, _frame: object) -> None:
        with contextlib.suppress(BlockingIOError):
            if not connection.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT):
                os.killpg(0, signal.SIGKILL)

    os.setpgid(0, 0)
    if folder:
        # It could not be identified after the end of the worker.
        StartedProcesses(Path(folder)).note(os.getpid())
    signal.signal(signal.SIGIO, check_connection)
    fcntl.fcntl(connection, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(connection, fcntl.F_SETFL, fcntl.fcntl(connection, fcntl.F_GETFL) | os.O_ASYNC)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
