"""Observe what the steps of a package write into its prefix.

A small C library is loaded into the processes of a step (LD_PRELOAD) and logs the files that they write below
the prefix; `forge.build.observed_writes` reads the log. It is compiled once, when it is first needed. Without
a compiler nothing is observed, and `forge.build.prefix` decides by the install manifests alone.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import subprocess
from pathlib import Path
from shutil import which
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.build.build_types import build_type_of
from forge.build.observed_writes import (
    LINKS_VARIABLE,
    LOG_VARIABLE,
    PREFIX_VARIABLE,
    REAL_PREFIX_VARIABLE,
    append,
)
from forge.build.prefix import guarded_links, written_log

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from forge.base.layout import Layout
    from forge.build.tasks import Task

_SOURCE = Path(__file__).with_name("observer.c")
_COMPILERS = ("cc", "gcc", "clang", "g++", "clang++")
_SECONDS = 60


@frozen
class Observer:
    """Sets the variables by which the steps of tasks are observed; without a `library`, only forge's do."""

    layout: Layout
    library: Path | None

    def variables(self, task: Task, variables: Mapping[str, str]) -> Mapping[str, str]:
        """Return the environment of a step with the variables added."""
        found = {
            **variables,
            LOG_VARIABLE: str(written_log(task.name, self.layout)),
            LINKS_VARIABLE: str(guarded_links(task.name, self.layout)),
            PREFIX_VARIABLE: str(task.prefix),
            REAL_PREFIX_VARIABLE: os.path.realpath(task.prefix),
        }
        if self.library is not None and is_observed(task):
            found["LD_PRELOAD"] = " ".join(filter(None, (variables.get("LD_PRELOAD"), str(self.library))))
            # A program built with AddressSanitizer otherwise requires that no library precedes its own.
            options = (variables.get("ASAN_OPTIONS"), "verify_asan_link_order=0")
            found["ASAN_OPTIONS"] = ":".join(filter(None, options))
        return found

    def note_process(self, variables: Mapping[str, str], process: int) -> None:
        """Log the start of a step, which counts as loaded if its program can be observed."""
        if self.library is not None and str(self.library) in variables.get("LD_PRELOAD", ""):
            append(variables[LOG_VARIABLE], b"P%d" % process)


def is_observed(task: Task) -> bool:
    """Return True unless forge itself installs the files of the package, and thus knows them."""
    return not build_type_of(task.package).staged


def open_observer(
    tasks: Iterable[Task], layout: Layout, folder: Path, variables: Mapping[str, str]
) -> Observer:
    """Return the observer of a build; compile its library into `folder` if a task needs it.

    Programs for another machine cannot load it.
    """
    if layout.target or not any(map(is_observed, tasks)):
        return Observer(layout, None)
    return Observer(layout, _library(folder, variables))


def _library(folder: Path, variables: Mapping[str, str]) -> Path | None:
    """Return the compiled library, or None if it cannot be compiled or named in LD_PRELOAD."""
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
    argv = (compiler, "-x", "c", "-O2", "-shared", "-fPIC", "-o", str(draft), str(_SOURCE), "-ldl")
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
