"""Verify all files of a store and remove corrupt ones."""

from __future__ import annotations

import contextlib
import hashlib
import re
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.cache.action_result import decode
from forge.cache.pruning import scan_store

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from forge.cache.folder_store import FolderStore
    from forge.cache.pruning import StoreContents

_DRAFT = re.compile(r"\..*\.forge-draft")


@frozen
class VerifyResult:
    """The number and size of files read, and the removed files with reasons."""

    files: int
    size: int
    corrupt: tuple[tuple[Path, str], ...]


def verify(store: FolderStore) -> VerifyResult:
    """Read every file of a store; remove corrupt blobs, unreadable results and results with missing blobs."""
    contents = scan_store(store)
    corrupt = list(_corrupt_blobs(contents))
    blobs = contents.blobs.keys() - {path.name for path, _ in corrupt}
    faults = ((file.path, _fault_of_result(file.path, blobs)) for file in contents.results)
    corrupt += [(path, why) for path, why in faults if why]
    for path, _ in corrupt:
        path.unlink(missing_ok=True)
    return VerifyResult(len(contents.results) + len(contents.blobs), contents.size, tuple(corrupt))


def _corrupt_blobs(contents: StoreContents) -> Iterator[tuple[Path, str]]:
    for name, file in contents.blobs.items():
        if _DRAFT.fullmatch(name):
            continue  # of a running or killed build; pruning removes it by age
        with contextlib.suppress(FileNotFoundError), file.path.open("rb") as stream:
            found = hashlib.sha256()
            while chunk := stream.read(1 << 20):
                found.update(chunk)
            if found.hexdigest() != name:
                yield file.path, "its content does not match its SHA-256"


def _fault_of_result(path: Path, blobs: set[str]) -> str:
    try:
        result = decode(path.read_bytes())
    except FileNotFoundError:
        return ""
    except ValueError as error:
        return f"it cannot be read: {error}"
    return "" if {file.digest.hash for file in result.files} <= blobs else "one of its blobs is missing"
