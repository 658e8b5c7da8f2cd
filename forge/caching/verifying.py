"""Reading a whole store: what is not what its name says is of no use, and goes."""

from __future__ import annotations

import contextlib
import hashlib
import re
from typing import TYPE_CHECKING

from forge.caching.action_result import decode
from forge.caching.pruning import look
from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from forge.caching.folder_store import FolderStore
    from forge.caching.pruning import Shelf

_DRAFT = re.compile(r"\..*\.forge-draft")


@frozen
class Verified:
    """How much was read, and what was removed, each with the reason."""

    files: int
    size: int
    spoilt: tuple[tuple[Path, str], ...]


def verify(store: FolderStore) -> Verified:
    """Read every file of a store; remove spoilt blobs, results that cannot be read, or lead to nothing."""
    shelf = look(store)
    spoilt = list(_spoilt_blobs(shelf))
    blobs = shelf.blobs.keys() - {path.name for path, _ in spoilt}
    faults = ((kept.path, _fault_of_result(kept.path, blobs)) for kept in shelf.results)
    spoilt += [(path, why) for path, why in faults if why]
    for path, _ in spoilt:
        path.unlink(missing_ok=True)
    return Verified(len(shelf.results) + len(shelf.blobs), shelf.size, tuple(spoilt))


def _spoilt_blobs(shelf: Shelf) -> Iterator[tuple[Path, str]]:
    for name, kept in shelf.blobs.items():
        if _DRAFT.fullmatch(name):
            continue  # of a build at work, or one that was killed: pruning knows by its age
        with contextlib.suppress(FileNotFoundError), kept.path.open("rb") as stream:
            found = hashlib.sha256()
            while chunk := stream.read(1 << 20):
                found.update(chunk)
            if found.hexdigest() != name:
                yield kept.path, "its bytes are not those that its name says"


def _fault_of_result(path: Path, blobs: set[str]) -> str:
    try:
        result = decode(path.read_bytes())
    except FileNotFoundError:
        return ""
    except ValueError as error:
        return f"it cannot be read: {error}"
    return "" if {file.digest.hash for file in result.files} <= blobs else "a blob that it leads to is gone"
