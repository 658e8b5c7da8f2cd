"""What surrounds the steps of a task: what is cleared before, what they see, what is recorded after."""

from __future__ import annotations

import functools
import os
import shlex
from contextlib import closing
from dataclasses import field
from typing import TYPE_CHECKING

from forge import fallback, installation
from forge.freshness import FOR_COMPILERS
from forge.frozen import frozen
from forge.interpreter import own_command
from forge.model import RUN_KINDS
from forge.runner import Frame, ProcessRunner, as_it_is
from forge.sourcing import build_environment, package_edits
from forge.started import VARIABLE, StartedProcesses
from forge.tools import CMAKE_TYPES

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from forge.audit.tracing import Audit
    from forge.budget import Budget
    from forge.caching.package_cache import PackageCache
    from forge.environment import Edit, Script
    from forge.interpreter import Interpreter
    from forge.layout import Layout
    from forge.model import Pairs, Record, Task
    from forge.provision import Provision
    from forge.records import Records
    from forge.toolchain import Toolchain


@frozen
class Jobs:
    """What the tasks of one build share; `variables` is the environment that their needs' comes on top of."""

    provision: Provision
    layout: Layout
    interpreter: Interpreter
    variables: Mapping[str, str]
    records: Records
    cache: PackageCache | None = None
    audit: Audit | None = None
    """What watches the steps; then each package begins in an empty build folder."""
    edits: Callable[[str, Path], tuple[Edit | Script, ...]] = field(
        default_factory=lambda: functools.cache(package_edits)
    )
    """What an installed package does to the environment, looked up once: whoever asks comes after it."""

    def runner(self, budget: Budget, toolchain: Toolchain | None) -> ProcessRunner:
        """Return a runner that starts programs here; the rest as `frame`."""
        launch = self.audit.launch if self.audit is not None else as_it_is
        return ProcessRunner(self.frame(toolchain), budget, StartedProcesses(self.layout.build), launch)

    def frame(self, toolchain: Toolchain | None) -> Frame:
        """Return what surrounds steps; `toolchain` spares new packages the examination of the compilers."""

        def begin(task: Task, environment: Mapping[str, str]) -> None:
            self._begin(task, environment)
            # Arguments of its own, and hooks of its needs, may name another compiler.
            words = (*task.package.words("cmake-args"), *task.package.words("ament-cmake-args"))
            usual = not words and _for_compilers(environment) == _for_compilers(self.variables)
            if toolchain is not None and usual and task.package.build_type in CMAKE_TYPES:
                toolchain.seed(self.records.source(task), task.build_dir, self.variables)

        return Frame(self._environment, begin, self._install, self._undo, self._restore, self._remark)

    def _environment(self, task: Task) -> Mapping[str, str]:
        below = ((need, self.layout.prefix(need)) for need in task.needs)
        found = build_environment(below, self.variables, self.edits)
        found[VARIABLE] = str(self.layout.build)
        found["FORGE_COMMAND"] = shlex.join(own_command())
        found["CMAKE_PREFIX_PATH"] = _cmake_prefix_path(found, self.variables)
        return {name: value for name, value in found.items() if value or name in self.variables}

    def _begin(self, task: Task, environment: Mapping[str, str]) -> None:
        self._put_aside(task)
        self.records.prepare(task, self._set_by_needs(environment), anew=task.anew or self.audit is not None)

    def _set_by_needs(self, environment: Mapping[str, str]) -> Pairs:
        """Return the variables that hooks of needs set, without lists of paths: these follow from needs."""
        return tuple(
            (name, value)
            for name, value in sorted(environment.items())
            if self.variables.get(name) != value and name not in _FROM_NEEDS
        )

    def _put_aside(self, task: Task) -> None:
        self.records.begin(task)
        fallback.keep(task.name, self.layout, task.earlier, self.records.shared(task))

    def _restore(self, task: Task) -> Record | None:
        """Install what the cache has for a task; None when it has nothing, and nothing was touched."""
        found = self.cache.find(task) if self.cache else None
        if found is None or self.cache is None:
            return None
        with closing(found):
            self._put_aside(task)
            files, empty = self.cache.restore(task, found)
            record = self.records.restored(task, found, files, empty)
        self.records.carry_over(task)
        fallback.drop(task.name, self.layout)
        return record

    def _remark(self, task: Task) -> str:
        return self.cache.remark(task.name) if self.cache else ""

    def _install(self, task: Task) -> Record:
        needs = set(task.package.manifest.names(RUN_KINDS))
        # A name that an embedded package answers to is recorded with the package it stands for.
        packages = self.provision.packages
        needs |= {need for need in self.provision.needs[task.name] if packages[need].embedded}
        installation.install_package(task.package, self.layout, tuple(sorted(needs)), self.interpreter)
        record = self.records.make(task)
        self.records.carry_over(task)
        fallback.drop(task.name, self.layout)
        return self.cache.keep(task, record) if self.cache else record

    def _undo(self, task: Task) -> None:
        try:
            fallback.restore(task.name, self.layout)
        except OSError:
            # What was kept is kept still; until a build puts it back, nothing looks installed.
            installation.uninstall_markers(task.name, self.layout)
            raise


_FROM_NEEDS = frozenset(
    {
        *("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "COLCON_PREFIX_PATH", "LD_LIBRARY_PATH", "PATH"),
        *("PKG_CONFIG_PATH", "PYTHONPATH", "FORGE_COMMAND", VARIABLE),
    }
)


def _for_compilers(variables: Mapping[str, str]) -> dict[str, str]:
    """Return what the variables say of compilers; flags are said anew for each package."""
    return {name: value for name, value in variables.items() if name in FOR_COMPILERS}


def _cmake_prefix_path(found: Mapping[str, str], variables: Mapping[str, str]) -> str:
    """Return CMAKE_PREFIX_PATH with the underlays of AMENT_PREFIX_PATH, which CMake does not know."""
    paths = found.get("CMAKE_PREFIX_PATH", "").split(os.pathsep)
    paths += variables.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    return os.pathsep.join(dict.fromkeys(filter(None, paths)))
