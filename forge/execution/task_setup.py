"""The lifecycle of a build task: back up the installed files, set up the environment, install and record."""

from __future__ import annotations

import functools
import os
import shlex
from contextlib import closing
from dataclasses import field, replace
from typing import TYPE_CHECKING

from forge.base.errors import WorkspaceError, raise_if_any
from forge.base.frozen import frozen
from forge.build import installation, staging
from forge.build.deferred import defer_build, tests_need_build
from forge.build.installed_lists import package_markers
from forge.build.prefix import PrefixExchange
from forge.build.reuse import Reuse
from forge.engine.variables import FOR_COMPILERS
from forge.environment.hooks import config_folders, config_variables
from forge.environment.sourcing import build_environment, package_edits
from forge.execution.runner import TaskLifecycle, changed_variables
from forge.execution.started import BUILD_FOLDER_VARIABLE
from forge.toolchain.interpreter import own_command
from forge.toolchain.programs import CMAKE_TYPES
from forge.workspace.model import RUN_KINDS

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from forge.base.frozen import Pairs
    from forge.base.layout import Layout
    from forge.build.audit import Audit
    from forge.build.compiler_probe import Toolchain
    from forge.build.model import BuildRecord
    from forge.build.recording import PackageRecorder
    from forge.build.state import BuildState
    from forge.build.tasks import Step, Task
    from forge.cache.package_cache import PackageCache
    from forge.environment.dsv import Edit, Script
    from forge.toolchain.interpreter import Interpreter
    from forge.workspace.resolve import DependencyResolution


@frozen
class TaskSetup(TaskLifecycle):
    """The state shared by all tasks of a build; `variables` is the environment below their dependencies'."""

    resolution: DependencyResolution
    layout: Layout
    interpreter: Interpreter
    variables: Mapping[str, str]
    state: BuildState
    recorder: PackageRecorder
    cache: PackageCache | None = None
    toolchain: Toolchain | None = None
    """Lets new build folders skip CMake's compiler checks."""
    audit: Audit | None = None
    """Compares what steps read with what is declared; then each package starts in an empty build folder."""
    observes: bool = False
    """Steps run on this machine below the library of forge.engine, so that they can install into a stage."""
    edits: Callable[[str, Path], tuple[Edit | Script, ...]] = field(
        default_factory=lambda: functools.cache(package_edits)
    )
    """Returns an installed package's changes of the environment; cached, as only dependents request it."""
    _configs: dict[str, Pairs] = field(default_factory=dict)

    def environment(self, task: Task) -> Mapping[str, str]:
        below = ((need, self.layout.prefix(need)) for need in task.needs)
        found = build_environment(below, self.variables, self.edits)
        found[BUILD_FOLDER_VARIABLE] = str(self.layout.build)
        found["FORGE_COMMAND"] = shlex.join(own_command())
        # CMake does not read AMENT_PREFIX_PATH, which has the underlays.
        paths = found.get("CMAKE_PREFIX_PATH", "").split(os.pathsep)
        paths += self.variables.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
        found["CMAKE_PREFIX_PATH"] = os.pathsep.join(dict.fromkeys(filter(None, paths)))
        found = {**self._config_variables(task), **found}
        return {name: value for name, value in found.items() if value or name in self.variables}

    def _config_variables(self, task: Task) -> dict[str, str]:
        """Return the variables that save CMake the search in the prefixes of all dependencies."""
        # With a toolchain file, CMake may look for the same path below a sysroot.
        if self.layout.merged or self.layout.target or task.package.build_type not in CMAKE_TYPES:
            return {}
        return config_variables(map(self._config_folders, task.needs))

    def _config_folders(self, need: str) -> Pairs:
        """Return the config files of an installed package; remembered for all packages that need it."""
        if need not in self._configs:
            record = self.state.journal.records.get(need)
            self._configs[need] = config_folders(record.files) if record else ()
        return self._configs[need]

    def begin(self, task: Task, environment: Mapping[str, str]) -> None:
        self._back_up(task)
        if task.prepared:
            return
        # What hooks of dependencies set, without path lists.
        usual = _FROM_NEEDS | self._config_variables(task).keys()
        set_by_needs = tuple(
            (name, value)
            for name, value in sorted(environment.items())
            if self.variables.get(name) != value and name not in usual
        )
        from_empty = task.from_empty or self.audit is not None
        if self.recorder.prepare(task, set_by_needs, from_empty=from_empty) is Reuse.NOTHING:
            # With the folder goes the knowledge of what the last install step has read.
            staging.forget_sources(task)
        # The package's own arguments and the hooks of its dependencies may select another compiler.
        package = task.package
        arguments = (*package.option_values("cmake-args"), *package.option_values("ament-cmake-args"))
        same_compilers = not arguments and _for_compilers(environment) == _for_compilers(self.variables)
        if self.toolchain is not None and same_compilers and package.build_type in CMAKE_TYPES:
            self.toolchain.seed(self.state.source(task), task.build_dir, self.variables)

    def staged(self, task: Task) -> Task:
        # With DESTDIR, nothing is installed into the prefix.
        observes = self.observes and "DESTDIR" not in self.variables
        return staging.staged(task, self.layout) if observes else task

    def unstaged(self, task: Task, failed: Step | None, *, stopped: bool) -> Task | None:
        if task.stage is None or stopped:
            return None
        steps = self.recorder.read_steps(task)
        again = staging.in_place(task, self.layout, steps, failed)
        if again is not None:
            if again.prepared:
                self.recorder.keep_steps(task)
            else:
                self.recorder.record_commands(task)
            staging.end(task, self.layout)
        return again

    def _back_up(self, task: Task) -> None:
        self.recorder.begin(task)
        if task.stage:
            staging.begin(task, self.layout)
            return
        shared = self.state.merged_prefix.shared_files(task)
        exchange = PrefixExchange(task.name, self.layout)
        self.recorder.kept += exchange.begin(task.earlier, shared)
        raise_if_any(exchange.in_the_way(package_markers(task.name, self.layout)), WorkspaceError)

    def restore(self, task: Task) -> BuildRecord | None:
        """Install the cached result of a task; return None and change nothing if there is none."""
        found = self.cache.find(task) if self.cache else None
        if found is None or self.cache is None:
            return None
        with closing(found):
            self._back_up(task)
            paths = [f"{task.prefix}/{leaf.path}" for leaf in found.tree.leaves]
            exchange = PrefixExchange(task.name, self.layout)
            raise_if_any(exchange.in_the_way(paths), WorkspaceError)
            exchange.announce(paths)
            files, empty = self.cache.restore(task, found)
            staging.forget_sources(task)
            record = self.recorder.restored_record(task, found.build, files, empty)
            if tests_need_build(task.package):
                has_tests = found.build.has_tests
                variables = changed_variables(self.environment(task)) if has_tests else ()
                defer_build(task, variables, has_tests=has_tests)
        self._commit(task)
        return record

    def _commit(self, task: Task) -> None:
        if task.stage:
            staging.end(task, self.layout)
            return
        self.recorder.kept += PrefixExchange(task.name, self.layout).commit()

    def remark(self, task: Task) -> str:
        return self.cache.remark(task.name) if self.cache else ""

    def install(self, task: Task) -> BuildRecord:
        needs = set(task.package.manifest.names(RUN_KINDS))
        # A dependency that an embedded package provides under another name is recorded by the package's name.
        packages = self.resolution.packages
        needs |= {need for need in self.resolution.needs[task.name] if packages[need].embedded}
        self.recorder.record_commands(task)
        if task.stage:
            installed, kept = staging.commit(task, self.layout)
            self.recorder.kept += kept
        else:
            installed = installation.installed_files(task.package, self.layout, task.earlier)
        staging.note_installed(task, installed)
        own = installation.install_package(
            task.package, self.layout, tuple(sorted(needs)), self.interpreter, installed.files
        )
        files = tuple(sorted({*installed.files, *own}))
        installed = replace(installed, files=files)
        if task.stage:
            self.recorder.kept += staging.remove_other_stale(task, self.layout, installed)
        record = self.recorder.make_record(task, installed)
        if self.audit is not None:
            self.audit.collect(task)
        self._commit(task)
        return self.cache.keep(task, record) if self.cache else record

    def check(self, task: Task) -> None:
        raise_if_any(PrefixExchange(task.name, self.layout).refused(), WorkspaceError)

    def undo(self, task: Task) -> None:
        self.recorder.record_commands(task)
        if task.stage:
            staging.end(task, self.layout)
            return
        try:
            self.recorder.kept += PrefixExchange(task.name, self.layout).roll_back()
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


def _for_compilers(variables: Mapping[str, str]) -> dict[str, str]:
    """Return the variables that affect compilers."""
    return {name: value for name, value in variables.items() if name in FOR_COMPILERS}
