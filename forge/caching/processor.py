"""The processor as an input of builds that compile for just this one, as `-march=native` does.

Which builds these are is known after they have run: flags come from options, variables, CMake code, toolchain
files and targets of other packages, and all of that ends in the files that the build tool reads.
"""

from __future__ import annotations

import hashlib
import os
import re
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from forge.files import open_regular

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from forge.model import Task

WORD = "@FORGE_PROCESSOR@"
"""What stands for the processor among the files that a build read."""

_NATIVE = re.compile(rb"-m(?:arch|tune|cpu)=native|target-cpu=native|-xHost|/proc/cpuinfo|\blscpu\b")
"""Flags of compilers that mean the processor at hand, and where scripts look for what it can do."""

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
"""Lines of /proc/cpuinfo on several architectures; the others change from moment to moment, or by number."""


def words_of(task: Task, source: Path) -> tuple[str, ...]:
    """Return WORD if what a task has built may hold for this processor alone, else nothing."""
    told = (*task.parts.options, *(value for _, value in task.parts.environment))
    if _NATIVE.search("\n".join(told).encode(errors="surrogateescape")):
        return (WORD,)
    files = chain(_files(task.build_dir, _TOOL_FILES.__contains__), _files(source, _SOURCES.fullmatch))
    return (WORD,) if any(map(_mentions, files)) else ()


def processor(text: str | None = None) -> str:
    """Return a digest of what /proc/cpuinfo, or `text`, says that the processors are and can do."""
    if text is None:
        text = _cpuinfo()
    lines = {line.strip() for line in text.splitlines() if line.partition(":")[0].strip() in _TRAITS}
    return hashlib.sha256("\n".join(sorted(lines)).encode()).hexdigest()


def _cpuinfo() -> str:
    try:
        return Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def _files(folder: Path, wanted: Callable[[str], object]) -> Iterator[str]:
    """Yield the files below a folder that have a wanted name; hidden folders are not entered."""
    for place, folders, names in os.walk(folder):
        folders[:] = (name for name in folders if not name.startswith("."))
        yield from (f"{place}/{name}" for name in names if wanted(name))


def _mentions(path: str) -> bool:
    """Tell if a file has such a flag in it; one that cannot be read any more has none."""
    try:
        with open(path, "rb", opener=open_regular) as stream:
            return _NATIVE.search(stream.read()) is not None
    except OSError:
        return False
