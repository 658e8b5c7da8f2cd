"""Take a snapshot of the sources and installed files before a build."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from forge.base.extensions import OPTIONS, own_plugin
from forge.build.inputs.fingerprints import (
    FileTable,
    contents_of,
    digest_of,
    fingerprint_files,
    fingerprint_tree,
    stamp_inputs,
)
from forge.build.installed_lists import InstalledStates
from forge.build.model import Snapshot
from forge.build.up_to_date import UNKNOWN_EXTERNAL, InputChange, InputKind

if TYPE_CHECKING:
    from collections.abc import Collection
    from pathlib import Path

    from forge.base.layout import Layout
    from forge.build.journal import Journal
    from forge.build.records import FolderRecord
    from forge.workspace.model import Package


def take_snapshot(
    root: Path, packages: Collection[Package], layout: Layout, journal: Journal, table: FileTable
) -> Snapshot:
    """Return the state of `packages`, whose paths are relative to `root` unless they are absolute.

    The plugin `explain` names what has changed.
    """
    records = dict(journal.records)
    sources, installed, source_changes, installed_changes, present = {}, {}, {}, {}, set()
    changed_externals = find_changed_externals(journal, table)
    recent = tuple(path for path, before in table.changed_files.items() if before is not None)
    states = InstalledStates(layout.build)

    @cache
    def last_record(name: str) -> FolderRecord | None:
        """Return the record of the build folder, None if the package came from the cache."""
        from forge.build.records import read_record

        return read_record(layout.build_dir(name)) if records[name].began else None

    for package in packages:
        name = package.name
        record = records.get(name)
        home = str(root / package.path)
        sources[name], manifest = fingerprint_tree(home, table, record.sources if record else None)
        if record:
            if sources[name].digest != record.sources.digest and (naming := own_plugin(OPTIONS, "changes")):
                source_changes[name] = naming.changed_sources(home, manifest, last_record(name), table)
            paths = (*record.files, *record.folders)
            installed[name], _ = fingerprint_files(paths, table, record.installed)
            if installed[name].digest != record.installed.digest and (
                naming := own_plugin(OPTIONS, "changes")
            ):
                then = states.contents(name, record.installed.digest)
                of_sources = source_changes.get(name, "")
                installed_changes[name] = naming.changed_installed_files(
                    record, then, table, root, of_sources
                )
        if (layout.prefix(name) / "share" / name / "package.sh").is_file():
            present.add(name)
    externals = dict.fromkeys(changed_externals, InputChange(InputKind.OUTSIDE, UNKNOWN_EXTERNAL))
    if changed_externals and (naming := own_plugin(OPTIONS, "changes")):
        for name in changed_externals:
            last = last_record(name)
            externals[name] = naming.changed_external_files(last, records[name], table, root, recent)
    return Snapshot(
        records, sources, installed, externals, frozenset(present), source_changes, installed_changes
    )


def find_changed_externals(journal: Journal, table: FileTable) -> tuple[str, ...]:
    """Return the packages with a changed external input.

    Packages share most of these files, so a single stamp of all files covers the common case.
    """
    paths = journal.externals
    table.changed_files.clear()
    if journal.stamp and stamp_inputs(paths, table) == journal.stamp:
        return ()
    journal.stamp = ""
    contents = contents_of(paths, table)
    return tuple(
        name
        for name, record in journal.records.items()
        if record.external and digest_of(record.externals, contents) != record.external
    )
