"""Announces rebuilds of packages whose own sources did not change: one line for each other cause."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.build.up_to_date import InputKind

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from forge.build.model import Snapshot
    from forge.build.tasks import BuildPlan
    from forge.build.up_to_date import InputChange

_SHOWN = 5
"""The maximum number of lines."""


def announcements(plan: BuildPlan, snapshot: Snapshot) -> Iterator[str]:
    """Yield a line for each changed option, variable, tool or external file with the number of packages.

    Embedded packages are not counted, nor those that are only rebuilt if a dependency changes.
    """
    groups: dict[object, list[InputChange]] = {}
    for task in plan.tasks.values():
        record, change = snapshot.records.get(task.name), task.change
        if task.embedded or record is None or record.inputs.sources != task.inputs.sources:
            continue
        if change is not None and change.kind is not InputKind.OWN:
            is_option = change.kind is InputKind.OPTION
            groups.setdefault(is_option or change.names or change.text, []).append(change)
    most_first = sorted(groups.values(), key=len, reverse=True)
    for changes in most_first[:_SHOWN]:
        yield _announcement(changes)
    if rest := sum(map(len, most_first[_SHOWN:])):
        yield f"{_rebuilt(rest)} for other reasons, which '--explain' shows"


def _announcement(changes: Sequence[InputChange]) -> str:
    """Return the line for packages that are rebuilt for the same reason."""
    first, names = changes[0], dict.fromkeys(name for change in changes for name in change.names)
    text = first.text
    if first.kind is InputKind.OPTION:
        listed = f": {', '.join(names)}" if names else ""
        text = f"options changed since the last build{listed}"
    elif first.kind is InputKind.VARIABLE and len(names) > 1:
        text = f"the environment variables {', '.join(map(repr, names))} changed"
    line = f"{text}; {_rebuilt(len(changes))}"
    # Variables that sourcing sets cannot simply be unset.
    if first.kind is not InputKind.VARIABLE or any(name.endswith("PATH") for name in names):
        return line
    it = "it" if len(names) == 1 else "them"
    remedy = f"unset {it}" if first.added >= names.keys() else f"set {it} as before"
    return f"{line}; {remedy} to keep {'it' if len(changes) == 1 else 'them'}"


def _rebuilt(count: int) -> str:
    return "1 package is rebuilt" if count == 1 else f"{count} packages are rebuilt"
