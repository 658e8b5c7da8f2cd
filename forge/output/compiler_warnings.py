"""Finds the warnings of compilers in the output of ninja, which prints their stderr to its own stdout.

With make, warnings reach the user on stderr. Ninja prints a line for each command that has ended, followed by
everything that the command printed.
"""

from __future__ import annotations

import re

_COMMAND = re.compile(rb"\[\d+/\d+\] ")
_WARNING = re.compile(rb":[ ]?(?:\x1b\[[\d;]*[mK])*warning: ")
"""The message of a compiler or linker, perhaps coloured."""
_MOST = 1_000_000
"""Bytes kept of the output of one package."""


class CompilerWarnings:
    """Collects the output of the commands of one package that print warnings."""

    def __init__(self) -> None:
        self._command: list[bytes] | None = None
        self._found: list[bytes] = []
        self._room = _MOST

    def add(self, lines: bytes) -> None:
        """Read complete lines of a build tool's stdout."""
        for line in lines.splitlines(keepends=True):
            if _COMMAND.match(line):
                self.end_step()
                self._command = []
            elif self._command is not None and self._room > 0:
                self._command.append(line)
                self._room -= len(line)

    def end_step(self) -> None:
        """Forget the output of the current command unless it contains a warning."""
        text = b"".join(self._command or ())
        if _WARNING.search(text):
            self._found.append(text)
        else:
            self._room += len(text)
        self._command = None

    @property
    def text(self) -> bytes:
        """The output of the commands that printed warnings."""
        return b"".join(self._found)
