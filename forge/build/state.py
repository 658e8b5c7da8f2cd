"""The state of a workspace during a build: journal, file table and dependency hashes, kept consistent.

Owned by the build loop. Workers only request the record of the package that they have just built.
"""

from __future__ import annotations

import os
from dataclasses import replace
from typing import TYPE_CHECKING

from forge.base.files import remove_drafts
from forge.build.events import Finished, Fresh
from forge.build.inputs.fingerprints import (
    FileTable,
    contents_of,
    digest_of,
    digest_strings,
    file_manifest,
    fingerprint_files,
    fingerprint_tree,
    stamp_files,
    tree_manifest,
)
from forge.build.installed_states import InstalledStates
from forge.build.journal import open_journal
from forge.build.markers import workspace_scripts
from forge.build.model import BuildRecord
from forge.build.planning import decided_task
from forge.build.snapshot import find_changed_externals
from forge.build.up_to_date import UNKNOWN
from forge.environment.prefixes import PACKAGES, find_underlays
from forge.toolchain.programs import CMAKE_TYPES

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping
    from pathlib import Path

    from forge.base.errors import Problem
    from forge.base.frozen import Pairs
    from forge.base.layout import Layout
    from forge.build import build_dir
    from forge.build.build_notes import BegunBuild
    from forge.build.events import Event
    from forge.build.inputs.fingerprints import Stats
    from forge.build.journal import Journal
    from forge.build.model import CachedBuild, Snapshot
    from forge.build.tasks import BuildPlan, Task
    from forge.build.up_to_date import DependencyHashes
    from forge.toolchain.interpreter import Interpreter

TABLE = "forge_files.json"
_HOOKS = (".dsv", ".sh", ".bash", ".zsh", ".fish", ".ps1")


class Records:
    """The records of finished and running builds, and the dependency hashes derived from them."""

    def __init__(self, root: Path, layout: Layout, interpreter: Interpreter, journal: Journal) -> None:
        """Start with the journal of the workspace at `root`."""
        self.journal = journal
        self.table = FileTable(layout.build / TABLE)
        self._root = root
        self._layout = layout
        self._interpreter = interpreter
        self._hashes: DependencyHashes | None = None
        self._ran = False
        self._unfinished = not journal.ended
        self._shell_digests: dict[str, str] = {}
        """Packages whose contribution to the workspace's scripts may change, and its digest before."""
        self._begun_builds: dict[str, BegunBuild] = {}
        self._states = InstalledStates(layout.build)

    def confirm_up_to_date(self, plan: BuildPlan, snapshot: Snapshot, hashes: DependencyHashes) -> None:
        """Record the new stamps of the up-to-date packages, so that the next build compares equal."""
        self._hashes = hashes
        for name in plan.fresh:
            record = self.journal.records[name]
            now = replace(record, sources=snapshot.sources[name], installed=snapshot.installed[name])
            if now != record:
                self.journal.set_record(name, now)

    def recover(self) -> None:
        """Remove partially written files if the last build was killed."""
        if not self.journal.ended:
            remove_drafts(self._layout.install)

    def remove_embedded(self, names: Iterable[str]) -> None:
        """Remove the build results of embedded packages that the workspace or an underlay now provides.

        Otherwise they would be found before the real packages: by CMake in a merged install or through its
        cache, and by shells that source the workspace.
        """
        gone = sorted(self.journal.records.keys() & set(names))
        if not gone:
            return
        from forge.build.cleaning import package_removables, remove  # noqa: PLC0415  (only a change of underlays)

        for name in gone:
            remove(tuple(package_removables(name, self._layout, self.journal.records)))
            self.journal.forget(name)
            self._shell_digests[name] = ""
            self._ran = True

    def resolve(self, task: Task) -> Task | None:
        """Return the task with its final inputs, or None if none of its dependencies changed."""
        assert self._hashes is not None  # noqa: S101  (confirm() comes first)
        record = self.journal.records.get(task.name)
        reads_other = bool(task.after) and record is not None and self._reads_other(record)
        decided = decided_task(task, self._hashes, record, reads_other=reads_other)
        if decided is None or record is None or reads_other or not task.conditional:
            return decided
        from forge.build.relinking import links_the_same  # noqa: PLC0415  (most builds make nothing)

        needs = {need: self._installed(need) for need in task.needs}
        prefixes = [str(self._layout.prefix(need)) for need in task.needs]
        if not links_the_same(decided, record, needs, self._file_checks(task.build_dir), prefixes):
            return decided
        self.journal.set_record(task.name, replace(record, inputs=decided.inputs))
        return None

    def _file_checks(self, build: Path) -> build_dir.FileChecks:
        """Return the checks of files that a build folder was made from."""
        from forge.build.build_dir import FileChecks  # noqa: PLC0415  (most builds make nothing)
        from forge.build.inputs.depfiles import cmake_root  # noqa: PLC0415

        cmakes = cmake_root(build)
        return FileChecks(
            needed_changes=self._states.changes,
            links_alike=self._states.links_alike,
            contents=lambda paths: contents_of(paths, self.table),
            is_cmakes=lambda path: bool(cmakes) and path.startswith(cmakes),
        )

    def _reads_other(self, record: BuildRecord) -> bool:
        """Return True if the content of a file outside the package that its build read has changed."""
        return digest_of(record.externals, contents_of(record.externals, self.table)) != record.external

    def record_event(self, event: Event, plan: BuildPlan) -> None:
        """Record an event."""
        assert self._hashes is not None  # noqa: S101  (confirm() comes first)
        self.journal.record(event, plan)
        match event:
            case Fresh(name):
                self._hashes.finish(name)
            case Finished(name):
                self._ran = True
                if event.record is not None:
                    self._hashes.finish(name, event.record.installed.digest)
            case _:
                pass

    def record_trees(self, trees: Mapping[str, str]) -> None:
        """Record the tree digests of installed packages whose records have none yet."""
        for name, tree in trees.items():
            record = self.journal.records[name]
            if not record.tree:
                self.journal.set_record(name, replace(record, tree=tree))

    def begin(self, task: Task) -> None:
        """Record the installed state of a package before its build, to detect changes afterwards."""
        record = self.journal.records.get(task.name)
        files = record.files if record else ()
        self._shell_digests[task.name] = self._shell_digest(task.name, files, {})

    def prepare(self, task: Task, set_by_needs: Pairs, *, from_empty: bool = False) -> None:
        """Prepare a task's build folder, empty if `from_empty`.

        `set_by_needs` are the variables that environment hooks of its dependencies set.
        """
        from forge.build import build_dir, build_notes  # noqa: PLC0415  (most builds make nothing)

        source = self.source(task)
        sources = tree_manifest(str(source), self.table)
        build = task.build_dir
        # The cache key uses the sources as planned; they may have changed since.
        planned = fingerprint_tree(str(source), self.table, task.sources).digest == task.sources.digest
        last = build_notes.read_last(build)
        self._begun_builds[task.name] = build_notes.BegunBuild(str(source), sources, last, as_planned=planned)
        inputs = task.inputs
        pairs = map("=".join, (*inputs.tools, *inputs.environment, *set_by_needs))
        made_from = build_dir.BuildDirInputs(
            base=digest_strings(inputs.forge, os.path.realpath(source), *pairs),
            shape=digest_strings(*inputs.options, inputs.underlays),
            needs={need: self._installed(need) for need in task.needs},
            sources=sources,
        )
        can_reuse = task.package.build_type in CMAKE_TYPES and not from_empty
        build_dir.prepare_build_dir(
            build, made_from, self._file_checks(build), can_reuse=can_reuse, reconfigure=task.reconfigure
        )

    def seconds(self) -> dict[str, float]:
        """Return the duration of each package's last build in seconds."""
        return {name: record.seconds for name, record in self.journal.records.items() if record.seconds}

    def source(self, task: Task) -> Path:
        """Return the absolute source folder of a task's package."""
        return self._root / task.package.path

    def make_record(self, task: Task) -> BuildRecord:
        """Remove stale installed files and return the record of a successful task."""
        from forge.build import build_notes  # noqa: PLC0415  (most builds make nothing)
        from forge.build.inputs.depfiles import external_inputs  # noqa: PLC0415
        from forge.build.installation import installed_files  # noqa: PLC0415
        from forge.build.installed_files import set_file_times  # noqa: PLC0415

        build = task.build_dir
        files, folders = installed_files(task.package, self._layout)
        stats = set_file_times(task, files, self._layout, self.table)
        declared = (self.source(task), build, *map(self._layout.prefix, (task.name, *task.needs)))
        searched = (self._layout.install,)
        found = external_inputs(build, self.source(task), declared, searched)
        if self._layout.merged:
            found = (*found, *self._undeclared(task, build))
        externals = file_manifest(found, self.table)
        begun = self._begun_builds.pop(task.name)
        saved = build_notes.saved_during_build(build, begun, externals, self.table)
        build_notes.finish_build_dir(build, externals, saved)
        names = (path.removeprefix(f"{self.source(task)}/") for path in sorted(saved))
        contents = {path: state.content for path, state in externals.items()}
        read = tuple(externals), digest_of(externals, contents)
        record = self._finish_record(task, files, folders, read, stats)
        return replace(
            record,
            began=build_notes.start_time(build),
            saved=(*names, *(() if begun.as_planned else (str(task.package.path),))),
            from_empty=build_notes.started_empty(build),
            read_from=self._owners_of(task, externals),
        )

    def _undeclared(self, task: Task, build: Path) -> tuple[str, ...]:
        """Return the files of undeclared dependencies that a build read in a merged prefix."""
        from forge.build.inputs.depfiles import read_below  # noqa: PLC0415  (most builds make nothing)

        found = read_below(build, self._layout.install)
        if not found:
            return ()
        records = self.journal.records
        known = {path for name in (task.name, *task.needs) if name in records for path in records[name].files}
        return tuple(sorted(path for path in found if path not in known and os.path.isfile(path)))  # noqa: PTH113

    def _owners_of(self, task: Task, paths: Iterable[str]) -> tuple[str, ...]:
        """Return the other packages of this workspace that own some of `paths`."""
        build, install = f"{self._layout.build}/", f"{self._layout.install}/"
        names = {path[len(build) :].partition("/")[0] for path in paths if path.startswith(build)}
        installed = {path for path in paths if path.startswith(install)}
        if installed:
            records = self.journal.records.items()
            names |= {name for name, record in records if not installed.isdisjoint(record.files)}
        return tuple(sorted(names & self.journal.records.keys() - {task.name}))

    def restored_record(
        self,
        task: Task,
        found: CachedBuild,
        files: Mapping[str, os.stat_result | None],
        folders: tuple[str, ...],
    ) -> BuildRecord:
        """Return the record of a task restored from the cache.

        `files` are sorted and map to their stats, or to None if not just taken. The build folder is left
        untouched and does not belong to the record, so the next build of the package starts from empty.
        """
        from forge.build.installed_files import set_file_times  # noqa: PLC0415  (most builds make nothing)

        known = {path: status for path, status in files.items() if status is not None}
        stats = set_file_times(task, tuple(files), self._layout, self.table, known)
        record = self._finish_record(task, tuple(files), folders, (found.externals, found.external), stats)
        return replace(record, seconds=found.seconds, tree=found.tree)

    def _finish_record(
        self,
        task: Task,
        files: tuple[str, ...],
        folders: tuple[str, ...],
        read: tuple[tuple[str, ...], str],
        stats: Stats,
    ) -> BuildRecord:
        """Return the record; `read` are the external files and their digest, `stats` are of some `files`."""
        from forge.build.file_conflicts import record_contents  # noqa: PLC0415
        from forge.build.installed_files import remove_stale  # noqa: PLC0415  (most builds make nothing)

        remove_stale(task, files, self._layout, self.journal.records)
        if self._shell_digests[task.name] == self._shell_digest(task.name, files, stats):
            del self._shell_digests[task.name]
        if self._layout.merged:
            record_contents(task.build_dir, files, self.table)
        installed = fingerprint_files((*files, *folders), self.table, stats=stats)
        contents = contents_of((*files, *folders), self.table, stats)
        self._states.keep(task.name, installed.digest, contents)
        return BuildRecord(
            inputs=task.inputs,
            complete=True,
            sources=task.sources,
            installed=installed,
            files=files,
            folders=folders,
            externals=read[0],
            external=read[1],
        )

    def _installed(self, name: str) -> str:
        """Return the recorded digest of a package's installed files, or UNKNOWN."""
        record = self.journal.records.get(name)
        return record.installed.digest if record else UNKNOWN

    def finish(self, plan: BuildPlan, variables: Mapping[str, str]) -> None:
        """Write the workspace's scripts if they may have changed, and the stamps for the next build."""
        install = self._layout.install
        scripts = workspace_scripts(install)
        untouched = self.journal.scripts == stamp_files(scripts)
        if self._ran or plan.tasks or self._unfinished or not untouched:
            from forge.build.installation import finish_workspace  # noqa: PLC0415
            from forge.build.rollback import tidy  # noqa: PLC0415  (most builds change nothing)

            chain = find_underlays(variables, install).chain
            as_before = untouched and not self._shell_digests and not self._unfinished
            finish_workspace(self._layout, chain, self._interpreter.path, unchanged=as_before)
            tidy(self._layout)
            self.journal.end(ended=True)
            self.journal.note_scripts(stamp_files(scripts))
        if self._ran and self._layout.merged:
            self._refresh_overwritten_stamps(plan)
        if self._ran:
            self.journal.clear_stamp()
        if not self.journal.stamp:
            # Take the stamp first, so that the next build detects any later change.
            stamp = stamp_files(self.journal.externals)
            if not find_changed_externals(self.journal, self.table):
                self.journal.set_stamp(stamp)

    def shared(self, task: Task) -> frozenset[str]:
        """Return those files of a task in a merged prefix that other packages have installed, too."""
        if not task.earlier or not self._layout.merged:
            return frozenset()
        from forge.build.file_conflicts import owned_by_others  # noqa: PLC0415  (most trees are not merged)

        return owned_by_others(task.name, frozenset(task.earlier), self.journal.records)

    def restore_foreign_files(self, task: Task) -> None:
        """Move files that no build installed from the old prefix into the new one."""
        from forge.build.installed_files import restore_foreign_files  # noqa: PLC0415  (most builds make nothing)

        if not self._layout.merged:
            restore_foreign_files(task, self._layout, self.journal.records.get(task.name))

    def overwritten_packages(self, plan: BuildPlan) -> frozenset[str]:
        """Return the up-to-date packages that must be installed again because a task overwrites a file."""
        if not self._layout.merged or not plan.tasks:
            return frozenset()
        from forge.build.file_conflicts import packages_to_reinstall  # noqa: PLC0415  (most trees are not merged)

        return packages_to_reinstall(plan, self._layout, self.journal.records)

    def _refresh_overwritten_stamps(self, plan: BuildPlan) -> None:
        """Accept files that a later package has just overwritten as unchanged.

        The digest of the package remains that of its own files; only the stamp is updated.
        """
        from forge.build.file_conflicts import overwritten  # noqa: PLC0415  (most trees are not merged)

        for name in sorted(overwritten(plan, self._layout, self.journal.records)):
            record = self.journal.records[name]
            stamp = fingerprint_files((*record.files, *record.folders), self.table).stamp
            if stamp != record.installed.stamp:
                self.journal.set_record(
                    name, replace(record, installed=replace(record.installed, stamp=stamp))
                )

    def conflicts(self, names: Collection[str]) -> tuple[Problem, ...]:
        """Return a problem for each file that several packages install with different contents."""
        if not self._layout.merged:
            return ()
        from forge.build.file_conflicts import conflicts  # noqa: PLC0415  (most trees are not merged)

        return conflicts(self._layout, self.journal.records, names)

    def close(self) -> None:
        """Close the journal and save the file table."""
        self.journal.close()
        self.table.save()

    def _shell_digest(self, name: str, files: tuple[str, ...], stats: Stats) -> str:
        """Return a digest of a package's contribution to the workspace's scripts; '' without any files.

        The digested package.* scripts already reflect all hooks and existing folders.
        """
        prefix = self._layout.prefix(name)
        share, index = f"{prefix}/share/{name}/", str(prefix / PACKAGES / name)
        listed = [
            path for path in files if path == index or (path.startswith(share) and path.endswith(_HOOKS))
        ]
        return digest_of(listed, contents_of(listed, self.table, stats)) if listed else ""


def open_records(root: Path, layout: Layout, interpreter: Interpreter) -> Records:
    """Open the records below the build folder."""
    return Records(root, layout, interpreter, open_journal(layout.build))
