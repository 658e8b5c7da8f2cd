"""The lifecycle of a build task: back up the installed files, set up the environment, install and record."""

from __future__ import annotations

import os
import re
import shlex
import threading
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import field, replace
from typing import TYPE_CHECKING

from forge.base.errors import Problem, WorkspaceError, raise_if_any
from forge.base.frozen import Pairs, frozen
from forge.base.layout import TOOLCHAIN_DIR, Layout
from forge.build import installation, staging
from forge.build.build_dir import (
    defer_build,
    generated_digest,
    last_record,
    observed_commands,
    prepare_build_dir,
    products_of,
    saved_during_build,
    tests_need_build,
)
from forge.build.build_types import build_type_of
from forge.build.inputs.fingerprints import (
    contents_of,
    digest_of,
    digest_strings,
    fingerprint_again,
    fingerprint_files,
    fingerprint_tree,
    source_files,
)
from forge.build.inputs.native_graph import (
    NativeGraph,
    cmake_root,
    read_native_graph,
    reported_inputs,
    written_by_backend,
)
from forge.build.installation import InstalledFiles, remove_stale, set_file_times
from forge.build.installed_lists import write_installed_list
from forge.build.model import BuildRecord
from forge.build.observed_writes import ObservedSteps, read_steps
from forge.build.prefix import PrefixExchange, written_log
from forge.build.records import FolderRecord, add_commands, complete_record
from forge.build.reuse import Reuse
from forge.build.up_to_date import TARGET, UMASK, UNKNOWN
from forge.engine.accesses import NOT_OBSERVED, ObservedCommands
from forge.engine.commands import is_for_this_processor
from forge.engine.variables import FOR_COMPILERS
from forge.engine.world import OF_CMAKE, PROCESSOR, VARIABLE, about_variables
from forge.environment.hooks import config_folders, config_variables
from forge.environment.sourcing import build_environment
from forge.execution.runner import TaskLifecycle, changed_variables
from forge.execution.started import BUILD_FOLDER_VARIABLE
from forge.toolchain.interpreter import Interpreter, own_command
from forge.workspace.model import CMAKE_TYPES, RUN_KINDS

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
    from pathlib import Path

    from forge.build.state import BuildState
    from forge.build.tasks import Step, Task
    from forge.cache.model import PackageCache
    from forge.workspace.resolve import DependencyResolution

    Seed = Callable[[Path, Path, Mapping[str, str]], frozenset[str]]
    """Prepares a package for CMake, given its source folder, build folder and variables."""


_SMALL = 1 << 20
"""The size of results, in bytes, below which one is restored at a time."""
_METADATA = re.compile(r"-packages/[^/]+\.(dist|egg)-info/")


@frozen
class TaskSetup(TaskLifecycle):
    """The state shared by all tasks of a build.

    `variables` is the environment that their dependencies extend.
    """

    resolution: DependencyResolution
    layout: Layout
    interpreter: Interpreter
    variables: Mapping[str, str]
    state: BuildState
    cache: PackageCache | None = None
    seed: Seed | None = None
    """Lets new build folders skip CMake's compiler checks."""
    audit: Callable[[Task, ObservedSteps, NativeGraph], None] | None = None
    """Compares inputs of steps with declared ones; each package then starts in an empty build folder."""
    observes: bool = False
    """Whether steps run on this machine under observation, so that they can install into a stage."""
    kept: list[Problem] = field(default_factory=list)
    """Edited files that are kept although packages no longer install them."""
    _configs: dict[str, Pairs] = field(default_factory=dict)
    _begun: dict[str, tuple[FolderRecord | None, FolderRecord]] = field(default_factory=dict)
    """For each build folder in use, the record of the last build and that of this one."""
    _exchanges: dict[str, PrefixExchange] = field(default_factory=dict)
    _steps: dict[str, ObservedSteps] = field(default_factory=dict)
    _observed: dict[str, ObservedCommands] = field(default_factory=dict)
    _detected: dict[str, frozenset[str]] = field(default_factory=dict)
    """The inputs of the compiler detection whose results were copied into a build folder."""
    _lock: AbstractContextManager[object] = field(default_factory=threading.RLock)

    @property
    def _alone(self) -> AbstractContextManager[object]:
        """Held while a merged prefix is changed: one package uses the folders that another one empties."""
        return self._lock if self.layout.merged else nullcontext()

    def environment(self, task: Task) -> Mapping[str, str]:
        below = ((need, self.layout.prefix(need)) for need in task.needs)
        environment = build_environment(below, self.variables)
        environment[BUILD_FOLDER_VARIABLE] = str(self.layout.build)
        environment["FORGE_COMMAND"] = shlex.join(own_command())
        # CMake does not read AMENT_PREFIX_PATH, which contains the underlays.
        paths = environment.get("CMAKE_PREFIX_PATH", "").split(os.pathsep)
        paths += self.variables.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
        environment["CMAKE_PREFIX_PATH"] = os.pathsep.join(dict.fromkeys(filter(None, paths)))
        environment = {**self._config_variables(task), **environment}
        return {name: value for name, value in environment.items() if value or name in self.variables}

    def _config_variables(self, task: Task) -> dict[str, str]:
        """Return the variables that save CMake the search in the prefixes of all dependencies."""
        # With a toolchain file, CMake may look for the same path below a sysroot.
        if self.layout.merged or self.layout.target or task.package.build_type not in CMAKE_TYPES:
            return {}
        for need in task.needs:
            if need not in self._configs:
                record = self.state.journal.records.get(need)
                self._configs[need] = config_folders(record.files) if record else ()
        return config_variables(self._configs[need] for need in task.needs)

    def begin(self, task: Task, environment: Mapping[str, str]) -> None:
        with self._alone:
            self._back_up(task)
        if task.prepared:
            return
        # Variables set by hooks of dependencies, except path lists.
        usual = _FROM_NEEDS | self._config_variables(task).keys()
        set_by_needs = tuple(
            (name, value)
            for name, value in sorted(environment.items())
            if self.variables.get(name) != value and name not in usual
        )
        state, build, inputs = self.state, task.build_dir, task.inputs
        source, records = str(state.source(task)), state.journal.records
        last = last_record(build)
        fingerprint, sources = fingerprint_tree(source, state.table)
        pairs = map("=".join, (*inputs.tools, *inputs.environment, *set_by_needs))
        # Outputs of other targets, or with other permissions, would remain in the folder.
        base_options = (option for option in inputs.options if option.startswith((TARGET, UMASK)))
        needs = ((need, records.get(need)) for need in task.needs)
        record = FolderRecord(
            base=digest_strings(inputs.forge, os.path.realpath(source), *pairs, *base_options),
            shape=digest_strings(*inputs.options, inputs.underlays),
            needs={need: each.installed.digest if each else UNKNOWN for need, each in needs},
            sources=sources,
            unplanned=fingerprint.digest != task.sources.digest,
        )
        from_empty = task.from_empty or self.audit is not None
        reuse, record = prepare_build_dir(
            build,
            last,
            record,
            state.installed_states,
            state.table,
            kept=() if from_empty else tuple(task.kept),
            can_reuse=task.package.build_type in CMAKE_TYPES and not from_empty,
            reconfigure=task.reconfigure,
            before_removal=lambda removed: self._keep_linked(task, removed),
        )
        self._begun[task.name] = last, record
        if reuse is Reuse.NOTHING:
            # Without the folder, the inputs of the last install step are unknown.
            staging.forget_sources(task)
        # The package's own arguments and the hooks of its dependencies may select another compiler.
        package = task.package
        arguments = (*package.option_values("cmake-args"), *package.option_values("ament-cmake-args"))
        same_compilers = not arguments and all(
            environment.get(name) == self.variables.get(name) for name in FOR_COMPILERS
        )
        if self.seed is not None and same_compilers and package.build_type in CMAKE_TYPES:
            self._detected[task.name] = self.seed(self.state.source(task), task.build_dir, self.variables)

    def staged(self, task: Task) -> Task:
        # With DESTDIR, nothing is installed into the prefix.
        observes = self.observes and "DESTDIR" not in self.variables
        shared = self.state.merged_prefix.shared_files(task)
        return staging.staged(task, self.layout, shared) if observes else task

    def is_outdated(self, task: Task) -> bool:
        self._observed[task.name] = commands = self._record_commands(task)
        return bool(commands.outdated)

    def unstaged(self, task: Task, failed: Step | None, *, stopped: bool) -> Task | None:
        if task.stage is None or stopped:
            return None
        steps = self._read_steps(task)
        again = staging.in_place(task, self.layout, steps, failed)
        if again is not None:
            commands = self._observed.pop(task.name, None) or self._record_commands(task)
            del self._steps[task.name]
            if again.prepared:
                # Only the install step runs again.
                last, begun = self._begun[task.name]
                self._begun[task.name] = last, replace(begun, commands=commands)
            staging.end(task, self.layout)
        return again

    def _read_steps(self, task: Task) -> ObservedSteps:
        """Return the observations of the steps of a package after they have ended."""
        if task.name not in self._steps:
            self._steps[task.name] = read_steps(written_log(task.name, self.layout))
        return self._steps[task.name]

    def _exchange(self, task: Task) -> PrefixExchange:
        if task.name not in self._exchanges:
            self._exchanges[task.name] = PrefixExchange(task.name, self.layout)
        return self._exchanges[task.name]

    def _back_up(self, task: Task, *, runs_steps: bool = True) -> None:
        record = self.state.journal.records.get(task.name)
        self.state.scripts.begin(task.name, record.files if record else ())
        if task.stage:
            staging.begin(task, self.layout)
            return
        shared, exchange = self.state.merged_prefix.shared_files(task), self._exchange(task)
        self.kept.extend(exchange.begin(task.earlier, shared, runs_steps=runs_steps))
        raise_if_any(exchange.in_the_way(exchange.markers), WorkspaceError)

    def _keep_linked(self, task: Task, removed: Collection[str] | None) -> None:
        if task.stage and self.layout.symlink:
            again = None if removed is None else read_native_graph(task.build_dir).with_made_from(removed)
            with self._alone:
                staging.keep_linked(task, self.layout, again)

    def restore(self, task: Task) -> BuildRecord | None:
        """Install the cached result of a task; return None and change nothing if there is none."""
        cached_tree = self.cache.find(task) if self.cache else None
        if cached_tree is None or self.cache is None:
            return None
        # Threads that write small files delay each other; those that copy large ones do not.
        is_small = sum(leaf.size for leaf in cached_tree.tree.leaves) < _SMALL
        with closing(cached_tree), self._lock if is_small else self._alone:
            self._back_up(task, runs_steps=False)
            paths = [f"{task.prefix}/{leaf.path}" for leaf in cached_tree.tree.leaves]
            exchange = self._exchange(task)
            raise_if_any(exchange.in_the_way(paths), WorkspaceError)
            exchange.announce(paths)
            files, empty = self.cache.restore(task, cached_tree)
            staging.forget_sources(task)
            set_file_times(exchange, files, self.state.table, restored=True)
            installed = InstalledFiles(files, empty)
            # The build folder does not belong to the record: the next build starts from empty.
            record = replace(
                self._record(task, installed, cached_tree.externals, cached_tree.external),
                seconds=cached_tree.tree.seconds,
                tree=cached_tree.tree.digest,
            )
            if tests_need_build(task.package):
                has_tests = cached_tree.tree.has_tests
                variables = changed_variables(self.environment(task)) if has_tests else ()
                defer_build(task, variables, has_tests=has_tests)
            self._commit(task)
        return record

    def _commit(self, task: Task) -> None:
        exchange = self._exchange(task)
        del self._exchanges[task.name]
        if task.stage:
            staging.end(task, self.layout)
            return
        with self._alone:
            self.kept.extend(exchange.commit())

    def remark(self, task: Task) -> str:
        return self.cache.remark(task.name) if self.cache else ""

    def install(self, task: Task) -> BuildRecord:
        needs = set(task.package.manifest.names(RUN_KINDS))
        # A dependency that an embedded package provides under another name is recorded by the package's name.
        packages = self.resolution.packages
        needs |= {need for need in self.resolution.needs[task.name] if packages[need].embedded}
        is_observed = self._read_steps(task).complete
        observed = self._observed.pop(task.name, None) or self._record_commands(task)
        del self._steps[task.name]
        exchange = self._exchange(task)
        with self._alone:
            if task.stage:
                installed, problems = staging.commit(task, self.layout)
                self.kept.extend(problems)
            else:
                installed = installation.installed_files(task.package, self.layout, exchange, task.earlier)
            staging.note_installed(task, installed, observed=is_observed)
            own = installation.install_package(
                task.package, self.layout, tuple(sorted(needs)), self.interpreter, installed.files, exchange
            )
            files = tuple(sorted({*installed.files, *own}))
            written = None if installed.written is None else installed.written.union(own)
            installed = replace(installed, files=files, written=written)
            if task.stage:
                self.kept.extend(staging.remove_other_stale(task, self.layout, installed))
        build = task.build_dir
        if not task.stage:  # in a stage, unchanged files were not touched
            set_file_times(exchange, installed.files, self.state.table)
        prefixes = map(self.layout.prefix, (task.name, *task.needs))
        declared = (self.state.source(task), build, self.layout.build / TOOLCHAIN_DIR, *prefixes)
        graph = read_native_graph(build)
        reported = reported_inputs(build, graph, declared)
        asked = [question for question, _ in observed.answers]
        if not observed.all:
            asked += self._about_named_variables(task, graph)
            within = tuple(f"{path}/" for path in declared)
            reported |= {path for path in graph.searched_by_linkers() if not path.startswith(within)}
        tools = build_type_of(task.package).tool_folders
        folders = tuple(f"{folder}/" for folder in tools(self.state.world.variables)) if tools else ()
        # Options and variables may name the processor; unobserved processes may query it.
        asked_variables = {question.removeprefix(VARIABLE) for question in asked}
        values = map(self.state.world.value, {*dict(task.inputs.environment), *asked_variables})
        is_named = any(map(is_for_this_processor, (*task.inputs.options, *values)))
        if is_named or not observed.all or any(each.blind for each in observed.all):
            asked.append(PROCESSOR)
        seen = (path for each in observed.all for path in each.external if not path.startswith(folders))
        seen_or_asked = frozenset((*asked, *seen)).difference(written_by_backend(build))
        external_inputs = tuple(sorted(reported | seen_or_asked))
        read = graph.known().union(*(each.read for each in observed.all))
        external_inputs = (*external_inputs, *self._undeclared(task, read, declared))
        externals = contents_of(external_inputs, self.state.table)
        last, begun = self._begun.pop(task.name)
        written = frozenset[str]().union(*(each.written for each in observed.all))
        source = self.state.source(task)
        saved = saved_during_build(build, source, last, begun, externals, self.state.table, written)
        complete_record(build, externals, saved, generated_digest(build), products_of(build, observed))
        names = (path.removeprefix(f"{source}/") for path in sorted(saved))
        record = replace(
            self._record(task, installed, tuple(externals), digest_of(externals, externals)),
            began=begun.began / 1e9,
            # The cache key contains the sources as planned.
            saved=(*names, *((str(task.package.path),) if begun.unplanned else ())),
            from_empty=begun.from_empty,
            read_from=self._owners_of(task, externals),
        )
        if self.audit is not None:
            self.audit(task, read_steps(written_log(task.name, self.layout)), graph)
        self._commit(task)
        return self.cache.keep(task, record) if self.cache else record

    def _record_commands(self, task: Task) -> ObservedCommands:
        """Record the accesses of the steps of a package, successful or not."""
        build, begun = task.build_dir, self._begun.get(task.name)
        steps = self._read_steps(task)
        commands = observed_commands(
            steps,
            build,
            self.state.source(task),
            self.layout,
            self.state.world,
            begun[1].commands if begun else NOT_OBSERVED,
            self._detected.pop(task.name, frozenset()),
            workspace=self.state.root,
            began=begun[1].began if begun else 0,
        )
        if begun and commands is not NOT_OBSERVED:
            add_commands(build, commands)
        return commands

    def _record(
        self, task: Task, installed: InstalledFiles, externals: tuple[str, ...], external: str
    ) -> BuildRecord:
        """Remove stale files and return the record."""
        files, paths = installed.files, (*installed.files, *installed.folders)
        state = self.state
        with self._alone:
            remove_stale(task, files, self.layout, self._exchange(task), state.journal.records)
        state.scripts.end(task.name, files)
        previous, again = state.journal.records.get(task.name), None
        if previous and installed.written is not None:
            then = state.installed_states.contents(task.name, previous.installed.digest)
            again = fingerprint_again(paths, state.table, then, installed.written)
        fingerprint, contents = again or fingerprint_files(paths, state.table)
        state.installed_states.keep(task.name, fingerprint.digest, contents)
        own = {path: contents[path] for path in files}
        unclaimed, root = installed.unclaimed, str(state.root)
        write_installed_list(task.name, self.layout, own, installed.folders, unclaimed, root)
        return BuildRecord(
            inputs=task.inputs,
            complete=True,
            sources=task.sources,
            installed=fingerprint,
            files=files,
            folders=installed.folders,
            externals=externals,
            external=external,
        )

    def _about_named_variables(self, task: Task, graph: NativeGraph) -> Iterator[str]:
        """Yield the questions about the variables that files name: an unobserved build may request all."""
        cmakes = cmake_root(task.build_dir)
        of_cmake = (path for path in {*graph.known(), *graph.read_by_cmake} if path.endswith(OF_CMAKE))
        read = [path for path in of_cmake if not (cmakes and path.startswith(cmakes))]
        named = self.state.world.scripts.named_in((*source_files(str(self.state.source(task))), *read))
        return about_variables((), named)

    def _undeclared(self, task: Task, read: Iterable[str], declared: Iterable[Path]) -> Iterator[str]:
        """Yield files that a build read from packages of this workspace that it does not depend on."""
        layout, records = self.layout, self.state.journal.records
        build, install = f"{layout.build}/", f"{layout.install}/"
        # In a merged prefix, only the lists of files show which package owns a file.
        own = tuple(f"{path}/" for path in declared if not (layout.merged and path == layout.install))
        near = [path for path in read if path.startswith((build, install)) and not path.startswith(own)]
        # Python reads the metadata of all distributions in search of plugins.
        near = [path for path in near if not _METADATA.search(path)]
        names = (task.name, *task.needs) if layout.merged and near else ()
        declared_files = {path for name in names if name in records for path in records[name].files}
        rest = sorted(path for path in near if path not in declared_files and os.path.isfile(path))  # noqa: PTH113
        owned = frozenset[str]().union(*(record.files for record in records.values())) if rest else ()
        for path in rest:
            if path in owned or (path.startswith(build) and path[len(build) :].partition("/")[0] in records):
                yield path

    def _owners_of(self, task: Task, paths: Iterable[str]) -> tuple[str, ...]:
        """Return the other packages of this workspace that own some of `paths`."""
        build, install = f"{self.layout.build}/", f"{self.layout.install}/"
        records = self.state.journal.records
        names = {path[len(build) :].partition("/")[0] for path in paths if path.startswith(build)}
        if installed := {path for path in paths if path.startswith(install)}:
            names |= {name for name, record in records.items() if not installed.isdisjoint(record.files)}
        return tuple(sorted(names & records.keys() - {task.name}))

    def check(self, task: Task) -> None:
        raise_if_any(self._exchange(task).refused(), WorkspaceError)

    def undo(self, task: Task) -> None:
        if not self._observed.pop(task.name, None):
            self._record_commands(task)
        del self._steps[task.name]
        exchange = self._exchange(task)
        del self._exchanges[task.name]
        if task.stage:
            staging.end(task, self.layout)
            return
        try:
            with self._alone:
                self.kept.extend(exchange.roll_back())
        except OSError:
            # The backup still exists. Until a build restores it, the package must not look installed.
            installation.uninstall_markers(task.name, self.layout)
            raise


_FROM_NEEDS = frozenset(
    {
        *("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "COLCON_PREFIX_PATH", "LD_LIBRARY_PATH", "PATH"),
        *("PKG_CONFIG_PATH", "PYTHONPATH", "FORGE_COMMAND", BUILD_FOLDER_VARIABLE),
    }
)
