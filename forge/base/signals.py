"""Handles Ctrl-C, kill, closed terminals and closed pipes."""

from __future__ import annotations

import errno
import fcntl
import io
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import NoReturn

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

_READER_IS_GONE = frozenset({errno.EPIPE, errno.EIO, errno.ENXIO, errno.EBADF})


@contextmanager
def handle_signals(handle: Callable[[int], object]) -> Iterator[None]:
    """Call `handle` with the signal number; only the main thread can do so, others leave signals unchanged.

    Ignored signals stay ignored, as with nohup or in background jobs.
    """

    def take(number: int, _frame: object) -> None:
        if number == signal.SIGHUP:
            for descriptor in filter(_is_closed, (1, 2)):
                _leave(descriptor)
        handle(number)

    before = {number: signal.getsignal(number) for number in SIGNALS}
    handled_signals = [number for number in SIGNALS if before[number] is not signal.SIG_IGN]
    try:
        for number in handled_signals:
            signal.signal(number, take)
    except ValueError:  # not in the main thread
        handled_signals = []
    try:
        yield
    finally:
        for number in handled_signals:
            signal.signal(number, before[number])


def interrupt(_number: int) -> NoReturn:
    raise KeyboardInterrupt


def open_standard_streams() -> None:
    """Open the null device for each closed standard stream.

    Otherwise the next opened file would get its descriptor, and child processes would write to it.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
            # File names may not be valid UTF-8, and a stream may support only ASCII.
            utf8 = stream.encoding.lower() == "utf-8"
            stream.reconfigure(errors="surrogateescape" if utf8 else "backslashreplace")
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:
            # The lowest free number, which is this one.
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
        if getattr(sys, name) is None:
            stream = open(number, mode, encoding="utf-8", errors="replace", closefd=False)  # noqa: SIM115  (until the process ends)
            setattr(sys, name, stream)


def is_writable(descriptor: int) -> bool:
    return bool(fcntl.fcntl(descriptor, fcntl.F_GETFL) & os.O_ACCMODE)


@contextmanager
def ignore_closed_output(descriptor: int) -> Iterator[None]:
    """Write output; if its reader is gone, continue as with a closed terminal.

    Later output to that stream is discarded without errors.
    """
    try:
        yield
    except OSError as error:
        if error.errno not in _READER_IS_GONE or signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:
            raise
        _leave(descriptor)
        signal.raise_signal(signal.SIGHUP)


def _is_closed(descriptor: int) -> bool:
    try:
        # An empty write fails for a closed terminal and has no effect on other files.
        os.write(descriptor, b"")
    except OSError as error:
        return error.errno in _READER_IS_GONE
    return False


def _leave(descriptor: int) -> None:
    with suppress(OSError):
        null_device = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null_device, descriptor)
        os.close(null_device)
