"""How often builds found in the cache what they looked for, counted in the folder itself."""

from __future__ import annotations

import contextlib
import fcntl
import json
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


def count(folder: Path, counts: Counts) -> None:
    """Add what one build found; builds that end at the same time count one after the other."""
    if counts == Counts() or not folder.is_dir():
        return
    with (folder / ".lock").open("a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        before = counted(folder)
        now = {"restored": before.restored + counts.restored, "missed": before.missed + counts.missed}
        replace_file(folder / _FILE, json.dumps(now).encode())


def counted(folder: Path) -> Counts:
    """Return what all builds found together; nothing where nobody has counted."""
    with contextlib.suppress(OSError, ValueError, LookupError, TypeError, RecursionError):
        said = json.loads((folder / _FILE).read_bytes())
        return Counts(int(said["restored"]), int(said["missed"]))
    return Counts()
