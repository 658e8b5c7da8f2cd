"""Take a snapshot of the sources and installed files before a build."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from forge.build.inputs.fingerprints import (
    DIR_LISTING_SUFFIX,
    contents_of,
    digest_of,
    fingerprint_files,
    fingerprint_tree,
    stamp_files,
)
from forge.build.install_manifests import ManifestFiles, installed_links
from forge.build.model import Snapshot

if TYPE_CHECKING:
    from collections.abc import Collection, Container
    from pathlib import Path

    from forge.base.layout import Layout
    from forge.build.inputs.fingerprints import FileTable
    from forge.build.journal import Journal
    from forge.workspace.model import Package


def take_snapshot(
    root: Path, packages: Collection[Package], layout: Layout, journal: Journal, table: FileTable
) -> Snapshot:
    """Return the state of `packages`, whose paths are relative to `root` unless they are absolute."""
    records = dict(journal.records)
    sources, installed, changed_files, present = {}, {}, {}, set()
    changed_externals = find_changed_externals(journal, table)
    changed_before = tuple(table.changed_files)  # also sources, which other packages read
    for package in packages:
        name = package.name
        record = records.get(name)
        home = str(root / package.path)
        table.changed_files.clear()
        sources[name] = fingerprint_tree(home, table, record.sources if record else None)
        changed = {*table.changed_files, *(path for path in changed_before if path.startswith(f"{home}/"))}
        changed_files[name] = tuple(path[len(home) + 1 :] for path in sorted(changed))
        if record:
            installed[name] = fingerprint_files((*record.files, *record.folders), table, record.installed)
        if (layout.prefix(name) / "share" / name / "package.sh").is_file():
            present.add(name)
    listed = ManifestFiles(layout, _unrecorded_links(root, packages, layout, records))
    return Snapshot(records, sources, installed, changed_externals, listed, frozenset(present), changed_files)


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


def find_changed_externals(journal: Journal, table: FileTable) -> dict[str, str]:
    """Return one changed external input for each affected package.

    Packages share most of these files, so a single stamp of all files covers the common case.
    """
    paths = journal.externals
    table.changed_files.clear()
    if journal.stamp and stamp_files(paths) == journal.stamp:
        return {}
    journal.clear_stamp()
    contents = contents_of(paths, table)
    changed_externals: dict[str, str] = {}
    for name, record in journal.records.items():
        digest = digest_of(record.externals, contents)
        if record.external and digest != record.external:
            changed = [path for path in record.externals if path in table.changed_files]
            changed_externals[name] = (
                changed[0] if changed else "a file outside the workspace"
            ).removesuffix(DIR_LISTING_SUFFIX)
    return changed_externals
