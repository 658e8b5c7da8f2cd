"""Build folders: what their contents were made with, as they say themselves, and how they are made fit.

The journal says from what a package was made when its build ended well. A build that failed or was killed
may have left objects that were made from something else. So each folder has a note of its own, written
before the first step and after all that no longer fits was removed.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import time
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from forge.digests import RACY_NANOSECONDS, own_files
from forge.files import replace_file
from forge.freshness import traces_of
from forge.model import Folder, Traces

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from forge.layout import Layout
    from forge.model import Task

DESK = "handover"
NOTE = "begun.json"
CONFIGURED = "configured"
MANIFESTS = ("install_manifest.txt", "symlink_install_manifest.txt")
"""Where CMake, ament and forge itself list what they installed."""

_GENERATOR = re.compile(rb"^CMAKE_GENERATOR:INTERNAL=(.*)$", re.MULTILINE)


class Folders(Mapping[str, Folder]):
    """The build folders of a layout by package; each is looked at when it is asked for."""

    def __init__(self, layout: Layout) -> None:
        """Remember where they are."""
        self._layout = layout

    def __getitem__(self, name: str) -> Folder:
        """Look at the folder of a package; raises KeyError where there is none."""
        build = self._layout.build_dir(name)
        if not build.is_dir():
            raise KeyError(name)
        return Folder(*_configured(build), _traces(build), tuple(listed_files(build)), began(build))

    def __iter__(self) -> Iterator[str]:
        """Go through the packages that have one."""
        build = self._layout.build
        return (path.name for path in (build.iterdir() if build.is_dir() else ()) if path.is_dir())

    def __len__(self) -> int:
        """Count them."""
        return sum(1 for _ in self)


def begin(task: Task, source: Path) -> None:
    """Make the build folder of a task fit for its steps: remove what does not fit, wake what changed."""
    clear(task)
    note = _note(task.build_dir)
    for step in task.steps:
        if step.record:
            # What the folder was configured for counts no longer, now that the note says something else.
            step.record[0].unlink(missing_ok=True)
    now = time.time_ns()
    woken = _wake(source, note)
    traces = asdict(traces_of(task.parts, task.sources, task.moved))
    said = {"began": now, "woken": woken, "traces": traces}
    replace_file(task.build_dir / DESK / NOTE, json.dumps(said, indent=2).encode(errors="surrogateescape"))


def began(build: Path) -> float:
    """Return when the last build in a folder began, in seconds since the epoch; 0 when nobody knows."""
    said = _note(build).get("began")
    try:
        return said / 1e9 if isinstance(said, int) else 0.0
    except OverflowError:
        return 0.0


def clear(task: Task) -> None:
    """Remove what the tools of the task would wrongly build on."""
    trash = task.build_dir.with_name(f".{task.name}.old")
    for path in task.clean:
        if path == task.build_dir and path.is_dir() and not path.is_symlink():
            # At once, so that no one ever finds a part of it.
            shutil.rmtree(trash, ignore_errors=True)
            path.rename(trash)
            continue
        for found in path.parent.glob(path.name) if path.parent.is_dir() else ():
            if found.is_dir() and not found.is_symlink():
                shutil.rmtree(found)
            else:
                found.unlink()
    if trash.is_dir():
        shutil.rmtree(trash)


def listed_files(build: Path) -> Iterator[str]:
    """Yield the absolute paths that the tools list in a build folder as installed, once or more."""
    for name in MANIFESTS:
        with contextlib.suppress(OSError):
            text = (build / name).read_text(encoding="utf-8", errors="surrogateescape")
            yield from (os.path.normpath(line) for line in text.splitlines() if line)


def _wake(source: Path, note: Mapping[str, Any]) -> dict[str, int]:
    """Give the present time to files that changed since the last build began; return their new stamps.

    ninja and make compare times only: a file that was copied with its old time, or changed while the
    compiler had already read it, would never be compiled. The change of the inode's own time cannot be
    forged. A file that an earlier build woke is left alone, unless it changed after that.
    """
    since = note.get("began")
    if since is None:
        return {}
    known: Mapping[str, int] = note.get("woken", {})
    woken = {}
    for path, status in own_files(str(source)):
        if status.st_ctime_ns <= since - RACY_NANOSECONDS:
            continue
        with contextlib.suppress(FileNotFoundError):  # it has vanished since we looked
            if status.st_ctime_ns != known.get(path):
                os.utime(path, follow_symlinks=False)
            woken[path] = os.lstat(path).st_ctime_ns
    return woken


def _note(build: Path) -> Mapping[str, Any]:
    """Return what a folder's note says; nothing, when there is none that can be read."""
    try:
        said = json.loads((build / DESK / NOTE).read_bytes().decode(errors="surrogateescape"))
    except (OSError, ValueError, RecursionError):
        return {}
    return said if isinstance(said, dict) else {}


def _traces(build: Path) -> Traces | None:
    """Return what the contents were made with; None when forge has not built there."""
    if not (build / DESK).is_dir():
        return None
    try:
        return Traces(**_note(build)["traces"])
    except (LookupError, TypeError):
        return Traces()


def _configured(build: Path) -> tuple[str, str]:
    """Return the generator of a folder that CMake knows, and how it was configured completely."""
    try:
        cache = (build / "CMakeCache.txt").read_bytes()
    except OSError:
        return "", ""
    match = _GENERATOR.search(cache)
    generator = match.group(1).decode(errors="replace") if match else ""
    if not generator or not any((build / name).is_file() for name in ("build.ninja", "Makefile")):
        return generator, ""
    try:
        return generator, (build / DESK / CONFIGURED).read_text(encoding="utf-8")
    except OSError:
        return generator, ""
