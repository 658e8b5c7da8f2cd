"""The state of a workspace during a build: journal, file table, dependency hashes and setup scripts.

Owned by the build loop. Worker threads only read it, through forge.execution.task_setup.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from forge.base.distributions import VARIABLE
from forge.base.extensions import OPTIONS, own_plugin
from forge.base.files import remove_drafts
from forge.base.layout import FILE_TABLE, Layout
from forge.build.events import Event, Finished, Fresh
from forge.build.file_conflicts import MergedPrefix
from forge.build.folder_marks import workspace_scripts
from forge.build.inputs.fingerprints import FileTable, contents_of, digest_of, stamp_files, stamp_inputs
from forge.build.installed_lists import InstalledStates
from forge.build.journal import Journal, open_journal
from forge.build.snapshot import find_changed_externals
from forge.build.up_to_date import UNKNOWN, DependencyHashes, changed_input
from forge.engine.world import World
from forge.environment.install_state import recorded_overlays, recorded_state
from forge.environment.prefixes import PACKAGES, find_underlays

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from forge.build.model import Snapshot
    from forge.build.tasks import BuildPlan, Task
    from forge.toolchain.interpreter import Interpreter


_HOOKS = (".dsv", ".sh", ".bash", ".zsh", ".fish")


class WorkspaceScripts:
    """The setup scripts of the workspace, and the packages whose contribution may have changed."""

    def __init__(self, layout: Layout, journal: Journal, table: FileTable) -> None:
        """Start without changes, except those of a killed build."""
        self._layout = layout
        self._journal = journal
        self._table = table
        self._unfinished = not journal.ended
        self._changing: dict[str, str] = {}
        """Packages whose contribution may change, with the previous digest."""

    def begin(self, name: str, files: tuple[str, ...]) -> None:
        """Note the contribution of a package with these installed `files` before it is built."""
        self._changing[name] = self._digest(name, files)

    def end(self, name: str, files: tuple[str, ...]) -> None:
        """Compare the contribution of a package after its build."""
        if self._changing[name] == self._digest(name, files):
            del self._changing[name]

    def remove(self, name: str) -> None:
        self._changing[name] = ""

    def write(self, python: Path, variables: Mapping[str, str], *, built: bool) -> None:
        """Write the scripts if they may have changed; `built` is True if this build built anything."""
        install = self._layout.install
        scripts = workspace_scripts(install)
        untouched = self._journal.scripts == stamp_files(scripts)
        is_recorded = recorded_state(install).rosdistro == variables[VARIABLE] and not recorded_overlays(
            install
        )
        if not built and untouched and is_recorded and not self._unfinished:
            return
        from forge.build.installation import finish_workspace
        from forge.build.prefix import tidy

        chain = find_underlays(variables, install).chain
        unchanged = untouched and not self._changing and not self._unfinished
        finish_workspace(self._layout, chain, python, variables[VARIABLE], unchanged=unchanged)
        tidy(self._layout)
        self._journal.note("ended", True)
        self._journal.note("scripts", stamp_files(scripts))

    def _digest(self, name: str, files: tuple[str, ...]) -> str:
        """Return a digest of a package's contribution to the workspace's scripts; '' if it has no files.

        The digested package.* scripts already reflect all hooks and existing folders.
        """
        prefix = self._layout.prefix(name)
        share, index = f"{prefix}/share/{name}/", f"{prefix}/{PACKAGES}/{name}"
        listed = [
            path for path in files if path == index or (path.startswith(share) and path.endswith(_HOOKS))
        ]
        return digest_of(listed, contents_of(listed, self._table)) if listed else ""


class BuildState:
    """The records of finished and running builds, and the dependency hashes derived from them."""

    def __init__(
        self, root: Path, layout: Layout, interpreter: Interpreter, variables: Mapping[str, str]
    ) -> None:
        """Open the state of the workspace at `root`; `variables` is the environment of builds."""
        self.layout = layout
        self.journal = open_journal(layout.build)
        self.world = World(variables)
        self.table = FileTable(layout.build / FILE_TABLE, self.world.answer)
        self.installed_states = InstalledStates(layout.build)
        self.merged_prefix = MergedPrefix(layout, self.journal)
        self.scripts = WorkspaceScripts(layout, self.journal, self.table)
        self.root = root
        self._interpreter = interpreter
        self._hashes: DependencyHashes | None = None
        self._ran = False
        self.is_final = True
        """False after a build in which a package has overwritten a file that belongs to a later one."""

    def confirm_up_to_date(self, plan: BuildPlan, snapshot: Snapshot, hashes: DependencyHashes) -> None:
        """Record the new stamps of the up-to-date packages, so that they match in the next build."""
        self._hashes = hashes
        for name in plan.fresh:
            record = self.journal.records[name]
            now = replace(record, sources=snapshot.sources[name], installed=snapshot.installed[name])
            if now != record:
                self.journal.set_record(name, now)

    def begin(self) -> None:
        """Back up unowned files in a merged prefix, which a package could overwrite."""
        if self.layout.merged:
            from forge.build.prefix import copy_others_of_merged

            records = self.journal.records.values()
            owned = (path.rstrip("/") for record in records for path in (*record.files, *record.folders))
            copy_others_of_merged(self.layout, owned)

    def recover(self) -> None:
        """Remove partially written files if the last build was killed."""
        if not self.journal.ended:
            remove_drafts(self.layout.install)

    def remove_embedded(self, names: Iterable[str]) -> None:
        """Remove the build results of embedded packages that the workspace or an underlay now provides.

        Otherwise they would be found before the real packages: by CMake in a merged install or through its
        cache, and by shells that source the workspace.
        """
        gone = sorted(self.journal.records.keys() & set(names))
        if not gone:
            return
        from forge.build.cleaning import package_removables, remove, restore_backups

        restore_backups(self.layout, gone)
        for name in gone:
            remove(tuple(package_removables(name, self.layout, self.journal.records)))
            self.journal.forget(name)
            self.scripts.remove(name)
            self._ran = True

    def resolve(self, task: Task) -> Task | None:
        """Return the task with its final inputs, or None if none of its dependencies changed."""
        assert self._hashes is not None
        record = self.journal.records.get(task.name)
        # It may have read a file of a package that it does not declare as a dependency.
        reads_other = bool(task.after) and record is not None
        if reads_other and record is not None:
            contents = contents_of(record.externals, self.table)
            reads_other = digest_of(record.externals, contents) != record.external
        decided = replace(
            task, inputs=replace(task.inputs, needs=self._hashes.needs_of(task.name, task.needs) or ())
        )
        if record is None or reads_other or not task.conditional:
            return decided
        if changed_input(decided.inputs, record.inputs) is None:
            return None
        plugin, records = own_plugin(OPTIONS, "library-abi"), self.journal.records
        needs = {need: records[need].installed.digest if need in records else UNKNOWN for need in task.needs}
        if not plugin or not plugin.relinking_is_redundant(decided, record, needs, self.installed_states):
            return decided
        self.journal.set_record(task.name, replace(record, inputs=decided.inputs))
        return None

    def record_event(self, event: Event, plan: BuildPlan) -> None:
        assert self._hashes is not None
        self.journal.record(event, plan)
        self.merged_prefix.note(event)
        match event:
            case Fresh(name):
                self._hashes.finish(name)
            case Finished(name):
                self._ran = True
                if event.record is not None:
                    self._hashes.finish(name, event.record.installed.digest)
            case _:
                pass

    def seconds(self) -> dict[str, float]:
        """Return the duration of each last build."""
        return {name: record.seconds for name, record in self.journal.records.items() if record.seconds}

    def source(self, task: Task) -> Path:
        return self.root / task.package.path

    def finish(self, plan: BuildPlan, variables: Mapping[str, str]) -> None:
        """Write the workspace's scripts if they may have changed, and the stamps for the next build."""
        if self.layout.merged and plan.tasks:
            from forge.build.prefix import drop_others_of_merged

            drop_others_of_merged(self.layout)
        self.scripts.write(self._interpreter.path, variables, built=self._ran or bool(plan.tasks))
        if self._ran:
            self.is_final = not self.merged_prefix.refresh_stamps(plan, self.table)
            self.journal.stamp = ""
        if not self.journal.stamp:
            # Take the stamp first, so that the next build detects any later change.
            stamp = stamp_inputs(self.journal.externals, self.table)
            if not find_changed_externals(self.journal, self.table):
                self.journal.note("stamp", stamp)

    def close(self) -> None:
        """Close the journal and save the file table; a dry run may have no folder for them."""
        self.journal.close()
        if self.layout.build.is_dir():
            self.table.save()
