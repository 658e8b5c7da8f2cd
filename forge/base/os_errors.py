"""Converts an OSError that the user has to fix into a Problem."""

from __future__ import annotations

import errno

from forge.base.errors import Problem
from forge.base.files import UnfitFileError

_FULL = "free some space, or choose other folders with '--build-base', '--install-base' and '--log-base'"
_VANISHED = frozenset({errno.ENOENT, errno.ENOTDIR, errno.ESTALE})
_OF_OUTPUT = frozenset({errno.EBADF, errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})
_HINTS = {
    errno.EACCES: "if another user created it, for example with sudo, change its owner or remove it",
    errno.EPERM: "if another user created it, for example with sudo, change its owner or remove it",
    errno.EROFS: "make it writable, or choose other folders with '--build-base' and '--install-base'",
    errno.ENOSPC: _FULL,
    errno.EDQUOT: _FULL,
    errno.EFBIG: "a limit on the size of files is set: 'ulimit -f' shows it",
    errno.EMFILE: "a limit on open files is set: 'ulimit -n 4096' raises it",
    errno.ENFILE: "too many files are open in the whole system",
    errno.EIO: "the disk may be faulty; check the system log",
    errno.ENAMETOOLONG: "move the workspace to a shorter path",
    errno.EISDIR: "expected a file: move or remove the folder",
    errno.ELOOP: "symbolic links form a cycle: remove one of them",
}


def refusal(error: OSError) -> Problem | None:
    """Return a problem for the user, or None for an error that is a bug in forge."""
    if isinstance(error, UnfitFileError):
        return Problem(f"cannot read '{error.filename}': {error.strerror}")
    if error.errno in _VANISHED and error.filename:
        message = f"'{error.filename}' vanished while it was in use"
        return Problem(message, hint="it may have been removed or moved meanwhile; try again")
    reason = (error.strerror or str(error)).lower()
    if not error.filename and error.errno in _OF_OUTPUT:
        # Errors of other files contain their name.
        return Problem(f"cannot write to the standard output: {reason}")
    if error.errno not in _HINTS:
        return None
    message = f"cannot read or write '{error.filename or 'a file'}': {reason}"
    return Problem(message, hint=_HINTS[error.errno])
