"""What a system refuses for reasons that only its user can mend: from an OSError to a Problem."""

from __future__ import annotations

import errno

from forge.errors import Problem

_FULL = "free some space, or choose other folders with '--build-base', '--install-base' and '--log-base'"
_VANISHED = frozenset({errno.ENOENT, errno.ENOTDIR, errno.ESTALE})
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
    errno.ELOOP: "links lead in a circle: remove one",
}


def refusal(error: OSError) -> Problem | None:
    """Return what to tell the user, or None for an error that is a fault of ours."""
    if error.errno in _VANISHED and error.filename:
        message = f"'{error.filename}' vanished while it was needed"
        return Problem(message, hint="was it removed or moved meanwhile? try again when nobody does that")
    if error.errno not in _HINTS:
        return None
    reason = (error.strerror or str(error)).lower()
    message = f"cannot read or write '{error.filename or 'a file'}': {reason}"
    return Problem(message, hint=_HINTS[error.errno])
