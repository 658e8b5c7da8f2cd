"""The memory of packages: what the build asks about it, and programs that were killed for lack of it."""

from __future__ import annotations

import re
from itertools import islice
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    import resource
    from collections.abc import Collection
    from contextlib import AbstractContextManager

    from forge.build.events import Event

_KILL_WORDS = re.compile(rb"Killed|signal 9\b|SIGKILL|out of memory|virtual memory exhausted")
"""Words in lines that _KILLED matches; searched first, because output may be very long."""
_KILLED = re.compile(
    rb".*Killed signal terminated program (?P<gcc>\S+)"
    rb"|.*?(?P<collect>\S+) terminated with signal 9\b"
    rb"|(?P<clang>\S+): error: unable to execute command: Killed"
    rb"|.*\(signal: 9, SIGKILL"
    rb"|(?P<gnu>\S+): out of memory allocating \d+ bytes"
    rb"|(?:(?P<old>\S+): )?virtual memory exhausted"
    rb"|LLVM ERROR: out of memory"
    rb"|Killed$"  # dash
    rb"|.*line \d+: +\d+ Killed "  # bash
)
_LONGEST_LINE = 500
"""The maximum number of bytes of a line that are read."""
_MOST_LINES = 20
"""The maximum number of lines with these words that are read in a piece of output."""
SIGKILL_CODES = frozenset({-9, 137})
"""The exit codes of a step whose own program was killed."""


class PackageMemory(Protocol):
    """The current and peak memory use of packages, in bytes; measured by a plugin."""

    def now(self, name: str) -> int:
        """Return the bytes that a running package uses."""

    def peak(self, name: str) -> int:
        """Return the peak of a package in this build and earlier ones, 0 if it is unknown."""

    def fits(self, name: str, running: Collection[str]) -> bool:
        """Return whether enough memory is left for one more package: the running ones may still grow."""

    def watching(self, name: str, process: int) -> AbstractContextManager[None]:
        """Add up the memory of a process and its descendants while they run."""

    def note_usage(self, name: str, usage: resource.struct_rusage) -> None:
        """Record what the kernel reports about a step that has ended."""

    def note(self, event: Event) -> None:
        """Record the peak of a package that has ended."""

    def close(self) -> None:
        """Stop watching, and write the peaks."""


def killed_program(output: bytes) -> str | None:
    """Return the program that was killed or ran out of memory according to the output of a build."""
    for word in islice(_KILL_WORDS.finditer(output), _MOST_LINES):
        begin = output.rfind(b"\n", 0, word.start()) + 1
        end = output.find(b"\n", word.end())
        line = output[begin : min(begin + _LONGEST_LINE, len(output) if end < 0 else end)]
        if match := _KILLED.match(line):
            program = next(filter(None, match.groups()), b"a program")
            return program.decode(errors="replace").rpartition("/")[2].strip(":'\"")
    return None
