"""Errors and warnings for users, with position, message and hint.

The command line shows the problems of a ForgeError and exits with 2. `problem_from_oserror` converts the
OSErrors that are also for users. Any other exception is a bug in forge and is reported as such.
"""

from __future__ import annotations

import errno
import sys
from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Literal

from forge.base.colours import Palette, palette_of
from forge.base.frozen import frozen

Severity = Literal["error", "warning", "note"]

_PLAIN = Palette()

_INVISIBLE = {
    code: "\N{REPLACEMENT CHARACTER}"
    for codes in ((0, 9), (11, 32), (127, 160), (0x200E, 0x2010), (0x202A, 0x202F), (0x2066, 0x206A))
    for code in range(*codes)
}
"""Control characters and bidirectional marks, which quoted files may contain."""

_FEW = 3
"""The maximum number of problems of one kind that are reported one by one."""

_MAX_WIDTH = 200
"""Maximum number of characters of a quoted line."""

EXIT_INTERRUPTED = 130
"""The exit code after Ctrl-C; forge.cli.main defines the others."""

_DISK_FULL = "free some space, or choose other folders with '--build-base', '--install-base' and '--log-base'"
_NETWORK = "the file system's server does not answer; check the mount"
_FOR_WRITING = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EPERM})
_NOT_THERE = frozenset({errno.ENOENT, errno.ESTALE})
_OF_OUTPUT = frozenset({errno.EBADF, errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})
_HINTS = {
    errno.EACCES: "if another user created it, for example with sudo, change its owner or remove it",
    errno.EPERM: "if another user created it, for example with sudo, change its owner or remove it",
    errno.EROFS: "make it writable, or choose other folders with '--build-base' and '--install-base'",
    errno.ENOSPC: _DISK_FULL,
    errno.EDQUOT: _DISK_FULL,
    errno.EFBIG: "a limit on the size of files is set: 'ulimit -f' shows it",
    errno.EMFILE: "a limit on open files is set: 'ulimit -n 4096' raises it",
    errno.ENFILE: "too many files are open in the whole system",
    errno.EIO: "the disk may be faulty; check the system log",
    errno.EBUSY: "something is mounted there, or a program uses it: 'findmnt' lists mounts; unmount it first",
    errno.ENOTEMPTY: "another program is writing to it: stop it and try again",
    errno.ETXTBSY: "a running program uses it: stop it and try again",
    errno.EILSEQ: "the file system does not support this name",
    errno.EMLINK: "the file system does not support as many links to a file",
    errno.EOPNOTSUPP: "the file system does not support this operation; choose another one",
    **dict.fromkeys((errno.ETIMEDOUT, errno.ENOTCONN, errno.EREMOTEIO, errno.EHOSTDOWN), _NETWORK),
    errno.ENAMETOOLONG: "move the workspace to a shorter path",
    errno.EISDIR: "expected a file: move or remove the folder",
    errno.ELOOP: "symbolic links form a cycle: remove one of them",
}


@frozen
class Location:
    """A position in a file. Lines and columns count from 1; `source` is the complete line."""

    path: Path | str
    line: int | None = None
    column: int | None = None
    source: str | None = None

    def __str__(self) -> str:
        column = None if self.line is None else self.column
        return ":".join(str(part) for part in (self.path, self.line, column) if part is not None)


@frozen
class GroupedProblems:
    """The report that replaces many similar problems: in `message`, the names replace '{}'."""

    message: str
    name: str
    hint: str | None = None


@frozen
class Problem:
    """A problem the user can fix: lower case, no full stop, names in single quotes.

    With `group`, it is reported together with others of its kind if there are many.
    """

    message: str
    location: Location | None = None
    hint: str | None = None
    group: GroupedProblems | None = None

    @property
    def position(self) -> tuple[int, int]:
        """Line and column as a sort key; problems of a whole file come first."""
        place = self.location
        return (place.line or 0, place.column or 0) if place else (0, 0)

    def render(self, severity: Severity = "error", palette: Palette = _PLAIN) -> str:
        """Return the text for users: position, message, source line with caret, hint."""
        where = f"{self.location}: ".translate(_INVISIBLE) if self.location else ""
        lines = [f"{where}{palette.paint(severity, severity + ':')} {self.message.translate(_INVISIBLE)}"]
        if self.location and self.location.source is not None:
            source, column = self.location.source, self.location.column
            if len(source) > _MAX_WIDTH:
                start = max(0, (column or 1) - _MAX_WIDTH // 2)
                before = "..." if start else ""
                source = f"{before}{source[start : start + _MAX_WIDTH]}..."
                column = None if column is None else column - start + len(before)
            lines.append(f"    {source.translate(_INVISIBLE)}")
            if column is not None:
                indent = "".join("\t" if sign == "\t" else " " for sign in source[: column - 1])
                lines.append(f"    {indent}{palette.paint(severity, '^')}")
        if self.hint:
            lines.append(f"{palette.paint('hint', 'hint:')} {self.hint.translate(_INVISIBLE)}")
        return "\n".join(lines)


class ForgeError(Exception):
    """Problems the user can fix; a stage raises all problems it found, not only the first."""

    def __init__(self, *problems: Problem) -> None:
        super().__init__("\n".join(problem.render() for problem in problems))
        self.problems = problems


class WorkspaceError(ForgeError):
    """The workspace, a manifest or an existing install does not allow the command."""


class ForeignManifestError(WorkspaceError):
    """A package.xml is invalid, and its namespace says that it belongs to another tool."""


class SelectionError(ForgeError):
    """The command line names packages that cannot be selected."""


class InterfaceError(ForgeError):
    """An interface definition is wrong."""


class HostError(ForgeError):
    """The machine lacks something: a compiler, CMake, numpy, a writable folder."""


class NotRegularFileError(OSError):
    def __init__(self, path: str, reason: str) -> None:
        super().__init__(None, reason, path)


def joined(problems: Iterable[Problem]) -> list[Problem]:
    """Join many problems of one kind into one at the position of the first."""
    groups: dict[object, list[Problem]] = {}
    for problem in problems:
        kind = problem.group
        groups.setdefault((kind.message, kind.hint) if kind else problem, []).append(problem)
    result: list[Problem] = []
    for group in groups.values():
        kinds = [problem.group for problem in group if problem.group]
        names = sorted({kind.name for kind in kinds})
        if len(names) <= _FEW:  # each is reported with its location
            result += group
        else:
            quoted = ", ".join(f"'{name}'" for name in names)
            result.append(Problem(kinds[0].message.replace("{}", quoted, 1), hint=kinds[0].hint))
    return result


def share_hints(problems: Iterable[Problem]) -> list[Problem]:
    """Return the problems; consecutive ones with the same hint show it only after the last."""
    remaining = list(problems)
    return [
        replace(problem, hint=None) if problem.hint == following.hint else problem
        for problem, following in pairwise(remaining)
    ] + remaining[-1:]


def print_problem(problem: Problem, severity: Severity = "error") -> None:
    print(problem.render(severity, palette_of(sys.stderr)), file=sys.stderr)


class WarningReporter:
    """Prints warnings on stderr; watch mode does not repeat warnings of the previous build."""

    def __init__(self) -> None:
        self._current: set[str] = set()
        self._previous: set[str] = set()

    def __call__(self, problems: Iterable[Problem]) -> None:
        texts = {problem.render("warning"): problem for problem in problems}
        new_problems = joined(problem for text, problem in texts.items() if text not in self._previous)
        for problem in share_hints(new_problems):
            print_problem(problem, "warning")
        self._current.update(texts)

    def start_next_build(self) -> None:
        """Keep the warnings of this build, so that the next one does not repeat them."""
        self._previous, self._current = self._current, set()


def print_warnings(problems: Iterable[Problem]) -> None:
    WarningReporter()(problems)


def raise_if_any(problems: Iterable[Problem], error: type[ForgeError] = ForgeError) -> None:
    problems = tuple(problems)
    if problems:
        raise error(*problems)


def reason_of(error: OSError) -> str:
    return (error.strerror or str(error)).lower()


def problems_of(error: ForgeError | OSError) -> tuple[Problem, ...]:
    """Return the problems for the user; raises the error again if it is a bug in forge."""
    if isinstance(error, ForgeError):
        return error.problems
    problem = problem_from_oserror(error)
    if problem is None:
        raise error
    return (problem,)


def problem_from_oserror(error: OSError) -> Problem | None:
    """Return a problem for the user, or None for an error that is a bug in forge."""
    if isinstance(error, NotRegularFileError):
        return Problem(f"cannot read '{error.filename}': {error.strerror}")
    if error.errno == errno.ENOTDIR and error.filename:
        message = f"cannot read or write '{error.filename}': a file is in place of one of its folders"
        return Problem(message, hint="move that file, or let its package install it elsewhere")
    if error.errno in _NOT_THERE and error.filename:
        message = f"'{error.filename}' disappeared while forge was using it"
        return Problem(message, hint="another program may have removed or moved it; try again")
    reason = reason_of(error)
    if not error.filename and error.errno in _OF_OUTPUT:
        # Errors for other files contain the name.
        return Problem(f"cannot write to the standard output: {reason}")
    if error.errno not in _HINTS:
        return None
    # The error of a failed copy names the source first.
    path = (error.errno in _FOR_WRITING and error.filename2) or error.filename
    message = f"cannot read or write '{path or 'a file'}': {reason}"
    return Problem(message, hint=_HINTS[error.errno])
