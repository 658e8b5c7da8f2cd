"""What is on disk before a build, beside the records of earlier ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.digests import NAMES_IN, contents_of, digest_of, mark_files, mark_tree, stamp_files
from forge.folders import ListedFiles
from forge.model import Snapshot

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from forge.digests import FileTable
    from forge.journal import Journal
    from forge.layout import Layout
    from forge.model import Package


def take_snapshot(
    root: Path, packages: Iterable[Package], layout: Layout, journal: Journal, table: FileTable
) -> Snapshot:
    """Look at the folders of `packages`, whose paths are below `root` unless they are absolute."""
    records = dict(journal.records)
    sources, installed, news, present = {}, {}, {}, set()
    moved = moved_externals(journal, table)
    for package in packages:
        name = package.name
        record = records.get(name)
        home = str(root / package.path)
        table.news.clear()
        sources[name] = mark_tree(home, table, record.sources if record else None)
        news[name] = tuple(path[len(home) + 1 :] for path in sorted(table.news))
        if record:
            installed[name] = mark_files((*record.files, *record.folders), table, record.installed)
        if (layout.prefix(name) / "share" / name / "package.sh").is_file():
            present.add(name)
    return Snapshot(records, sources, installed, moved, ListedFiles(layout), frozenset(present), news)


def moved_externals(journal: Journal, table: FileTable) -> dict[str, str]:
    """Return an external input that changed, by package.

    Packages share most of these files, so one stamp of them all answers the usual case.
    """
    paths = journal.externals
    table.news.clear()
    if journal.stamp and stamp_files(paths) == journal.stamp:
        return {}
    journal.doubt()
    contents = contents_of(paths, table)
    moved: dict[str, str] = {}
    for name, record in journal.records.items():
        digest = digest_of(record.externals, contents)
        if record.external and digest != record.external:
            changed = [path for path in record.externals if path in table.news]
            moved[name] = (changed[0] if changed else "a file outside the workspace").removesuffix(NAMES_IN)
    return moved
