"""Take a snapshot of the sources and installed files before a build."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from forge.build.change_texts import (
    changed_external_files,
    changed_installed_files,
    changed_sources,
    recently_changed,
)
from forge.build.inputs.fingerprints import (
    contents_of,
    digest_of,
    fingerprint_files,
    fingerprint_tree,
    stamp_inputs,
)
from forge.build.install_manifests import ManifestFiles, installed_links
from forge.build.installed_states import InstalledStates
from forge.build.model import Snapshot
from forge.build.records import read_record

if TYPE_CHECKING:
    from collections.abc import Collection, Container
    from pathlib import Path

    from forge.base.layout import Layout
    from forge.build.inputs.fingerprints import FileTable
    from forge.build.journal import Journal
    from forge.build.records import FolderRecord
    from forge.workspace.model import Package


def take_snapshot(
    root: Path, packages: Collection[Package], layout: Layout, journal: Journal, table: FileTable
) -> Snapshot:
    """Return the state of `packages`, whose paths are relative to `root` unless they are absolute."""
    records = dict(journal.records)
    sources, manifests, installed, source_changes, installed_changes, present = {}, {}, {}, {}, {}, set()
    changed_externals = find_changed_externals(journal, table)
    recent = recently_changed(table)
    states = InstalledStates(layout.build)

    def last_record(name: str) -> FolderRecord | None:
        """Return what the build folder was made from, None if the package came from the cache."""
        return read_record(layout.build_dir(name)) if records[name].began else None

    for package in packages:
        name = package.name
        record = records.get(name)
        home = str(root / package.path)
        sources[name], manifest = fingerprint_tree(home, table, record.sources if record else None)
        if manifest:
            manifests[name] = manifest
        if record:
            if sources[name].digest != record.sources.digest:
                source_changes[name] = changed_sources(home, manifest, last_record(name), table)
            installed[name] = fingerprint_files((*record.files, *record.folders), table, record.installed)
            if installed[name].digest != record.installed.digest:
                then = states.contents(name, record.installed.digest)
                of_sources = source_changes.get(name, "")
                installed_changes[name] = changed_installed_files(record, then, table, root, of_sources)
        if (layout.prefix(name) / "share" / name / "package.sh").is_file():
            present.add(name)
    listed = ManifestFiles(layout, _unrecorded_links(root, packages, layout, records))
    externals = {
        name: changed_external_files(last_record(name), records[name], table, root, recent)
        for name in changed_externals
    }
    return Snapshot(
        records,
        sources,
        installed,
        externals,
        listed,
        frozenset(present),
        source_changes,
        installed_changes,
        manifests,
    )


def _unrecorded_links(
    root: Path, packages: Collection[Package], layout: Layout, records: Container[str]
) -> dict[str, tuple[str, ...]]:
    """Return the installed links of packages without a record; in an isolated prefix all files are theirs."""
    if not layout.merged or not layout.symlink or all(package.name in records for package in packages):
        return {}
    homes: dict[str, str] = {}
    for package in packages:
        for home in (root / package.path, layout.build_dir(package.name)):
            homes |= dict.fromkeys((str(home), os.path.realpath(home)), package.name)
    links = installed_links(layout.install, homes)
    return {name: paths for name, paths in links.items() if name not in records}


def find_changed_externals(journal: Journal, table: FileTable) -> tuple[str, ...]:
    """Return the packages with a changed external input.

    Packages share most of these files, so a single stamp of all files covers the common case.
    """
    paths = journal.externals
    table.changed_files.clear()
    if journal.stamp and stamp_inputs(paths, table) == journal.stamp:
        return ()
    journal.clear_stamp()
    contents = contents_of(paths, table)
    return tuple(
        name
        for name, record in journal.records.items()
        if record.external and digest_of(record.externals, contents) != record.external
    )
