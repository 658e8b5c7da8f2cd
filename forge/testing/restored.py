"""Builds what the tests of packages that came from the package cache need, without installing it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from forge.base.errors import GroupedProblems, Problem
from forge.base.files import text_or_nothing
from forge.base.frozen import frozen
from forge.base.layout import BUILD_RESULT, Layout
from forge.build.build_dir import empty_build_dir
from forge.build.deferred import read_deferred, tests_need_build, write_deferred
from forge.build.journal import open_journal
from forge.build.model import BuildInputs, BuildRecord
from forge.build.tasks import BuildPlan, Task
from forge.execution.runner import TaskLifecycle
from forge.toolchain.cmake_variables import was_built_without_tests
from forge.toolchain.programs import CMAKE_TYPES
from forge.workspace.load import LoadedWorkspace


def has_no_tests(build: Path) -> bool:
    """Tell whether the last build of a CMake package left out its tests, here or where the cache is from."""
    deferred = read_deferred(build)
    return was_built_without_tests(build) if deferred is None or deferred.done else not deferred.steps


def plan_restored(names: Sequence[str], loaded: LoadedWorkspace, layout: Layout) -> BuildPlan:
    """Return the steps that build the tests of packages restored from the cache, which need no others."""
    tasks = {}
    for name in _restored(names, loaded, layout):
        deferred = read_deferred(layout.build_dir(name))
        if deferred is not None and deferred.steps and not deferred.done:
            tasks[name] = Task(
                name=name,
                package=loaded.packages[name],
                prefix=layout.prefix(name),
                build_dir=layout.build_dir(name),
                needs=(),
                steps=deferred.steps,
                reason="its tests were not built, because its installed files came from the cache",
                files=deferred.files,
            )
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


def not_runnable(
    names: Sequence[str], loaded: LoadedWorkspace, layout: Layout, ran: BuildPlan
) -> dict[str, Problem]:
    """Return a problem for each package whose tests are not built or outdated; `ran` tried to build some."""
    restored, found = _restored(names, loaded, layout), {}
    records = open_journal(layout.build).records
    for name in names:
        build, message = layout.build_dir(name), ""
        hint = f"forge build --force --packages-select {name}"
        deferred = read_deferred(build)
        if name in restored:
            if deferred is None:
                message = "its build folder is missing, and its installed files came from the cache"
            elif deferred.steps and not deferred.done:
                message, hint = (
                    "building its tests failed" if name in ran.tasks else "its tests are not built",
                    "",
                )
        elif loaded.packages[name].build_type in CMAKE_TYPES:
            cached = (build / "CMakeCache.txt").is_file()
            generated = (build / "cmake_install.cmake").is_file()
            failed = text_or_nothing(build / BUILD_RESULT).strip() not in {"", "0"}
            if (cached or failed) and not generated:
                message, hint = "CMake failed in the last build", f"forge build --packages-select {name}"
            elif not cached:
                message = "its build folder is missing"
        if not message and name in records and not records[name].complete:
            # What it installed and its test programs may be those of an earlier build.
            message, hint = "its last build failed or was stopped", f"forge build --packages-select {name}"
        if message:
            group = GroupedProblems(f"{{}} cannot be tested: {message}", name, hint and "forge build --force")
            found[name] = Problem(f"'{name}' cannot be tested: {message}", hint=hint or None, group=group)
    return found


def _restored(names: Sequence[str], loaded: LoadedWorkspace, layout: Layout) -> frozenset[str]:
    """Return the packages whose installed files came from the cache, and whose tests need a build folder."""
    records = open_journal(layout.build).records
    return frozenset(
        name
        for name in names
        if tests_need_build(loaded.packages[name])
        and name in records
        and records[name].complete
        and not records[name].began
    )
