"""What a user can mend: problems with a place, a cause and a remedy.

    ForgeError            everything below; the command line shows its problems and exits with 2
      WorkspaceError      the workspace, a manifest or an existing install does not allow the command
      SelectionError      the command line names packages that cannot be selected
      InterfaceError      an interface definition is wrong
      EnvironmentFault    the machine lacks something: a compiler, CMake, numpy, a writable folder

Anything else that escapes a command is our bug, and says so.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

_UNSEEN = {
    code: "\N{REPLACEMENT CHARACTER}"
    for codes in ((0, 9), (11, 32), (127, 160), (0x200E, 0x2010), (0x202A, 0x202F), (0x2066, 0x206A))
    for code in range(*codes)
}
"""What moves the cursor of a terminal, or turns the direction of text: files that are quoted may have it."""

_WIDEST = 200
"""How many characters of a line are quoted."""

EXIT_INTERRUPTED = 130
"""The exit code after Ctrl-C; the others are of forge.cli alone."""


@frozen
class Place:
    """A spot in a file. Lines and columns count from 1; `source` is the whole line as written."""

    path: Path | str
    line: int | None = None
    column: int | None = None
    source: str | None = None

    def __str__(self) -> str:
        parts = [str(self.path)]
        if self.line is not None:
            parts.append(str(self.line))
            if self.column is not None:
                parts.append(str(self.column))
        return ":".join(parts)


@frozen
class Problem:
    """One thing to mend: lower case, no full stop, names in single quotes."""

    message: str
    place: Place | None = None
    hint: str | None = None

    def render(self, severity: str = "error") -> str:
        """Return the text a user reads: place, message, source line with caret, hint."""
        where = f"{self.place}: " if self.place else ""
        lines = [f"{where}{severity}: {self.message}"]
        if self.place and self.place.source is not None:
            source, column = _window(self.place.source, self.place.column)
            lines.append(f"    {source}")
            if column is not None:
                lines.append("    " + _caret_indent(source, column) + "^")
        if self.hint:
            lines.append(f"hint: {self.hint}")
        return "\n".join(lines).translate(_UNSEEN)


class ForgeError(Exception):
    """Problems that the user can mend; a stage raises all it found, not the first."""

    def __init__(self, *problems: Problem) -> None:
        """Carry at least one problem."""
        super().__init__("\n".join(problem.render() for problem in problems))
        self.problems = problems


class WorkspaceError(ForgeError):
    """The workspace, a manifest or an existing install does not allow the command."""


class SelectionError(ForgeError):
    """The command line names packages that cannot be selected."""


class InterfaceError(ForgeError):
    """An interface definition is wrong."""


class EnvironmentFault(ForgeError):  # noqa: N818  (EnvironmentError is a builtin's name)
    """The machine lacks something the command needs."""


def said_once(problems: Iterable[Problem]) -> list[Problem]:
    """Return the problems, of which those in a row that share a hint give it after the last of them."""
    found = list(problems)
    return [
        replace(problem, hint=None) if problem.hint == following.hint else problem
        for problem, following in pairwise(found)
    ] + found[-1:]


def raise_if_any(problems: Iterable[Problem], error: type[ForgeError] = ForgeError) -> None:
    """Raise `error` with the problems, unless there are none."""
    found = tuple(problems)
    if found:
        raise error(*found)


def _window(source: str, column: int | None) -> tuple[str, int | None]:
    """Return what is shown of a line, and the column in that: of a very long one the part that matters."""
    if len(source) <= _WIDEST:
        return source, column
    start = max(0, (column or 1) - _WIDEST // 2)
    shown = f"{'...' if start else ''}{source[start : start + _WIDEST]}..."
    return shown, None if column is None else column - start + (3 if start else 0)


def _caret_indent(source: str, column: int) -> str:
    """Return the blanks that put a caret under `column`; tabs stay tabs, so the columns agree."""
    return "".join("\t" if character == "\t" else " " for character in source[: column - 1])
