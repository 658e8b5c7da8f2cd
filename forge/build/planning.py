"""Make the build plan from packages, selection and snapshot."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Any, TypeVar

from forge.base.errors import Problem, WorkspaceError, raise_if_any
from forge.base.graph import closure, closures, ordered_names, weak_edges_on_cycles
from forge.base.layout import Layout
from forge.build.build_types import build_type_of, unknown_type, unknown_types
from forge.build.installed_lists import listed_files, without_other_installs
from forge.build.model import BuildInputs, Snapshot
from forge.build.recipes.context import BuildContext, Recipe
from forge.build.tasks import BuildPlan, Task
from forge.build.up_to_date import DependencyHashes, reason_to_build
from forge.engine.variables import FOR_COMPILERS
from forge.workspace.model import Selection
from forge.workspace.resolve import DependencyResolution


def names_to_build(selection: Selection, resolution: DependencyResolution) -> tuple[str, ...]:
    """Return the selected packages and the embedded packages that they need, in topological order."""
    selected = frozenset(selection.names)
    reached = closure(resolution.needs, selected)
    return tuple(
        name
        for name in ordered_names(resolution.needs)
        if name in reached and (name in selected or resolution.packages[name].embedded)
    )


def make_plan(
    names: Sequence[str],
    resolution: DependencyResolution,
    snapshot: Snapshot,
    context: BuildContext,
    shared: BuildInputs,
    forced: Mapping[str, str],
) -> tuple[BuildPlan, DependencyHashes]:
    """Return the tasks for `names`, which are in topological order, and the dependency hashes.

    `shared` are the inputs of all packages, and `forced` maps packages that are built in any case to the
    option that requests it. Packages without a task are up to date. Raises WorkspaceError for unknown build
    types and for dependencies that are not installed.
    """
    ordered = ordered_names(resolution.needs)
    read_from = _read_from(resolution, snapshot)
    if read_from:
        observed = {
            name: needs | read_from.get(name, frozenset()) for name, needs in resolution.needs.items()
        }
        wanted = frozenset(names)
        names = tuple(name for name in ordered_names(observed) if name in wanted)
    closed = closures(resolution.needs, ordered)
    unknown = unknown_types(resolution.packages[name] for name in names)
    problems = (unknown_type(resolution.packages[name].manifest) for name in names if name in unknown)
    absent = _not_installed(names, resolution, closed, snapshot, context.layout)
    raise_if_any((*problems, *absent), WorkspaceError)
    hashes = DependencyHashes(
        resolution.needs, {name: fingerprint.digest for name, fingerprint in snapshot.installed.items()}
    )
    tasks: dict[str, Task] = {}
    for name in names:
        needs = closed[name]
        package = resolution.packages[name]
        need_hashes = hashes.needs_of(name, needs)
        inputs = replace(
            shared,
            options=build_type_of(package).options(package, context.of(package)),
            sources=snapshot.sources[name].digest,
            needs=need_hashes or (),
        )
        if package.embedded:  # embedded packages compile nothing
            inputs = replace(
                inputs,
                tools=tuple(pair for pair in shared.tools if pair[0] in _CONFIGURING),
                environment=tuple(pair for pair in shared.environment if pair[0] not in FOR_COMPILERS),
            )
        record = snapshot.records.get(name)
        option = forced.get(name)
        # Dependents of pending packages are decided after these have ended.
        now = replace(inputs, needs=record.inputs.needs) if need_hashes is None and record else inputs
        change = reason_to_build(name, now, record, snapshot)
        reason = change.text if change else (f"requested by {option}" if option else None)
        after = read_from.get(name, frozenset()) & tasks.keys()
        if reason is not None or need_hashes is None or after:
            hashes.expect(name)
            recipe = cache(partial(build_type_of(package).recipe, package, context.of(package)))
            build = context.layout.build_dir(name)
            installed = {*(record.files if record else ()), *listed_files(build)}
            tasks[name] = Task(
                name=name,
                package=package,
                prefix=context.layout.prefix(name),
                build_dir=build,
                needs=needs,
                steps=_LazyTuple(recipe, "steps"),
                reason=reason or "one of its dependencies is being rebuilt and may change",
                change=change,
                inputs=inputs,
                sources=snapshot.sources[name],
                files=_LazyTuple(recipe, "files"),
                conditional=reason is None,
                reconfigure=context.force_configure or context.clean_cache,
                from_empty=option == "--force",
                after=after,
                earlier=tuple(sorted(without_other_installs(installed, context.layout.install))),
                intact=record is not None
                and name in snapshot.present
                and snapshot.installed[name].digest == record.installed.digest,
                kept=_LazyTuple(recipe, "kept"),
            )
    return BuildPlan(tasks, tuple(name for name in names if name not in tasks)), hashes


def _read_from(resolution: DependencyResolution, snapshot: Snapshot) -> dict[str, frozenset[str]]:
    """Return the packages whose files the last build of each package read without declaring them.

    They are built first where possible. In a cycle, declared dependencies take precedence.
    """
    read_from = {
        name: frozenset(record.read_from) & resolution.needs.keys() - {name}
        for name, record in snapshot.records.items()
        if record.read_from and name in resolution.needs
    }
    if not read_from:
        return {}
    undeclared = {name: read_from.get(name, frozenset()) for name in resolution.needs}
    both = {name: needs | undeclared[name] for name, needs in resolution.needs.items()}
    cycles = weak_edges_on_cycles(both, undeclared)
    return {name: others - cycles.get(name, frozenset()) for name, others in read_from.items()}


_CONFIGURING = frozenset({"python", "cmake", "ninja", "make"})
"""The tools of packages that compile nothing."""


def _not_installed(
    names: Sequence[str],
    resolution: DependencyResolution,
    below: Mapping[str, Collection[str]],
    snapshot: Snapshot,
    layout: Layout,
) -> Iterable[Problem]:
    """Yield a problem for each package with a dependency that is neither installed nor planned."""
    available = snapshot.present | frozenset(names)

    @cache
    def without_tests() -> dict[str, frozenset[str]]:
        packages = resolution.packages
        return {name: needs - packages[name].only_tested_with for name, needs in resolution.needs.items()}

    for name in names:
        absent = sorted(need for need in below[name] if need not in available and need in resolution.packages)
        if absent:
            quoted = ", ".join(f"'{need}'" for need in absent)
            verb = "is" if len(absent) == 1 else "are"
            message = f"'{name}' needs {quoted}, which {verb} not built yet"
            hint = f"build them too: {layout.command(f'build --packages-up-to {name}')}"
            if not (closure(without_tests(), {name}) & {*absent}):
                hint += ", or pass '--no-test-dependencies': only tests need them"
            yield Problem(message, hint=hint)


_Item_co = TypeVar("_Item_co", covariant=True)


class _LazyTuple(Sequence[_Item_co]):
    """A field of the recipe that a pure function returns, computed on first access; pickled as a tuple.

    Most tasks of a plan never run, because their dependencies are unchanged or their results are cached.
    """

    def __init__(self, recipe: Callable[[], Recipe], name: str) -> None:
        self._recipe = recipe
        self._name = name

    def __len__(self) -> int:
        return len(getattr(self._recipe(), self._name))

    def __getitem__(self, index: Any) -> Any:
        return getattr(self._recipe(), self._name)[index]

    def __reduce__(self) -> tuple[type[tuple[_Item_co, ...]], tuple[tuple[_Item_co, ...]]]:
        return (tuple, (getattr(self._recipe(), self._name),))
