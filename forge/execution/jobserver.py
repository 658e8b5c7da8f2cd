"""GNU make's jobserver: a pipe with one byte for each job token.

To run a further job, a program reads a byte, and writes it back when the job ends; each program has one
implicit job without a token. make 4.4 and ninja 1.13 open a named pipe ('fifo:PATH'), earlier makes inherit
the pipe's two descriptors ('R,W'). forge's pipe serves both, since it has a path below /proc.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import select
import stat
import subprocess
from collections.abc import Mapping
from pathlib import Path

from forge.base.text import split_lines

FIFO, PIPE = "fifo", "pipe"
TOKEN = b"+"

_PAGE = os.sysconf("SC_PAGE_SIZE")
MAX_JOBS = (1 << 20) - _PAGE
"""The number of tokens in the largest pipe that Linux permits unprivileged users."""

_NOTICES = (b"ninja: Jobserver mode detected", b"ninja: warning: Jobserver 'pipe' mode detected")
_TRIALS = {
    "ninja": ("build.ninja", "rule try\n  command = :\nbuild once: try\n", ("-v",)),
    "make": ("Makefile", "once: ; @:\n", ()),
}
"""For each tool, a build file with one trivial target and the arguments for verbose output."""

_SUPPORT_OUTPUT = {
    "ninja": ("ninja: Jobserver mode detected", "ninja: using GNU make jobserver"),
    "make": ("",),
}
"""The output of a tool that has joined a jobserver; make prints nothing."""


class TokenPool:
    """A pipe of tokens, created by forge or by a parent make.

    `auth` is its address for child programs, which must inherit `descriptors`.
    """

    def __init__(self, reader: int, writer: int, style: str, auth: str = "") -> None:
        """Take ownership of the descriptors; `auth` is set for the pipe of a parent make."""
        self.style = style
        self.joined = bool(auth)
        self.auth = auth or (
            f"fifo:/proc/{os.getpid()}/fd/{reader}" if style == FIFO else f"{reader},{writer}"
        )
        self.descriptors = (reader, writer) if style == PIPE else ()
        self._reader, self._writer = reader, writer
        # Tools make their inherited end non-blocking, which affects all processes that share it. Reopen it.
        flags = os.O_RDONLY | os.O_CLOEXEC
        self._blocking = os.open(f"/proc/self/fd/{reader}", flags)
        self._nonblocking = os.open(f"/proc/self/fd/{reader}", flags | os.O_NONBLOCK)
        self._wake_reader, self._wake_writer = os.pipe()
        os.set_blocking(self._blocking, True)

    @property
    def room(self) -> int:
        """The capacity in tokens of a pipe created by forge; one page may be partly consumed."""
        size: int = fcntl.fcntl(self._writer, fcntl.F_GETPIPE_SZ)
        return max(size - _PAGE, size // 2)

    def take(self) -> bytes:
        """Wait for a token; return b'' after `wake`."""
        if not self.joined:
            # The kernel serves a blocked reader before a tool that returned a token can take it again. With
            # polling, forge would be too slow.
            return os.read(self._blocking, 1)
        while True:
            ready, _, _ = select.select([self._nonblocking, self._wake_reader], [], [])
            if self._wake_reader in ready:
                return b""
            token = self.take_now()
            if token:
                return token

    def take_now(self) -> bytes:
        """Return a token if one is available, else b''."""
        with contextlib.suppress(BlockingIOError):
            return os.read(self._nonblocking, 1)
        return b""

    def give(self, tokens: bytes) -> int:
        """Return tokens to the pool; return how many it accepted."""
        try:
            return os.write(self._writer, tokens) if tokens else 0
        except BlockingIOError:
            return 0

    def wake(self) -> None:
        """End a waiting `take`; the pool must not be used afterwards."""
        os.write(self._wake_writer if self.joined else self._writer, TOKEN)

    def close(self) -> None:
        ends = (self._blocking, self._nonblocking, self._wake_reader, self._wake_writer)
        for end in ends if self.joined and self.style == PIPE else (*ends, self._reader, self._writer):
            os.close(end)


def create_pool(style: str, jobs: int = 0) -> TokenPool:
    """Return a new, empty pool for `jobs` tokens, or fewer if the system limits the pipe size."""
    reader, writer = os.pipe()
    size = min(jobs, MAX_JOBS) + _PAGE
    if size > fcntl.fcntl(writer, fcntl.F_GETPIPE_SZ):
        with contextlib.suppress(OSError):
            fcntl.fcntl(writer, fcntl.F_SETPIPE_SZ, size)
    return TokenPool(reader, writer, style)


def join_pool(auth: str) -> TokenPool | None:
    """Return the pool of a parent make, or None if it is not accessible.

    make closes its pipe for commands that it does not recognize as makes, unless the recipe line starts with
    '+'.
    """
    try:
        if auth.startswith("fifo:"):
            end = os.open(auth.removeprefix("fifo:"), os.O_RDWR | os.O_CLOEXEC)
            reader, writer, style = end, os.dup(end), FIFO
        else:
            reader, writer = (int(number) for number in auth.split(","))
            style = PIPE
        if all(stat.S_ISFIFO(os.fstat(end).st_mode) for end in (reader, writer)):
            return TokenPool(reader, writer, style, auth)
    except (OSError, ValueError, OverflowError):
        pass
    return None


def supported_styles(name: str, program: Path, variables: Mapping[str, str]) -> frozenset[str]:
    """Return the jobserver styles that a tool ('ninja' or 'make') supports, determined by running it."""
    import tempfile

    file, text, arguments = _TRIALS[name]
    supported = set()
    for style in (FIFO, PIPE):
        with (
            tempfile.TemporaryDirectory(prefix="forge-") as folder,
            contextlib.closing(create_pool(style)) as pool,
            contextlib.suppress(OSError, subprocess.TimeoutExpired),
        ):
            Path(folder, file).write_text(text, encoding="utf-8")
            trial = subprocess.run(
                (str(program), *arguments),
                cwd=folder,
                env={**variables, "MAKEFLAGS": f"-j2 --jobserver-auth={pool.auth}"},
                pass_fds=pool.descriptors,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                errors="replace",
                timeout=10,
                check=False,
            )
            rejected = any(word in trial.stderr for word in ("error", "gnoring", "unavailable"))
            has_joined = any(word in trial.stdout for word in _SUPPORT_OUTPUT[name])
            if trial.returncode == 0 and not rejected and has_joined:
                supported.add(style)
    return frozenset(supported)


def common_style(styles_by_tool: Mapping[str, frozenset[str]]) -> str | None:
    """Return the style for a build: FIFO if all tools with jobserver support have it, else PIPE.

    A tool without support for pipes can be excluded, whereas make before 4.4 aborts on a fifo address
    wherever it is started.
    """
    supported = [styles for styles in styles_by_tool.values() if styles]
    if not supported:
        return None
    return FIFO if all(FIFO in styles for styles in supported) else PIPE


def without_jobserver_notices(lines: bytes) -> bytes:
    """Return the output without ninja's notices about the jobserver."""
    if not any(notice in lines for notice in _NOTICES):
        return lines
    return b"".join(line for line in split_lines(lines) if not line.startswith(_NOTICES))
