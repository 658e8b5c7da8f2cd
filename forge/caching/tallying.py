"""How often builds found in the cache what they looked for, counted in the folder itself."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
from functools import partial
from typing import TYPE_CHECKING

from forge.files import replace_file
from forge.frozen import frozen

if TYPE_CHECKING:
    from pathlib import Path

_FILE = "counts.json"


@frozen
class Counts:
    """Packages that came from the cache, and packages that were looked for and had to be built."""

    restored: int = 0
    missed: int = 0


def count(folder: Path, counts: Counts, rights: int) -> None:
    """Add what one build found; builds that end at the same time count one after the other.

    `rights` are those of what is kept in the folder.
    """
    if counts == Counts() or not folder.is_dir():
        return
    mode = rights & 0o666
    with open(folder / ".lock", "a", opener=partial(os.open, mode=mode)) as lock:
        with contextlib.suppress(PermissionError):  # of somebody else of the group
            os.fchmod(lock.fileno(), mode)
        fcntl.flock(lock, fcntl.LOCK_EX)
        before = counted(folder)
        now = {"restored": before.restored + counts.restored, "missed": before.missed + counts.missed}
        replace_file(folder / _FILE, json.dumps(now).encode(), mode=mode)


def counted(folder: Path) -> Counts:
    """Return what all builds found together; nothing where nobody has counted."""
    with contextlib.suppress(OSError, ValueError, LookupError, TypeError, RecursionError):
        said = json.loads((folder / _FILE).read_bytes())
        return Counts(int(said["restored"]), int(said["missed"]))
    return Counts()
