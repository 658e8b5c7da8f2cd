"""What is on disk before a build, beside the records of earlier ones."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge.digests import contents_of, digest_of, mark_files, mark_tree, stamp_files
from forge.model import Snapshot

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from forge.digests import FileTable
    from forge.journal import Journal
    from forge.layout import Layout
    from forge.model import Package

_GENERATOR = re.compile(rb"^CMAKE_GENERATOR:INTERNAL=(.*)$", re.MULTILINE)


def take_snapshot(
    root: Path, packages: Iterable[Package], layout: Layout, journal: Journal, table: FileTable
) -> Snapshot:
    """Look at the folders of `packages`, whose paths are below `root` unless they are absolute."""
    records = dict(journal.records)
    sources, installed, configured, news, present = {}, {}, {}, {}, set()
    for package in packages:
        name = package.name
        record = records.get(name)
        home = str(root / package.path)
        table.news.clear()
        sources[name] = mark_tree(home, table, record.sources if record else None)
        news[name] = tuple(path[len(home) + 1 :] for path in sorted(table.news))
        if record:
            installed[name] = mark_files(record.files, table, record.installed)
        if (layout.prefix(name) / "share" / name / "package.sh").is_file():
            present.add(name)
        state = _configured(layout.build_dir(name))
        if state:
            configured[name] = state
    return Snapshot(records, sources, installed, _moved(journal, table), configured, frozenset(present), news)


def _moved(journal: Journal, table: FileTable) -> dict[str, str]:
    """Return an external input that changed, by package.

    Packages share most of these files, so one stamp of them all answers the usual case.
    """
    paths = journal.externals
    table.news.clear()
    if journal.stamp and stamp_files(paths) == journal.stamp:
        return {}
    contents = contents_of(paths, table)
    moved: dict[str, str] = {}
    for name, record in journal.records.items():
        if record.complete and digest_of(record.externals, contents) != record.external:
            changed = [path for path in record.externals if path in table.news]
            moved[name] = changed[0] if changed else "a header outside the workspace"
    return moved


def _configured(build: Path) -> tuple[str, str] | None:
    """Return (generator, record) of a build folder that CMake configured completely."""
    try:
        cache = (build / "CMakeCache.txt").read_bytes()
    except OSError:
        return None
    match = _GENERATOR.search(cache)
    if match is None or not any((build / name).is_file() for name in ("build.ninja", "Makefile")):
        return (match.group(1).decode(errors="replace") if match else ""), ""
    try:
        record = (build / "handover" / "configured").read_text(encoding="utf-8")
    except OSError:
        record = ""
    return match.group(1).decode(errors="replace"), record
