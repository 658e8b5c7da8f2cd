"""Run forge, or with '-m' one of its modules, in the worker named by FORGE_WORKER, else in this process.

After '--in VARIABLE', run the command line of any program: in the worker named by that variable if it accepts
the program, else in this process. This file is a program started without site-packages; it imports as little
as possible.
"""

import _socket  # the module socket, which imports selectors and enum, would double the startup time
import os
import sys

WORKER_VARIABLE = "FORGE_WORKER"

DECLINED = 255
"""The exit code of a command that the worker leaves to its client."""
DECLINED_PREFIX = "forge: runs "
"""The beginning of the line with the reason."""


def main(argv: "list[str]") -> int:
    """Run the arguments in the worker and return the exit code; without a worker, execute forge."""
    is_program = argv[:1] == ["--in"]
    variable, words = (argv[1], argv[2:]) if is_program else (WORKER_VARIABLE, argv)
    address = os.environ.get(variable)
    if address:
        try:
            code = _ask(address, words)
            if not (is_program and code == DECLINED):
                return code
        except OSError:
            # The worker is unavailable or has ended. Continue without it, which is only slower.
            pass
    if not is_program:
        home = os.path.abspath(f"{__file__}/../../..")  # noqa: PTH100
        words = [sys.executable, f"{home}/_ros_forge.py", *words]
    return os.execvp(words[0], words)  # noqa: S606  (no shell is wanted)


def receive_exactly(connection: _socket.socket, size: int) -> bytes:
    """Return `size` bytes; raises OSError if the connection closes early."""
    received = b""
    while len(received) < size:
        chunk = connection.recv(size - len(received))
        if not chunk:
            raise OSError("the connection ended")
        received += chunk
    return received


def _ask(address: str, argv: "list[str]") -> int:
    """Send a command with its working directory, environment and output; return its exit code."""
    words = [os.getcwdb(), b"%d" % len(argv), *map(os.fsencode, argv)]  # noqa: PTH109  (pathlib is slower)
    variables = [b"%s=%s" % pair for pair in os.environb.items()]
    request = b"\0".join(words + variables)
    output = b"".join(descriptor.to_bytes(4, sys.byteorder) for descriptor in (1, 2))
    connection = _socket.socket(_socket.AF_UNIX)
    try:
        connection.connect(address)
        size = len(request).to_bytes(4, "big")
        connection.sendmsg([size], [(_socket.SOL_SOCKET, _socket.SCM_RIGHTS, output)])
        connection.sendall(request)
        return receive_exactly(connection, 1)[0]
    finally:
        connection.close()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
