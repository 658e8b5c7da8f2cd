"""Count cache hits and misses in a file of the store."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
from functools import partial
from typing import TYPE_CHECKING

from forge.base.files import replace_file
from forge.base.frozen import frozen

if TYPE_CHECKING:
    from pathlib import Path

_FILE = "counts.json"


@frozen
class Counts:
    """The number of packages restored from the cache, and of misses."""

    restored: int = 0
    missed: int = 0


def add_counts(folder: Path, counts: Counts, rights: int) -> None:
    """Add the counts of one build, under a lock against concurrent builds.

    `rights` are the permissions of files in the store.
    """
    if counts == Counts() or not folder.is_dir():
        return
    mode = rights & 0o666
    with open(folder / ".lock", "a", opener=partial(os.open, mode=mode)) as lock:
        with contextlib.suppress(PermissionError):  # owned by another user of the group
            os.fchmod(lock.fileno(), mode)
        fcntl.flock(lock, fcntl.LOCK_EX)
        before = read_counts(folder)
        now = {"restored": before.restored + counts.restored, "missed": before.missed + counts.missed}
        replace_file(folder / _FILE, json.dumps(now).encode(), mode=mode)


def read_counts(folder: Path) -> Counts:
    """Return the total counts of all builds; zero if there are none."""
    with contextlib.suppress(OSError, ValueError, LookupError, TypeError, RecursionError):
        data = json.loads((folder / _FILE).read_bytes())
        return Counts(int(data["restored"]), int(data["missed"]))
    return Counts()
