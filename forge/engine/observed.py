"""Information that an observed process passes to the observer.

A command that runs again begins without the files that it wrote before, as in an empty folder. A program with
a ledger does not need that: the ledger is a file that lets it recognize its own files, changed ones and
obsolete ones. As long as the ledger has the announced content, the files are kept.
"""

from __future__ import annotations

import hashlib
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from forge.engine.observation import LOG_VARIABLE

if TYPE_CHECKING:
    from collections.abc import Iterable
    from ctypes import CDLL


def observe_for(client: int) -> None:
    """Observe this process, which a server has forked, as a child of the process that it works for.

    The server must have loaded the observer, and neither started threads nor opened a log. Modules that it
    imported before count as read by this process.
    """
    library = _library()
    if library and library.forge_observe_for(client):
        modules = (getattr(module, "__file__", None) for module in [*sys.modules.values()])
        _say(library, "R", filter(None, modules))


def keep(ledger: Path, content: bytes, files: Iterable[str | Path] = ()) -> None:
    """Announce this program's ledger, and the `files` that it wrote earlier, which remain its outputs."""
    library = _library()
    if library:
        _say(library, "W", (*files, ledger))
        _say(library, "J", (f"{_digest(content)} {ledger.absolute()}",))


def is_intact(ledger: str) -> bool:
    """Return True if a ledger, given as digest and path, was not changed since it was announced."""
    digest, _, path = ledger.partition(" ")
    try:
        return _digest(Path(path).read_bytes()) == digest
    except OSError:
        return False


def _digest(content: bytes) -> str:
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def _library() -> CDLL | None:
    """Return the library of the observer if this process has loaded it and is to be observed."""
    if LOG_VARIABLE not in os.environ or "LD_PRELOAD" not in os.environ:
        return None
    import ctypes

    library = ctypes.CDLL(None)
    if not hasattr(library, "forge_observed"):
        return None
    library.forge_observe_for.argtypes = (ctypes.c_long,)
    library.forge_observed.argtypes = (ctypes.c_char, ctypes.c_char_p, ctypes.c_size_t)
    return library


def _say(library: CDLL, kind: str, words: Iterable[str | Path]) -> None:
    text = b"".join(b"%s\0" % os.fsencode(word) for word in words)
    library.forge_observed(kind.encode(), text, len(text))
