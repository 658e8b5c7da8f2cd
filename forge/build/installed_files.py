"""What a build has just installed, compared with what was installed before: times, leftovers, other files."""

from __future__ import annotations

import contextlib
import os
import stat
import time
from pathlib import Path
from typing import TYPE_CHECKING

from forge.digests import RACY_NANOSECONDS, content_digest
from forge.fallback import bring_back, earlier_files
from forge.installation import markers
from forge.ownership import owned_by_others
from forge.results import remove_file

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.digests import FileTable, Stats
    from forge.layout import Layout
    from forge.model import Record, Task


def date_files(
    task: Task, files: tuple[str, ...], layout: Layout, table: FileTable, known: Stats | None = None
) -> Stats:
    """Let installed files that say what they said before keep their time, and give others a new one.

    Build tools compare times only: what uses an unchanged header is not to be compiled again. CMake copies
    times cut to the second, so a header that changed soon after something was compiled with it would look
    older than the object. Files out of the cache are new, and `known` are stats of some. Return the stats of
    regular files. The package's own script is dated last: what changes after it, no build has made.
    """
    before = earlier_files(task.name, layout)
    marker = markers(task.name, layout)[0]
    found = dict(known or {})
    dated = files if known is None or before else ()
    for path in (*(path for path in dated if path != marker), marker):
        with contextlib.suppress(FileNotFoundError):  # it was listed, and removed by code of the package
            status = found.get(path) or os.lstat(path)
            if stat.S_ISREG(status.st_mode):
                said = _said_before(path, status, *before[path], table) if path in before else ""
                digest = table.digest(path, status)
                if said == digest:
                    os.utime(path, ns=(status.st_atime_ns, before[path][1].st_mtime_ns))
                elif known is None or path == marker:
                    os.utime(path)
                found[path] = os.lstat(path)
                table.learn(path, found[path], digest)
    return found


def carry_over(task: Task, layout: Layout, record: Record | None) -> None:
    """Put back into a prefix what was there and no build had installed.

    Without a `record` of what the last build installed, that is what appeared after it.
    """
    before = earlier_files(task.name, layout)
    after = 0
    if not (record and record.files):
        marker = before.get(markers(task.name, layout)[0])
        after = marker[1].st_ctime_ns if marker else 0
    others = before.keys() - set(task.earlier)
    theirs = [path for path in others if before[path][1].st_ctime_ns > after]
    if theirs:
        # Their times must tell, too, that they came after what the build has just made.
        time.sleep(RACY_NANOSECONDS / 1e9)
        bring_back(task.name, layout, theirs)


def remove_stale(task: Task, files: tuple[str, ...], layout: Layout, records: Mapping[str, Record]) -> None:
    """Remove files that a package no longer installs, unless another package does."""
    stale = set(task.earlier).difference(files)
    left = frozenset(path for path in stale if os.path.islink(path) or os.path.isfile(path))  # noqa: PTH113, PTH114
    if not left:
        return
    for path in sorted(left - owned_by_others(task.name, left, records), reverse=True):
        if Path(path).is_relative_to(layout.install):
            remove_file(Path(path), layout.install)


def _said_before(path: str, now: os.stat_result, kept: str, then: os.stat_result, table: FileTable) -> str:
    """Return the content digest that a file had before, '' if size or mode tell that it was another."""
    if (now.st_size, now.st_mode) != (then.st_size, then.st_mode):
        return ""
    return table.known(path, then) or content_digest(kept)
