"""From packages, selection and snapshot to the plan of a build; pure."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import TYPE_CHECKING

from forge import __version__
from forge.errors import Place, Problem, WorkspaceError, raise_if_any
from forge.graph import closures, ordered_names
from forge.model import BuildPlan, Task
from forge.names import did_you_mean
from forge.recipes import RECIPES

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from forge.model import Package, Selection, Snapshot
    from forge.provision import Provision
    from forge.recipes.kitchen import Kitchen


def wanted_names(
    selection: Selection, provision: Provision, needs: Mapping[str, frozenset[str]]
) -> tuple[str, ...]:
    """Return the selected packages and the embedded ones below them, in topological order."""
    ordered = ordered_names(needs)
    below = closures(needs, ordered)
    selected = frozenset(selection.names)
    reached = selected.union(*(below[name] for name in selected))
    return tuple(
        name
        for name in ordered
        if name in reached and (name in selected or provision.packages[name].embedded)
    )


def make_plan(names: Sequence[str], provision: Provision, snapshot: Snapshot, kitchen: Kitchen) -> BuildPlan:
    """Return the tasks for `names`, which are in topological order, and those that are fresh.

    An embedded package is fresh when nothing that went into it changed; others run every time.
    Raises WorkspaceError for build types that nobody knows and for needs that are not installed.
    """
    ordered = ordered_names(provision.needs)
    below = closures(provision.needs, ordered)
    position = {name: index for index, name in enumerate(ordered)}
    raise_if_any(
        (*_unknown_types(names, provision), *_not_installed(names, provision, below, snapshot)),
        WorkspaceError,
    )
    kitchen = replace(kitchen, configured=snapshot.configured)
    tasks: dict[str, Task] = {}
    fresh: list[str] = []
    digests: dict[str, str] = {}
    for name in names:
        needs = tuple(sorted(below[name], key=position.__getitem__))
        task = _task(provision.packages[name], needs, snapshot, kitchen)
        digests[name] = _digest(task, [digests.get(need, "") for need in needs], snapshot, kitchen)
        task = replace(task, digest=digests[name])
        if task.embedded and name in snapshot.installed and snapshot.records.get(name) == task.digest:
            fresh.append(name)
        else:
            tasks[name] = task
    return BuildPlan(tasks, tuple(fresh))


def _task(package: Package, needs: tuple[str, ...], snapshot: Snapshot, kitchen: Kitchen) -> Task:
    recipe = RECIPES[package.build_type](package, kitchen)
    if not package.embedded:
        reason = "its sources are watched by its own build tool"
    elif package.name in snapshot.records:
        reason = "forge, an option or a package below it changed"
    else:
        reason = "it was not built here yet"
    return Task(
        name=package.name,
        package=package,
        prefix=kitchen.layout.prefix(package.name),
        build_dir=kitchen.layout.build_dir(package.name),
        needs=needs,
        steps=recipe.steps,
        digest="",
        reason=reason,
        files=recipe.files,
    )


def _digest(task: Task, below: Iterable[str], snapshot: Snapshot, kitchen: Kitchen) -> str:
    """Return a digest of all that an embedded package is made from."""
    said = (
        __version__,
        snapshot.sources.get(task.name, ""),
        str(task.prefix),
        str(kitchen.layout.merged),
        str(kitchen.python),
        str(kitchen.cmake),
        *kitchen.cmake_args,
        *(text for _, text in task.files),
        *below,
    )
    return hashlib.sha256("\0".join(said).encode()).hexdigest()


def _unknown_types(names: Iterable[str], provision: Provision) -> Iterable[Problem]:
    for name in names:
        package = provision.packages[name]
        if package.build_type not in RECIPES:
            hint = did_you_mean(package.build_type, RECIPES)
            message = f"no recipe for the build type '{package.build_type}' of '{name}'"
            yield Problem(
                message, Place(package.manifest.path), hint or f"forge knows {', '.join(sorted(RECIPES))}"
            )


def _not_installed(
    names: Sequence[str],
    provision: Provision,
    below: Mapping[str, frozenset[str]],
    snapshot: Snapshot,
) -> Iterable[Problem]:
    """Yield the selected packages whose needs are neither installed nor about to be."""
    available = snapshot.installed | frozenset(names)
    for name in names:
        absent = sorted(need for need in below[name] if need not in available and need in provision.packages)
        if absent:
            quoted = ", ".join(f"'{need}'" for need in absent)
            verb = "is" if len(absent) == 1 else "are"
            message = f"'{name}' needs {quoted}, which {verb} not built yet"
            yield Problem(message, hint=f"build them too: forge build --packages-up-to {name}")
