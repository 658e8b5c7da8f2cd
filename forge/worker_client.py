"""Run forge, or after '-m' a program of its own, through the worker that FORGE_WORKER names, else as usual.

This file is a program, started without site-packages: it imports what costs least.
"""

import os
import socket
import sys

VARIABLE = "FORGE_WORKER"


def main(argv: "list[str]") -> int:
    """Return the exit code of the command line, or become a forge of its own."""
    address = os.environ.get(VARIABLE)
    if address:
        try:
            return _ask(address, argv)
        except OSError:
            # The worker is not there, or has gone: everything goes on without it, only slower.
            pass
    start = f"{os.path.dirname(os.path.dirname(os.path.abspath(__file__)))}/_ros_forge.py"  # noqa: PTH100, PTH120
    return os.execv(sys.executable, [sys.executable, start, *argv])  # noqa: S606  (no shell is wanted)


def receive_exactly(connection: socket.socket, size: int) -> bytes:
    """Return `size` bytes; raises OSError when the other side ends before."""
    received = b""
    while len(received) < size:
        chunk = connection.recv(size - len(received))
        if not chunk:
            raise OSError("the connection ended")
        received += chunk
    return received


def _ask(address: str, argv: "list[str]") -> int:
    import json  # noqa: PLC0415  (3 ms that only a call to a worker takes)

    cwd = os.getcwd()  # noqa: PTH109  (pathlib would double the start)
    call = {"argv": argv, "cwd": cwd, "environment": dict(os.environ)}
    said = json.dumps(call).encode()
    with socket.socket(socket.AF_UNIX) as connection:
        connection.connect(address)
        socket.send_fds(connection, [len(said).to_bytes(4, "big")], [1, 2])
        connection.sendall(said)
        return receive_exactly(connection, 1)[0]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
