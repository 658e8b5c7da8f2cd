"""The pool of job tokens that programs share, as GNU make speaks of it: a pipe with a byte for each token.

Who wants to run one more job reads a byte, and writes it back when the job ended; each program has one
job that it need not read a token for. make 4.4 and ninja 1.13 open a named pipe ('fifo:PATH'), earlier ones
inherit the pipe's two descriptors ('R,W'). One pipe of ours serves both: below /proc it has a path.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import select
import stat
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

from forge.excerpts import split_lines

if TYPE_CHECKING:
    from collections.abc import Mapping

FIFO, PIPE = "fifo", "pipe"
TOKEN = b"+"

_PAGE = os.sysconf("SC_PAGE_SIZE")
MOST_JOBS = (1 << 20) - _PAGE
"""The largest pipe that Linux gives to everybody has a token for each of so many jobs."""

_BLURB = (b"ninja: Jobserver mode detected", b"ninja: warning: Jobserver 'pipe' mode detected")
_TRIALS = {
    "ninja": ("build.ninja", "rule try\n  command = :\nbuild once: try\n", ("-v",)),
    "make": ("Makefile", "once: ; @:\n", ()),
}
"""For each tool a file by which it does nothing, once, and the words that make it talk."""

_FLUENT = {"ninja": ("ninja: Jobserver mode detected", "ninja: using GNU make jobserver"), "make": ("",)}
"""What a tool says when it has joined; make says nothing."""


class Pool:
    """One pipe of tokens, ours or that of a make above us.

    `auth` is its address for programs below, which must inherit `descriptors`.
    """

    def __init__(self, reader: int, writer: int, style: str, auth: str = "") -> None:
        """Take over a pipe; `auth` is given when it is not ours."""
        self.style = style
        self.joined = bool(auth)
        self.auth = auth or (
            f"fifo:/proc/{os.getpid()}/fd/{reader}" if style == FIFO else f"{reader},{writer}"
        )
        self.descriptors = (reader, writer) if style == PIPE else ()
        self._reader, self._writer = reader, writer
        # Tools set their end not to block, which all who inherited it share: we open it once more.
        flags = os.O_RDONLY | os.O_CLOEXEC
        self._patient = os.open(f"/proc/self/fd/{reader}", flags)
        self._hasty = os.open(f"/proc/self/fd/{reader}", flags | os.O_NONBLOCK)
        self._bell, self._rope = os.pipe()
        os.set_blocking(self._patient, True)

    @property
    def room(self) -> int:
        """How many tokens it can hold, if it is ours: of one page, some may have been taken already."""
        size: int = fcntl.fcntl(self._writer, fcntl.F_GETPIPE_SZ)
        return max(size - _PAGE, size // 2)

    def take(self) -> bytes:
        """Wait for a token; b'' after `wake`."""
        if not self.joined:
            # A reader that the kernel keeps asleep is served before a tool that returned a token asks
            # for it again; one that polls would come late.
            return os.read(self._patient, 1)
        while True:
            ready, _, _ = select.select([self._hasty, self._bell], [], [])
            if self._bell in ready:
                return b""
            token = self.take_now()
            if token:
                return token

    def take_now(self) -> bytes:
        """Return a token if there is one, else b''."""
        with contextlib.suppress(BlockingIOError):
            return os.read(self._hasty, 1)
        return b""

    def give(self, tokens: bytes) -> int:
        """Put tokens into the pool, the same that were taken; returns for how many there was room."""
        try:
            return os.write(self._writer, tokens) if tokens else 0
        except BlockingIOError:
            return 0

    def wake(self) -> None:
        """End a waiting `take`; the pool is of no use to us from then on."""
        os.write(self._rope if self.joined else self._writer, TOKEN)

    def close(self) -> None:
        """Close our ends."""
        ends = (self._patient, self._hasty, self._bell, self._rope)
        for end in ends if self.joined and self.style == PIPE else (*ends, self._reader, self._writer):
            os.close(end)


def own_pool(style: str, jobs: int = 0) -> Pool:
    """Return a new and empty pool, for that many jobs if the system allows a pipe of that size."""
    reader, writer = os.pipe()
    wanted = min(jobs, MOST_JOBS) + _PAGE
    if wanted > fcntl.fcntl(writer, fcntl.F_GETPIPE_SZ):
        with contextlib.suppress(OSError):
            fcntl.fcntl(writer, fcntl.F_SETPIPE_SZ, wanted)
    return Pool(reader, writer, style)


def joined_pool(auth: str) -> Pool | None:
    """Return the pool that a make above us offers, or None when it cannot be reached.

    make closes its pipe to programs that it does not know to be makes: the rule lacks a '+'.
    """
    try:
        if auth.startswith("fifo:"):
            end = os.open(auth.removeprefix("fifo:"), os.O_RDWR | os.O_CLOEXEC)
            reader, writer, style = end, os.dup(end), FIFO
        else:
            reader, writer = (int(number) for number in auth.split(","))
            style = PIPE
        if all(stat.S_ISFIFO(os.fstat(end).st_mode) for end in (reader, writer)):
            return Pool(reader, writer, style, auth)
    except (OSError, ValueError, OverflowError):
        pass
    return None


def spoken(name: str, program: Path, variables: Mapping[str, str]) -> frozenset[str]:
    """Return the styles that a tool ('ninja' or 'make') speaks; tried, since versions do not say."""
    return frozenset(style for style in (FIFO, PIPE) if _speaks(name, program, style, variables))


def common_style(spoken_by: Mapping[str, frozenset[str]]) -> str | None:
    """Return the one style for a run: what all that speak any have in common, first 'fifo'.

    Where they have nothing in common it is 'pipe': one that does not speak that can be told to stay out,
    while make before 4.4 stops when it only hears of a fifo, wherever it is started.
    """
    speakers = [styles for styles in spoken_by.values() if styles]
    if not speakers:
        return None
    return FIFO if all(FIFO in styles for styles in speakers) else PIPE


def without_blurbs(lines: bytes) -> bytes:
    """Return output without lines that only say that ninja has joined, or would have liked a fifo more."""
    if not any(blurb in lines for blurb in _BLURB):
        return lines
    return b"".join(line for line in split_lines(lines) if not line.startswith(_BLURB))


def _speaks(name: str, program: Path, style: str, variables: Mapping[str, str]) -> bool:
    import tempfile  # noqa: PLC0415  (a build with nothing to do has no tools to try)

    file, text, words = _TRIALS[name]
    with tempfile.TemporaryDirectory(prefix="forge-") as folder, contextlib.closing(own_pool(style)) as pool:
        Path(folder, file).write_text(text, encoding="utf-8")
        try:
            tried = subprocess.run(
                (str(program), *words),
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
        except (OSError, subprocess.TimeoutExpired):
            return False
    refused = "error" in tried.stderr or "gnoring" in tried.stderr or "unavailable" in tried.stderr
    return tried.returncode == 0 and not refused and any(word in tried.stdout for word in _FLUENT[name])
