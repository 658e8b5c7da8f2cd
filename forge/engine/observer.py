"""Load the observer into the processes of steps; compile it on first use."""

from __future__ import annotations

import contextlib
import hashlib
import os
import subprocess
from pathlib import Path
from shutil import which
from typing import TYPE_CHECKING

from forge.engine.accesses import Accesses
from forge.engine.observation import LOG_VARIABLE, begin_log, end_log, observe, read_log

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from forge.engine.commands import Folders

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


def observed(variables: Mapping[str, str], library: Path | None, log: Path) -> dict[str, str]:
    """Return the environment that makes the library, if any, write to a log."""
    environment = {**variables, LOG_VARIABLE: str(log)}
    if library is not None:
        environment["LD_PRELOAD"] = " ".join(filter(None, (variables.get("LD_PRELOAD"), str(library))))
        # Otherwise, programs built with AddressSanitizer require that no library precedes theirs.
        options = (variables.get("ASAN_OPTIONS"), "verify_asan_link_order=0")
        environment["ASAN_OPTIONS"] = ":".join(filter(None, options))
    return environment


def run_observed(
    argv: Sequence[str],
    cwd: Path,
    variables: Mapping[str, str],
    library: Path | None,
    log: Path,
    folders: Folders,
) -> tuple[subprocess.CompletedProcess[bytes], Accesses]:
    """Run a program; return its result and its observed accesses, which are blind without a `library`."""
    if library is None:
        done = subprocess.run(
            argv, cwd=cwd, env=dict(variables), stdin=subprocess.DEVNULL, capture_output=True, check=False
        )
        return done, Accesses(blind=True)
    begin_log(log)
    with subprocess.Popen(
        argv,
        cwd=cwd,
        env=observed(variables, library, log),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        output, errors = process.communicate()
    step = read_log(log, frozenset({process.pid}))
    end_log(log)
    accesses = folders.accesses(observe(step.processes, step.blind), step.processes)
    return subprocess.CompletedProcess(argv, process.returncode, output, errors), accesses
