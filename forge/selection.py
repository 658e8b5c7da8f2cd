"""Selection options to package names, and why the others are left out; pure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.errors import Problem, SelectionError, raise_if_any
from forge.graph import closure, reverse
from forge.model import Query, Selection
from forge.names import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence


def select(
    query: Query, ordered: Sequence[str], needs: Mapping[str, frozenset[str]]
) -> tuple[Selection, tuple[Problem, ...]]:
    """Return what `query` keeps of the names, in their topological order, and warnings.

    Every filter only deselects (workspace spec 4). A name that --packages-select or --packages-skip
    does not know is a warning; one that --packages-up-to or --packages-above does not know raises
    SelectionError, since nothing sensible is left to do.
    """
    unknown = [
        *_unknown("--packages-up-to", query.up_to, needs),
        *_unknown("--packages-above", query.above, needs),
    ]
    raise_if_any(unknown, SelectionError)
    left_out: dict[str, str] = {}
    for reason, kept in _filters(query, needs):
        for name in ordered:
            if name not in kept:
                left_out.setdefault(name, reason)
    names = tuple(name for name in ordered if name not in left_out)
    warnings = (
        *_unknown("--packages-select", query.select or (), needs),
        *_unknown("--packages-skip", query.skip, needs),
    )
    return Selection(names, left_out), warnings


def _filters(query: Query, needs: Mapping[str, frozenset[str]]) -> Iterable[tuple[str, frozenset[str]]]:
    """Yield (why the rest is left out, names kept) for each option that was given."""
    if query.skip:
        yield "named by --packages-skip", frozenset(needs) - frozenset(query.skip)
    if query.select is not None:
        yield "not named by --packages-select", frozenset(query.select)
    if query.up_to:
        yield "not needed by --packages-up-to", closure(needs, query.up_to)
    if query.above:
        yield "does not need --packages-above", closure(reverse(needs), query.above)


def _unknown(option: str, names: Iterable[str], known: Iterable[str]) -> list[Problem]:
    return [
        Problem(f"{option} names '{name}', which is not in the workspace", hint=did_you_mean(name, known))
        for name in names
        if name not in known
    ]
