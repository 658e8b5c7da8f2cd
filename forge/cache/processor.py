"""The processor as an input of builds that compile for the local processor, for example with `-march=native`.

Such builds are detected after they ran: the flags come from options, variables, CMake code, toolchain files
and targets of other packages, and all of them end up in the files that the build tool reads.
"""

from __future__ import annotations

import hashlib
import os
import re
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.files import open_regular, text_or_nothing

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from forge.build.tasks import Task

WORD = "@FORGE_PROCESSOR@"
"""Represents the processor among the external files of a build."""

_NATIVE = re.compile(rb"-m(?:arch|tune|cpu)=native|target-cpu=native|-xHost|/proc/cpuinfo|\blscpu\b")
"""Compiler flags for the local processor, and sources of its features that scripts read."""

_TOOL_FILES = frozenset({"build.ninja", "rules.ninja", "flags.make", "build.make", "link.txt"})
_SOURCES = re.compile(
    r"CMakeLists\.txt|setup\.(py|cfg)|pyproject\.toml|meson\.build|(GNUm|m|M)akefile|.*\.(cmake|mk)"
)
_TRAITS = frozenset(
    {
        *("vendor_id", "cpu family", "model", "model name", "stepping", "cache size", "flags"),
        *("CPU implementer", "CPU architecture", "CPU variant", "CPU part", "Features"),
        *("isa", "uarch", "machine", "cpu", "features", "CPU Family", "Model Name"),
    }
)
"""Relevant lines of /proc/cpuinfo on several architectures; other lines vary over time or between cores."""


def processor_inputs(task: Task, source: Path, values: Mapping[str, str]) -> tuple[str, ...]:
    """Return (WORD,) if the result of a task, built with these variables, may depend on this processor."""
    flags = (*task.inputs.options, *(values.get(name, "") for name, _ in task.inputs.environment))
    if _NATIVE.search("\n".join(flags).encode(errors="surrogateescape")):
        return (WORD,)
    files = chain(_files(task.build_dir, _TOOL_FILES.__contains__), _files(source, _SOURCES.fullmatch))
    return (WORD,) if any(map(_mentions, files)) else ()


def processor(text: str | None = None) -> str:
    """Return a digest of processor model and features in /proc/cpuinfo or `text`."""
    if text is None:
        text = text_or_nothing("/proc/cpuinfo")
    lines = {line.strip() for line in text.splitlines() if line.partition(":")[0].strip() in _TRAITS}
    return hashlib.sha256("\n".join(sorted(lines)).encode()).hexdigest()


def _files(folder: Path, wanted: Callable[[str], object]) -> Iterator[str]:
    """Yield the files below a folder with a wanted name; hidden folders are skipped."""
    for place, folders, names in os.walk(folder):
        folders[:] = (name for name in folders if not name.startswith("."))
        yield from (f"{place}/{name}" for name in names if wanted(name))


def _mentions(path: str) -> bool:
    """Return True if a file contains such a flag; False if it cannot be read."""
    try:
        with open(path, "rb", opener=open_regular) as stream:
            return _NATIVE.search(stream.read()) is not None
    except OSError:
        return False
