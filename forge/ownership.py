"""Who installed which file of a merged tree: packages that install one file with different bytes.

The tree shows only what came last. So each package's build folder keeps digests of what it installed.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from forge.digests import contents_of
from forge.errors import Problem
from forge.files import write_if_changed

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping
    from pathlib import Path

    from forge.digests import FileTable
    from forge.layout import Layout
    from forge.model import BuildPlan, Record

NOTE = "forge_installed.json"


def note_contents(build: Path, files: Iterable[str], table: FileTable) -> None:
    """Write down what a package has just installed, before another one may write over it."""
    # The bytes count, not the rights before them, nor where a link leads.
    said = {path: content.rpartition(" ")[2] for path, content in contents_of(files, table).items()}
    write_if_changed(build / NOTE, json.dumps(said))


def clashes(layout: Layout, records: Mapping[str, Record], names: Collection[str]) -> tuple[Problem, ...]:
    """Return a problem for each file that one of `names` and another package install differently."""
    return tuple(_problem(path, among, layout) for path, among in disputed(layout, records, names).items())


def disputed(
    layout: Layout, records: Mapping[str, Record], names: Collection[str]
) -> Mapping[str, list[str]]:
    """Return, by path, the packages that install a file differently, one of `names` among them."""
    if not layout.merged:
        return {}
    owners: dict[str, list[str]] = {}
    for name in sorted(records):
        if records[name].complete:
            for path in records[name].files:
                owners.setdefault(path, []).append(name)
    shared = {
        path: among
        for path, among in sorted(owners.items())
        if len(among) > 1 and not frozenset(names).isdisjoint(among)
    }
    notes = {name: _note(layout.build_dir(name)) for name in {n for among in shared.values() for n in among}}
    return {
        path: among
        for path, among in shared.items()
        if len({notes[name].get(path, "") for name in among}) > 1
    }


def owned_by_others(name: str, paths: frozenset[str], records: Mapping[str, Record]) -> frozenset[str]:
    """Return those of a package's paths that other packages have installed, too."""
    others = (record for other, record in list(records.items()) if other != name)
    return frozenset[str]().union(*(paths.intersection(record.files) for record in others))


def rivals(plan: BuildPlan, layout: Layout, records: Mapping[str, Record]) -> frozenset[str]:
    """Return the fresh packages of a plan that install a file differently from one that is built.

    They must be installed again: only after all of them, in order, is there what a clean build would leave.
    """
    found = disputed(layout, records, plan.tasks)
    return frozenset(name for among in found.values() for name in among).intersection(plan.fresh)


def overwritten(plan: BuildPlan, layout: Layout, records: Mapping[str, Record]) -> frozenset[str]:
    """Return the packages that may have lost a file to one of a plan, as they would in a clean build."""
    found: set[str] = set()
    for among in disputed(layout, records, plan.tasks).values():
        built = [plan.tasks[name] for name in among if name in plan.tasks]
        found.update(
            name for name in among if name in plan.tasks or any(name in task.needs for task in built)
        )
    return frozenset(found)


def _note(build: Path) -> Mapping[str, str]:
    """Return what a package has installed; nothing when nobody knows."""
    try:
        said = json.loads((build / NOTE).read_bytes())
    except (OSError, ValueError, RecursionError):
        return {}
    return said if isinstance(said, dict) else {}


def _problem(path: str, among: list[str], layout: Layout) -> Problem:
    who = f"{', '.join(map(repr, among[:-1]))} and {among[-1]!r}"
    relative = path.removeprefix(f"{layout.install}/")
    hint = "what was built last is there; rename it in one of them, or build without '--merge-install'"
    return Problem(f"{who} install '{relative}', with different contents", hint=hint)
