"""From packages, selection and snapshot to the plan of a build; pure."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING

from forge.deferred import Deferred
from forge.errors import Place, Problem, WorkspaceError, raise_if_any
from forge.freshness import CONFIGURING, FOR_COMPILERS, Extra, Outlook, why_at_all, why_different
from forge.frozen import frozen
from forge.graph import closure, closures, ordered_names, round_about
from forge.model import BuildPlan, Mark, Parts, Task
from forge.names import did_you_mean
from forge.recipes import RECIPES

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

    from forge.model import Package, Pairs, Record, Selection, Snapshot, Step
    from forge.provision import Provision
    from forge.recipes.kitchen import Kitchen


def wanted_names(
    selection: Selection, provision: Provision, needs: Mapping[str, frozenset[str]]
) -> tuple[str, ...]:
    """Return the selected packages and the embedded ones below them, in topological order."""
    ordered = ordered_names(needs)
    selected = frozenset(selection.names)
    reached = closure(needs, selected)
    return tuple(
        name
        for name in ordered
        if name in reached and (name in selected or provision.packages[name].embedded)
    )


def make_plan(
    names: Sequence[str],
    provision: Provision,
    snapshot: Snapshot,
    kitchen: Kitchen,
    standing: Standing,
) -> tuple[BuildPlan, Outlook]:
    """Return the tasks for `names`, which are in topological order, and what the rest gives.

    A package of `names` without a task is fresh. Raises WorkspaceError for build types that nobody knows
    and for needs that are not installed.
    """
    ordered = ordered_names(provision.needs)
    read_from = _read_from(provision, snapshot)
    if read_from:
        observed = {name: needs | read_from.get(name, frozenset()) for name, needs in provision.needs.items()}
        wanted = frozenset(names)
        names = tuple(name for name in ordered_names(observed) if name in wanted)
    closed = closures(provision.needs, ordered)
    raise_if_any(
        (*_unknown_types(names, provision), *_not_installed(names, provision, closed, snapshot)),
        WorkspaceError,
    )
    outlook = Outlook(provision.needs, {name: mark.digest for name, mark in snapshot.installed.items()})
    tasks: dict[str, Task] = {}
    for name in names:
        needs = closed.below(name)
        package = provision.packages[name]
        given = outlook.needs_of(name, needs)
        parts = _parts(package, given or (), snapshot, kitchen, standing)
        reason = _reason(parts, given, snapshot, forced=standing.forced(name), name=name)
        after = read_from.get(name, frozenset()) & tasks.keys()
        if reason is not None or given is None or after:
            outlook.expect(name)
            anew = standing.forced(name) == "--force"
            task = replace(_task(package, needs, parts, snapshot, kitchen), after=after, anew=anew)
            tasks[name] = task if reason is None else replace(task, reason=reason, conditional=False)
    return BuildPlan(tasks, tuple(name for name in names if name not in tasks)), outlook


def _read_from(provision: Provision, snapshot: Snapshot) -> dict[str, frozenset[str]]:
    """Return the packages of which others read files without declaring that they need them.

    They go first where that is possible: on a circle what is declared wins.
    """
    found = {
        name: frozenset(record.read_from) & provision.needs.keys() - {name}
        for name, record in snapshot.records.items()
        if record.read_from and name in provision.needs
    }
    if not found:
        return {}
    weak = {name: found.get(name, frozenset()) for name in provision.needs}
    both = {name: needs | weak[name] for name, needs in provision.needs.items()}
    circles = round_about(both, weak)
    return {name: others - circles.get(name, frozenset()) for name, others in found.items()}


@frozen
class Standing:
    """What holds for every package of a build; and which option forces whom.

    `underlays` is a digest of what packages could be found by below the workspace.
    """

    forge: str
    tools: Pairs
    environment: Pairs
    underlays: str = ""
    force: str = ""
    selected: frozenset[str] = frozenset()
    named: Callable[[Package, Snapshot], Extra] = lambda *_: Extra()
    """What a package depends on beside all this, since its text or an option names it."""

    def tools_of(self, package: Package) -> Pairs:
        """Return the tools that a package is made with: those that forge brings along compile nothing."""
        return tuple(pair for pair in self.tools if not package.embedded or pair[0] in CONFIGURING)

    def environment_of(self, package: Package) -> Pairs:
        """Return the variables that count for a package."""
        return tuple(pair for pair in self.environment if not (package.embedded and pair[0] in FOR_COMPILERS))

    def forced(self, name: str) -> str:
        """Return the option by which the user wants the package built though it may be fresh, or ''."""
        return self.force if name in self.selected else ""


def settled(task: Task, outlook: Outlook, record: Record | None, *, reads_other: bool = False) -> Task | None:
    """Return the task complete with what its needs give now, or None when that makes it fresh.

    To be asked once all that the task needs has ended. `reads_other` tells that a file outside of the
    package which its last build read says something else now.
    """
    given = outlook.needs_of(task.name, task.needs)
    task = replace(task, parts=replace(task.parts, needs=given or ()))
    if reads_other:
        return task
    if task.conditional and record is not None and why_different(task.parts, record.parts) is None:
        return None
    return task


def make_whole_plan(  # noqa: PLR0913, PLR0917  (as make_plan, and one question)
    names: Sequence[str],
    provision: Provision,
    snapshot: Snapshot,
    kitchen: Kitchen,
    standing: Standing,
    rivals: Callable[[BuildPlan], frozenset[str]],
) -> tuple[BuildPlan, Outlook]:
    """Return the same, with the packages that are built because others are.

    `rivals(plan)` are up-to-date packages that install a file which a package of the plan will write over:
    they are installed again after it.
    """
    plan, outlook = make_plan(names, provision, snapshot, kitchen, standing)
    while found := rivals(plan):
        snapshot = replace(snapshot, installed={**snapshot.installed, **dict.fromkeys(found, Mark())})
        plan, outlook = make_plan(names, provision, snapshot, kitchen, standing)
    return plan, outlook


def _parts(package: Package, given: Pairs, snapshot: Snapshot, kitchen: Kitchen, standing: Standing) -> Parts:
    more = standing.named(package, snapshot)
    return Parts(
        forge=standing.forge,
        options=(*RECIPES[package.build_type].options(package, kitchen.of(package)), *more.options),
        tools=(*standing.tools_of(package), *more.tools),
        environment=(*standing.environment_of(package), *more.environment),
        sources=snapshot.sources[package.name].digest,
        needs=given,
        underlays=standing.underlays,
    )


def _reason(parts: Parts, given: Pairs | None, snapshot: Snapshot, *, forced: str, name: str) -> str | None:
    """Return why the package must be built, or None when that depends on pending ones, or is not so."""
    record = snapshot.records.get(name)
    reason = why_at_all(name, record, snapshot)
    if reason is not None or record is None:
        return reason
    if given is None:
        parts = replace(parts, needs=record.parts.needs)
    different = why_different(parts, record.parts, snapshot.news.get(name, ()))
    return different or (f"asked for by {forced}" if forced else None)


def _task(
    package: Package,
    needs: Collection[str],
    parts: Parts,
    snapshot: Snapshot,
    kitchen: Kitchen,
) -> Task:
    """Return the task as it is when everything depends on what its needs come out as."""
    name = package.name
    record = snapshot.records.get(name)
    recipe = cache(partial(RECIPES[package.build_type].recipe, package, kitchen.of(package)))
    earlier = tuple(sorted({*(record.files if record else ()), *snapshot.listed.get(name, ())}))
    return Task(
        name=name,
        package=package,
        prefix=kitchen.layout.prefix(name),
        build_dir=kitchen.layout.build_dir(name),
        needs=needs,
        steps=Deferred(lambda: _replacing(earlier, recipe().steps)),
        reason="a package that it needs is built before it and may come out different",
        parts=parts,
        sources=snapshot.sources[name],
        files=Deferred(lambda: recipe().files),
        conditional=True,
        earlier=earlier,
        reconfigure=kitchen.force_configure or kitchen.clean_cache,
    )


def _replacing(earlier: tuple[str, ...], steps: tuple[Step, ...]) -> tuple[Step, ...]:
    """Return the steps with what the last of them, the installation, did before."""
    return (*steps[:-1], replace(steps[-1], replaces=earlier))


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
    available = snapshot.present | frozenset(names)
    for name in names:
        absent = sorted(need for need in below[name] if need not in available and need in provision.packages)
        if absent:
            quoted = ", ".join(f"'{need}'" for need in absent)
            verb = "is" if len(absent) == 1 else "are"
            message = f"'{name}' needs {quoted}, which {verb} not built yet"
            yield Problem(message, hint=f"build them too: forge build --packages-up-to {name}")
