"""What a system refuses for reasons that only its user can mend: from an OSError to a Problem."""

from __future__ import annotations

import errno

from forge.errors import Problem
from forge.files import UnfitFileError

_FULL = "free some space, or choose other folders with '--build-base', '--install-base' and '--log-base'"
_VANISHED = frozenset({errno.ENOENT, errno.ENOTDIR, errno.ESTALE})
_OF_OUTPUT = frozenset({errno.EBADF, errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})
_HINTS = {
    errno.EACCES: "was it made by another user, as with sudo? make it yours, or remove it",
    errno.EPERM: "was it made by another user, as with sudo? make it yours, or remove it",
    errno.EROFS: "make it writable, or choose other folders with '--build-base' and '--install-base'",
    errno.ENOSPC: _FULL,
    errno.EDQUOT: _FULL,
    errno.EFBIG: "a limit on the size of files is set: 'ulimit -f' shows it",
    errno.EMFILE: "a limit on open files is set: 'ulimit -n 4096' raises it",
    errno.ENFILE: "the whole system has too many files open",
    errno.EIO: "the disk, or what stands for it, has a fault: the system's log may say more",
    errno.ENAMETOOLONG: "let the workspace have a shorter path",
    errno.EISDIR: "a file is expected there: move the folder away, or remove it",
    errno.ELOOP: "links lead in a circle: remove one",
}


def refusal(error: OSError) -> Problem | None:
    """Return what to tell the user, or None for an error that is a fault of ours."""
    if isinstance(error, UnfitFileError):
        return Problem(f"cannot read '{error.filename}': {error.strerror}")
    if error.errno in _VANISHED and error.filename:
        message = f"'{error.filename}' vanished while it was needed"
        return Problem(message, hint="was it removed or moved meanwhile? try again when nobody does that")
    reason = (error.strerror or str(error)).lower()
    if not error.filename and error.errno in _OF_OUTPUT:
        # Every other file is named where it is written.
        return Problem(f"cannot write to the standard output: {reason}")
    if error.errno not in _HINTS:
        return None
    message = f"cannot read or write '{error.filename or 'a file'}': {reason}"
    return Problem(message, hint=_HINTS[error.errno])
