"""The records of packages that are built: what their build folders began from, and what was installed.

Used by the worker threads, each for the package that it builds.
"""

from __future__ import annotations

import os
import re
from dataclasses import replace
from typing import TYPE_CHECKING

from forge.base.layout import TOOLCHAIN_DIR
from forge.build.build_dir import generated_digest, last_record, prepare_build_dir, written_since
from forge.build.build_types import build_type_of
from forge.build.copies import status_of
from forge.build.inputs.depfiles import reported_inputs, written_by_backend
from forge.build.inputs.fingerprints import (
    contents_of,
    digest_of,
    digest_strings,
    file_manifest,
    fingerprint_files,
    fingerprint_tree,
    tree_stats,
)
from forge.build.inputs.native_graph import read_native_graph
from forge.build.installation import InstalledFiles
from forge.build.installed_files import remove_stale, set_file_times
from forge.build.installed_lists import write_installed_list
from forge.build.model import BuildRecord
from forge.build.observed_commands import observed_commands
from forge.build.observed_writes import read_steps
from forge.build.prefix import written_log
from forge.build.records import FolderRecord, add_commands, complete_record
from forge.build.tasks import StepKind
from forge.build.up_to_date import UNKNOWN
from forge.engine.commands import NOT_OBSERVED, is_for_this_processor
from forge.engine.world import PROCESSOR, VARIABLE
from forge.toolchain.programs import CMAKE_TYPES

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

    from forge.base.errors import Problem
    from forge.base.frozen import Pairs
    from forge.build.inputs.fingerprints import FileTable, Manifest, Stats
    from forge.build.model import CachedBuild
    from forge.build.observed_writes import ObservedSteps
    from forge.build.reuse import Reuse
    from forge.build.state import BuildState
    from forge.build.tasks import Task
    from forge.engine.commands import ObservedCommands


_OTHER = "other"
"""The stamp of sources that have changed between the plan and the start of the package."""
_METADATA = re.compile(r"-packages/[^/]+\.(dist|egg)-info/")


class PackageRecorder:
    """Makes the records of the packages of one build."""

    def __init__(self, state: BuildState) -> None:
        """Record in `state`, whose journal only the build loop writes."""
        self._state = state
        self._layout = state.layout
        self._table = state.table
        self._begun: dict[str, tuple[FolderRecord | None, FolderRecord]] = {}
        """The last record of each build folder that is being built in, and that of this build."""
        self._steps: dict[str, ObservedSteps] = {}
        self._earlier_steps: dict[str, ObservedSteps] = {}
        self._observed: dict[str, ObservedCommands] = {}
        self.kept: tuple[Problem, ...] = ()
        """Files that packages no longer install, but that stay because somebody has edited them."""

    def begin(self, task: Task) -> None:
        """Note the installed state of a package before its build, to detect changes afterwards."""
        record = self._records.get(task.name)
        self._state.scripts.begin(task.name, record.files if record else ())

    def prepare(self, task: Task, set_by_needs: Pairs, *, from_empty: bool = False) -> Reuse:
        """Prepare a task's build folder, empty if `from_empty`; return how much of it is reused.

        `set_by_needs` are the variables that environment hooks of its dependencies set.
        """
        source, build, inputs = str(self._state.source(task)), task.build_dir, task.inputs
        last = last_record(build)
        sources, stamp = self._state.manifests.pop(task.name, None), task.sources.stamp
        if sources is None and last and stamp and last.stamp == stamp:
            sources = last.sources if next(iter(last.sources), "").startswith(f"{source}/") else None
        if sources is None:
            found, sources = fingerprint_tree(source, self._table)
            stamp = found.stamp if found.digest == task.sources.digest else _OTHER
        pairs = map("=".join, (*inputs.tools, *inputs.environment, *set_by_needs))
        record = FolderRecord(
            base=digest_strings(inputs.forge, os.path.realpath(source), *pairs),
            shape=digest_strings(*inputs.options, inputs.underlays),
            needs={need: self._installed(need) for need in task.needs},
            sources=sources,
            stamp=stamp,
        )
        reuse, record = prepare_build_dir(
            build,
            last,
            record,
            self._state.installed_states,
            self._table,
            kept=() if from_empty else tuple(task.kept),
            can_reuse=task.package.build_type in CMAKE_TYPES and not from_empty,
            reconfigure=task.reconfigure,
        )
        self._begun[task.name] = last, record
        return reuse

    def read_steps(self, task: Task) -> ObservedSteps:
        """Return what the steps of a package did; they have ended."""
        if task.name not in self._steps:
            steps = read_steps(written_log(task.name, self._layout))
            earlier = self._earlier_steps.pop(task.name, None)
            self._steps[task.name] = earlier.followed_by(steps) if earlier else steps
        return self._steps[task.name]

    def keep_steps(self, task: Task) -> None:
        """Keep what the steps of a package did but the installation, which follows once more."""
        self._earlier_steps[task.name] = self._steps.pop(task.name).without(StepKind.INSTALL.value)

    def record_commands(self, task: Task) -> None:
        """Record what the steps of a package have read and written, successful or not."""
        steps = self.read_steps(task)
        del self._steps[task.name]
        source, world, build = self._state.source(task), self._state.world, task.build_dir
        begun = self._begun.get(task.name)
        before = begun[1].commands if begun else NOT_OBSERVED
        commands = observed_commands(
            steps, build, source, self._layout, world, before, workspace=self._state.root
        )
        self._observed[task.name] = commands
        if begun and commands is not NOT_OBSERVED:
            add_commands(build, commands)

    def make_record(self, task: Task, installed: InstalledFiles) -> BuildRecord:
        """Remove stale installed files and return the record of a successful task.

        `installed` are the files that its steps and forge have installed.
        """
        build = task.build_dir
        if task.stage:  # what has not changed was not touched
            stats: Stats = {path: status for path in installed.files if (status := status_of(path))}
        else:
            stats = set_file_times(task, installed.files, self._layout, self._table)
        prefixes = map(self._layout.prefix, (task.name, *task.needs))
        declared = (self._state.source(task), build, self._layout.build / TOOLCHAIN_DIR, *prefixes)
        graph = read_native_graph(build)
        reported = reported_inputs(build, graph, declared)
        observed = self._observed.pop(task.name, NOT_OBSERVED)
        asked = [question for question, _ in observed.answers]
        # Plugins whose builds forge stages, such as cargo's, report their files themselves.
        every = () if build_type_of(task.package).staged else observed.all
        asked += self._about_processor(task, observed)
        found = tuple(sorted(reported.union(asked, *(each.external for each in every))))
        read = graph.known().union(*(each.read for each in observed.all))
        found = (*found, *self._undeclared(task, read, declared))
        externals = file_manifest(found, self._table)
        last, begun = self._begun.pop(task.name)
        written = frozenset[str]().union(*(each.written for each in observed.all))
        source = self._state.source(task)
        saved = saved_during_build(build, source, last, begun, externals, self._table, written)
        complete_record(build, externals, saved, generated_digest(build))
        names = (path.removeprefix(f"{source}/") for path in sorted(saved))
        contents = {path: state.content for path, state in externals.items()}
        digested = tuple(externals), digest_of(externals, contents)
        record = self._finish_record(task, installed, digested, stats)
        return replace(
            record,
            began=begun.began / 1e9,
            # The cache key has the sources as planned.
            saved=(*names, *((str(task.package.path),) if begun.stamp == _OTHER else ())),
            from_empty=begun.from_empty,
            read_from=self._owners_of(task, externals),
        )

    def _about_processor(self, task: Task, observed: ObservedCommands) -> Iterator[str]:
        """Yield the question about the processor if options or variables name it, or not all is known."""
        asked = {question.removeprefix(VARIABLE) for question, _ in observed.answers}
        values = map(self._state.world.value, {*dict(task.inputs.environment), *asked})
        is_named = any(map(is_for_this_processor, (*task.inputs.options, *values)))
        if is_named or not observed.all or any(each.blind for each in observed.all):
            yield PROCESSOR

    def _undeclared(self, task: Task, read: Iterable[str], declared: Iterable[Path]) -> Iterator[str]:
        """Yield what a build read of packages of this workspace that it does not depend on."""
        layout, records = self._layout, self._records
        build, install = f"{layout.build}/", f"{layout.install}/"
        # In a merged prefix, only the lists of files tell packages apart.
        own = tuple(f"{path}/" for path in declared if not (layout.merged and path == layout.install))
        near = [path for path in read if path.startswith((build, install)) and not path.startswith(own)]
        # Python reads the metadata of all distributions in search of plugins.
        near = [path for path in near if not _METADATA.search(path)]
        names = (task.name, *task.needs) if layout.merged and near else ()
        known = {path for name in names if name in records for path in records[name].files}
        rest = sorted(path for path in near if path not in known and os.path.isfile(path))  # noqa: PTH113
        owned = frozenset[str]().union(*(record.files for record in records.values())) if rest else ()
        for path in rest:
            if path in owned or (path.startswith(build) and path[len(build) :].partition("/")[0] in records):
                yield path

    def _owners_of(self, task: Task, paths: Iterable[str]) -> tuple[str, ...]:
        """Return the other packages of this workspace that own some of `paths`."""
        build, install = f"{self._layout.build}/", f"{self._layout.install}/"
        names = {path[len(build) :].partition("/")[0] for path in paths if path.startswith(build)}
        installed = {path for path in paths if path.startswith(install)}
        if installed:
            records = self._records.items()
            names |= {name for name, record in records if not installed.isdisjoint(record.files)}
        return tuple(sorted(names & self._records.keys() - {task.name}))

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
        known = {path: status for path, status in files.items() if status is not None}
        stats = set_file_times(task, tuple(files), self._layout, self._table, known)
        installed = InstalledFiles(tuple(files), folders)
        record = self._finish_record(task, installed, (found.externals, found.external), stats)
        return replace(record, seconds=found.seconds, tree=found.tree)

    def _finish_record(
        self,
        task: Task,
        installed_files: InstalledFiles,
        read: tuple[tuple[str, ...], str],
        stats: Stats,
    ) -> BuildRecord:
        """Return the record; `read` are the external files and their digest, `stats` are of some files."""
        files, folders = installed_files.files, installed_files.folders
        remove_stale(task, files, self._layout, self._records)
        self._state.scripts.end(task.name, files, stats)
        contents = contents_of((*files, *folders), self._table, stats)
        installed = fingerprint_files((*files, *folders), self._table, stats=stats, contents=contents)
        self._state.installed_states.keep(task.name, installed.digest, contents)
        own = {path: contents[path] for path in files}
        root = str(self._state.root)
        write_installed_list(task.name, self._layout, own, folders, installed_files.unclaimed, root)
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

    @property
    def _records(self) -> Mapping[str, BuildRecord]:
        return self._state.journal.records

    def _installed(self, name: str) -> str:
        """Return the recorded digest of a package's installed files, or UNKNOWN."""
        record = self._records.get(name)
        return record.installed.digest if record else UNKNOWN


def saved_during_build(
    build: Path,
    source: Path,
    last: FolderRecord | None,
    begun: FolderRecord,
    externals: Manifest,
    table: FileTable,
    observed: frozenset[str],
) -> frozenset[str]:
    """Return the inputs that were written since the build has begun, even if with the same content.

    Files that the steps were `observed` to write, or a build backend, are excluded, and so are files that
    were also written during the `last` build and have the same content: the build writes them.
    """
    then, now = begun.sources, tree_stats(str(source))
    written = observed.union(written_by_backend(build))
    again: frozenset[str] = last.saved if last else frozenset()
    before = (last.externals if last else None) or {}
    changed = {
        path
        for path in then.keys() | now.keys()
        if (path not in then or then[path].stats != now.get(path)) and path not in written
    }
    contents = contents_of(sorted(changed & again & then.keys()), table)
    changed -= {path for path, content in contents.items() if content == then[path].content}
    return frozenset(changed).union(
        path
        for path in externals.keys() - written
        if written_since(path, begun.began)
        and not (path in again and path in before and before[path].content == externals[path].content)
    )
