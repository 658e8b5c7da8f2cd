"""Load the observer into the processes of steps; compile it on first use."""

from __future__ import annotations

import contextlib
import hashlib
import os
import subprocess
from pathlib import Path
from shutil import which
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

_SOURCE = Path(__file__).with_name("observer.c")
_COMPILERS = ("cc", "gcc", "clang", "g++", "clang++")
_SECONDS = 60


def compile_library(folder: Path, variables: Mapping[str, str]) -> Path | None:
    """Return the observer's library in a folder, or None if it cannot be compiled or named in LD_PRELOAD."""
    name = hashlib.sha256(_SOURCE.read_bytes()).hexdigest()[:16]
    library = folder / f"observer-{name}.so"
    if any(character in str(library) for character in " :\t\n"):
        return None
    if library.is_file():
        return library
    compiler = next(filter(None, (which(name, path=variables.get("PATH")) for name in _COMPILERS)), None)
    if compiler is None:
        return None
    draft = library.with_name(f".{name}.{os.urandom(4).hex()}.so")
    flags = ("-x", "c", "-std=gnu11", "-O1", "-shared", "-fPIC", "-fvisibility=hidden")
    argv = (compiler, *flags, "-o", str(draft), str(_SOURCE), "-ldl", "-lpthread")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        subprocess.run(
            argv, check=True, capture_output=True, stdin=subprocess.DEVNULL, timeout=_SECONDS, env=variables
        )
        draft.replace(library)
    except (OSError, subprocess.SubprocessError):
        with contextlib.suppress(OSError):
            draft.unlink()
        return None
    return library
