"""Build the tests of packages whose installed files came from the cache, without installing them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from forge.base.frozen import frozen
from forge.base.layout import Layout
from forge.build.build_dir import empty_build_dir, read_deferred, write_deferred
from forge.build.model import BuildInputs, BuildRecord
from forge.build.tasks import BuildPlan, Task
from forge.execution.runner import TaskLifecycle
from forge.workspace.load import LoadedWorkspace


def plan_restored(names: Iterable[str], loaded: LoadedWorkspace, layout: Layout) -> BuildPlan:
    """Return the steps that build the tests of these packages, which need no others."""
    tasks = {}
    for name in sorted(names):
        deferred = read_deferred(layout.build_dir(name))
        if deferred is not None and deferred.steps and not deferred.done:
            reason = "its tests were not built, because its installed files came from the cache"
            folders = layout.prefix(name), layout.build_dir(name)
            steps, files = deferred.steps, deferred.files
            tasks[name] = Task(name, loaded.packages[name], *folders, (), steps, reason, files=files)
    return BuildPlan(tasks)


@frozen
class RestoredSetup(TaskLifecycle):
    """The lifecycle of these builds: they begin in an empty build folder, and install nothing."""

    variables: Mapping[str, str]

    def environment(self, task: Task) -> Mapping[str, str]:
        deferred = read_deferred(task.build_dir)
        return {**self.variables, **dict(deferred.variables if deferred else ())}

    def begin(self, task: Task, _: Mapping[str, str]) -> None:
        empty_build_dir(task.build_dir)

    def install(self, task: Task) -> BuildRecord:
        deferred = read_deferred(task.build_dir)
        if deferred is not None:
            write_deferred(task.build_dir, replace(deferred, done=True))
        return BuildRecord(BuildInputs())
