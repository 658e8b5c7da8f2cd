"""Update installed files after a build: restore times, remove stale files."""

from __future__ import annotations

import contextlib
import os
import stat
from pathlib import Path
from typing import TYPE_CHECKING

from forge.build.file_conflicts import owned_by_others
from forge.build.inputs.fingerprints import content_digest
from forge.build.installed_lists import package_markers
from forge.build.prefix import PrefixExchange, remove_empty_folders

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.base.layout import Layout
    from forge.build.inputs.fingerprints import FileTable, Stats
    from forge.build.model import BuildRecord
    from forge.build.tasks import Task


def set_file_times(
    task: Task, files: tuple[str, ...], layout: Layout, table: FileTable, known: Stats | None = None
) -> Stats:
    """Restore the times of unchanged installed files, and set a new time on changed ones.

    Build tools only compare times: users of an unchanged header must not be recompiled. CMake truncates
    copied times to seconds, so a header that changed soon after a compilation would look older than the
    object. Files from the cache have new times; `known` are stats of some. Return the stats of regular files.
    The package's own script gets its time last: later files were not installed by a build.
    """
    before = PrefixExchange(task.name, layout).moved_files()
    marker = package_markers(task.name, layout)[0]
    found = dict(known or {})
    dated = files if known is None or before else ()
    for path in (*(path for path in dated if path != marker), marker):
        with contextlib.suppress(FileNotFoundError):  # listed, but removed by the package's own code
            status = found.get(path) or os.lstat(path)
            if stat.S_ISREG(status.st_mode):
                old_digest = _old_digest(path, status, *before[path], table) if path in before else ""
                digest = table.digest(path, status)
                if old_digest == digest:
                    os.utime(path, ns=(status.st_atime_ns, before[path][1].st_mtime_ns))
                elif known is None or path == marker:
                    os.utime(path)
                found[path] = os.lstat(path)
                table.learn(path, found[path], digest)
    return found


def remove_stale(
    task: Task, files: tuple[str, ...], layout: Layout, records: Mapping[str, BuildRecord]
) -> None:
    """Remove files that a package no longer installs, unless another package does.

    Those in its own prefix were moved aside before the build: whatever is there now was written by another
    package or by somebody else.
    """
    stale = PrefixExchange(task.name, layout).copied_files().intersection(task.earlier).difference(files)
    left = frozenset(path for path in stale if os.path.islink(path) or os.path.isfile(path))  # noqa: PTH113, PTH114
    if not left:
        return
    for path in sorted(left - owned_by_others(task.name, left, records), reverse=True):
        if Path(path).is_relative_to(layout.install):
            os.unlink(path)  # noqa: PTH108  (each installed file)
            remove_empty_folders(path, str(layout.install))


def _old_digest(path: str, now: os.stat_result, kept: str, then: os.stat_result, table: FileTable) -> str:
    """Return the previous content digest of a file, or '' if size or mode differ."""
    if (now.st_size, now.st_mode) != (then.st_size, then.st_mode):
        return ""
    return table.known(path, then) or content_digest(kept)
