"""The records of a workspace while it is built: journal, file table and outlook, kept in step.

Owned by the loop of the command; workers only ask for the record of what they have just made.
"""

from __future__ import annotations

import os
from dataclasses import replace
from typing import TYPE_CHECKING

from forge.build.installed_states import InstalledStates
from forge.digests import (
    FileTable,
    contents_of,
    digest_of,
    digest_words,
    file_manifest,
    mark_files,
    mark_tree,
    stamp_files,
    tree_manifest,
)
from forge.files import remove_drafts
from forge.freshness import UNKNOWN
from forge.journal import open_journal
from forge.model import Finished, Fresh, Record
from forge.planning import settled
from forge.prefixes import PACKAGES, find_underlays
from forge.results import workspace_scripts
from forge.snapshot import moved_externals
from forge.tools import CMAKE_TYPES

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping
    from pathlib import Path

    from forge.build.build_notes import BegunBuild
    from forge.caching.package_cache import Found
    from forge.digests import Stats
    from forge.errors import Problem
    from forge.freshness import Outlook
    from forge.interpreter import Interpreter
    from forge.journal import Journal
    from forge.layout import Layout
    from forge.model import BuildPlan, Event, Pairs, Snapshot, Task

TABLE = "forge_files.json"
_HOOKS = (".dsv", ".sh", ".bash", ".zsh", ".fish", ".ps1")


class Records:
    """What was built, what is being built, and what the rest may count on."""

    def __init__(self, root: Path, layout: Layout, interpreter: Interpreter, journal: Journal) -> None:
        """Begin with what the journal remembers of the workspace at `root`."""
        self.journal = journal
        self.table = FileTable(layout.build / TABLE)
        self._root = root
        self._layout = layout
        self._interpreter = interpreter
        self._outlook: Outlook | None = None
        self._ran = False
        self._unfinished = not journal.ended
        self._altered: dict[str, str] = {}
        """Packages whose part in the workspace's scripts may differ from now on, and what that was."""
        self._begun: dict[str, BegunBuild] = {}
        self._states = InstalledStates(layout.build)

    def confirm(self, plan: BuildPlan, snapshot: Snapshot, outlook: Outlook) -> None:
        """Take note of what the plan found fresh: new stamps, so that next time they are equal."""
        self._outlook = outlook
        for name in plan.fresh:
            record = self.journal.records[name]
            now = replace(record, sources=snapshot.sources[name], installed=snapshot.installed[name])
            if now != record:
                self.journal.remember(name, now)

    def recover(self) -> None:
        """Remove half-written files if the last build was killed."""
        if not self.journal.ended:
            remove_drafts(self._layout.install)

    def retire(self, names: Iterable[str]) -> None:
        """Remove what was built of embedded packages that have stepped aside.

        They would be found before the real ones: by CMake in a merged install and where its cache names
        them, by shells that source the workspace.
        """
        gone = sorted(self.journal.records.keys() & set(names))
        if not gone:
            return
        from forge.cleaning import litter_of_package, remove  # noqa: PLC0415  (only a change of underlays)

        for name in gone:
            remove(tuple(litter_of_package(name, self._layout, self.journal.records)))
            self.journal.forget(name)
            self._altered[name] = ""
            self._ran = True

    def settle(self, task: Task) -> Task | None:
        """Return the task as it is to run, or None when what it needs came out as before."""
        assert self._outlook is not None  # noqa: S101  (confirm() comes first)
        record = self.journal.records.get(task.name)
        reads_other = bool(task.after) and record is not None and self._reads_other(record)
        return settled(task, self._outlook, record, reads_other=reads_other)

    def _reads_other(self, record: Record) -> bool:
        """Tell if a file outside of the package that its build read says something else now."""
        return digest_of(record.externals, contents_of(record.externals, self.table)) != record.external

    def take(self, event: Event, plan: BuildPlan) -> None:
        """Take note of an event."""
        assert self._outlook is not None  # noqa: S101  (confirm() comes first)
        self.journal.record(event, plan)
        match event:
            case Fresh(name):
                self._outlook.settle(name)
            case Finished(name):
                self._ran = True
                if event.record is not None:
                    self._outlook.settle(name, event.record.installed.digest)
            case _:
                pass

    def learn_trees(self, trees: Mapping[str, str]) -> None:
        """Take note of what installed packages come to for the cache, where no record had said so."""
        for name, tree in trees.items():
            record = self.journal.records[name]
            if not record.tree:
                self.journal.remember(name, replace(record, tree=tree))

    def begin(self, task: Task) -> None:
        """Look at what is installed of a package now, so that afterwards it shows what is different."""
        record = self.journal.records.get(task.name)
        files = record.files if record else ()
        self._altered[task.name] = self._said_to_shells(task.name, files, {})

    def prepare(self, task: Task, set_by_needs: Pairs, *, anew: bool = False) -> None:
        """Make a task's build folder fit for its steps, or empty if `anew`; hooks set `set_by_needs`."""
        from forge.build import build_dir, build_notes  # noqa: PLC0415  (most builds make nothing)
        from forge.externals import cmake_root  # noqa: PLC0415

        source = self.source(task)
        sources = tree_manifest(str(source), self.table)
        build = task.build_dir
        # The plan is older, and the cache knows a package by the sources that the plan saw.
        planned = mark_tree(str(source), self.table, task.sources).digest == task.sources.digest
        last = build_notes.read_last(build)
        self._begun[task.name] = build_notes.BegunBuild(str(source), sources, last, as_planned=planned)
        parts = task.parts
        pairs = map("=".join, (*parts.tools, *parts.environment, *set_by_needs))
        inputs = build_dir.BuildInputs(
            base=digest_words(parts.forge, os.path.realpath(source), *pairs),
            shape=digest_words(*parts.options, parts.underlays),
            needs={need: self._installed(need) for need in task.needs},
            sources=sources,
        )
        cmakes = cmake_root(build)
        examination = build_dir.Examination(
            needed=self._states.changes,
            contents=lambda paths: contents_of(paths, self.table),
            is_cmakes=lambda path: bool(cmakes) and path.startswith(cmakes),
        )
        keeps = task.package.build_type in CMAKE_TYPES and not anew
        build_dir.prepare_build_dir(build, inputs, examination, keeps=keeps, reconfigure=task.reconfigure)

    def seconds(self) -> dict[str, float]:
        """Return how long each package took when it was last built."""
        return {name: record.seconds for name, record in self.journal.records.items() if record.seconds}

    def source(self, task: Task) -> Path:
        """Return the absolute folder of a task's package."""
        return self._root / task.package.path

    def make(self, task: Task) -> Record:
        """Return the record of a task that ended well, once what only its last build installed is gone."""
        from forge.build import build_notes  # noqa: PLC0415  (most builds make nothing)
        from forge.build.installed_files import date_files  # noqa: PLC0415
        from forge.externals import external_inputs  # noqa: PLC0415
        from forge.installation import installed_files  # noqa: PLC0415

        build = task.build_dir
        files, folders = installed_files(task.package, self._layout)
        stats = date_files(task, files, self._layout, self.table)
        declared = (self.source(task), build, *map(self._layout.prefix, (task.name, *task.needs)))
        searched = (self._layout.install,)
        found = external_inputs(build, self.source(task), declared, searched)
        if self._layout.merged:
            found = (*found, *self._undeclared(task, build))
        externals = file_manifest(found, self.table)
        begun = self._begun.pop(task.name)
        saved = build_notes.saved_meanwhile(build, begun, externals, self.table)
        build_notes.finish_build_dir(build, externals, saved)
        names = (path.removeprefix(f"{self.source(task)}/") for path in sorted(saved))
        contents = {path: state.content for path, state in externals.items()}
        read = tuple(externals), digest_of(externals, contents)
        record = self._made(task, files, folders, read, stats)
        return replace(
            record,
            began=build_notes.began(build),
            saved=(*names, *(() if begun.as_planned else (str(task.package.path),))),
            from_empty=build_notes.began_empty(build),
            read_from=self._owners_of(task, externals),
        )

    def _undeclared(self, task: Task, build: Path) -> tuple[str, ...]:
        """Return what a build read in a merged prefix of packages that it does not declare to need."""
        from forge.externals import read_below  # noqa: PLC0415  (most builds make nothing)

        found = read_below(build, self._layout.install)
        if not found:
            return ()
        records = self.journal.records
        known = {path for name in (task.name, *task.needs) if name in records for path in records[name].files}
        return tuple(sorted(path for path in found if path not in known and os.path.isfile(path)))  # noqa: PTH113

    def _owners_of(self, task: Task, paths: Iterable[str]) -> tuple[str, ...]:
        """Return the packages of this workspace, without the declared needs, to which files belong."""
        build, install = f"{self._layout.build}/", f"{self._layout.install}/"
        names = {path[len(build) :].partition("/")[0] for path in paths if path.startswith(build)}
        installed = {path for path in paths if path.startswith(install)}
        if installed:
            records = self.journal.records.items()
            names |= {name for name, record in records if not installed.isdisjoint(record.files)}
        return tuple(sorted(names & self.journal.records.keys() - {task.name}))

    def restored(
        self,
        task: Task,
        found: Found,
        files: Mapping[str, os.stat_result | None],
        folders: tuple[str, ...],
    ) -> Record:
        """Return the record of a task whose files came out of the cache, its build folder left as it is.

        They are sorted, each with its stat if it has one just taken.
        The record says of no build folder that it belongs to it: the next build of the package begins anew.
        """
        from forge.build.installed_files import date_files  # noqa: PLC0415  (most builds make nothing)

        known = {path: status for path, status in files.items() if status is not None}
        stats = date_files(task, tuple(files), self._layout, self.table, known)
        record = self._made(task, tuple(files), folders, (found.externals, found.external), stats)
        return replace(record, seconds=found.tree.seconds, tree=found.tree.digest)

    def _made(
        self,
        task: Task,
        files: tuple[str, ...],
        folders: tuple[str, ...],
        read: tuple[tuple[str, ...], str],
        stats: Stats,
    ) -> Record:
        """Return the record; `read` are the external files and what they say, `stats` of some of `files`."""
        from forge.build.installed_files import remove_stale  # noqa: PLC0415  (most builds make nothing)
        from forge.ownership import note_contents  # noqa: PLC0415

        remove_stale(task, files, self._layout, self.journal.records)
        if self._altered[task.name] == self._said_to_shells(task.name, files, stats):
            del self._altered[task.name]
        if self._layout.merged:
            note_contents(task.build_dir, files, self.table)
        installed = mark_files((*files, *folders), self.table, stats=stats)
        contents = contents_of((*files, *folders), self.table, stats)
        self._states.keep(task.name, installed.digest, contents)
        return Record(
            parts=task.parts,
            complete=True,
            sources=task.sources,
            installed=installed,
            files=files,
            folders=folders,
            externals=read[0],
            external=read[1],
        )

    def _installed(self, name: str) -> str:
        """Return the digest of what a package has installed, as far as that is recorded."""
        record = self.journal.records.get(name)
        return record.installed.digest if record else UNKNOWN

    def finish(self, plan: BuildPlan, variables: Mapping[str, str]) -> None:
        """Write the workspace's scripts if anything may have changed, and what the next build reads first."""
        install = self._layout.install
        scripts = workspace_scripts(install)
        untouched = self.journal.scripts == stamp_files(scripts)
        if self._ran or plan.tasks or self._unfinished or not untouched:
            from forge.fallback import tidy  # noqa: PLC0415  (most builds change nothing)
            from forge.installation import finish_workspace  # noqa: PLC0415

            chain = find_underlays(variables, install).chain
            as_before = untouched and not self._altered and not self._unfinished
            finish_workspace(self._layout, chain, self._interpreter.path, as_before=as_before)
            tidy(self._layout)
            self.journal.end(ended=True)
            self.journal.note_scripts(stamp_files(scripts))
        if self._ran and self._layout.merged:
            self._accept_other_contents(plan)
        if self._ran:
            self.journal.doubt()
        if not self.journal.stamp:
            # First the stamp: what changes after it will show the next time.
            stamp = stamp_files(self.journal.externals)
            if not moved_externals(self.journal, self.table):
                self.journal.agree(stamp)

    def shared(self, task: Task) -> frozenset[str]:
        """Return what other packages have installed, too, of all that a task had in a shared prefix."""
        if not task.earlier or not self._layout.merged:
            return frozenset()
        from forge.ownership import owned_by_others  # noqa: PLC0415  (most trees are not merged)

        return owned_by_others(task.name, frozenset(task.earlier), self.journal.records)

    def carry_over(self, task: Task) -> None:
        """Put back into a prefix what was there and no build had installed."""
        from forge.build.installed_files import carry_over  # noqa: PLC0415  (most builds make nothing)

        if not self._layout.merged:
            carry_over(task, self._layout, self.journal.records.get(task.name))

    def rivals(self, plan: BuildPlan) -> frozenset[str]:
        """Return the fresh packages of a plan that must be installed again, since a file is written over."""
        if not self._layout.merged or not plan.tasks:
            return frozenset()
        from forge.ownership import rivals  # noqa: PLC0415  (most trees are not merged)

        return rivals(plan, self._layout, self.journal.records)

    def _accept_other_contents(self, plan: BuildPlan) -> None:
        """Let a file count as unchanged where a later package has just written over it.

        What the package gives to others stays what it installed itself; only the stamp is another.
        """
        from forge.ownership import overwritten  # noqa: PLC0415  (most trees are not merged)

        for name in sorted(overwritten(plan, self._layout, self.journal.records)):
            record = self.journal.records[name]
            stamp = mark_files((*record.files, *record.folders), self.table).stamp
            if stamp != record.installed.stamp:
                self.journal.remember(name, replace(record, installed=replace(record.installed, stamp=stamp)))

    def clashes(self, names: Collection[str]) -> tuple[Problem, ...]:
        """Return what any of the packages and others install into one prefix, with different contents."""
        if not self._layout.merged:
            return ()
        from forge.ownership import clashes  # noqa: PLC0415  (most trees are not merged)

        return clashes(self._layout, self.journal.records, names)

    def close(self) -> None:
        """Write what is still to be written."""
        self.journal.close()
        self.table.save()

    def _said_to_shells(self, name: str, files: tuple[str, ...], stats: Stats) -> str:
        """Return a digest of what a package adds to the workspace's scripts; empty for one without files.

        Its own package.* scripts are among these files and are made from the same edits, hooks from elsewhere
        and folders that appeared included.
        """
        prefix = self._layout.prefix(name)
        share, index = f"{prefix}/share/{name}/", str(prefix / PACKAGES / name)
        told = [path for path in files if path == index or (path.startswith(share) and path.endswith(_HOOKS))]
        return digest_of(told, contents_of(told, self.table, stats)) if told else ""


def open_records(root: Path, layout: Layout, interpreter: Interpreter) -> Records:
    """Return the records below the build folder."""
    return Records(root, layout, interpreter, open_journal(layout.build))
