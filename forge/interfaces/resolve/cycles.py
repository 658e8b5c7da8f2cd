"""Checks of nested messages: cycles, and the depth of nesting."""

from __future__ import annotations

from collections import defaultdict
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from typing import TYPE_CHECKING

from forge.base.errors import Problem
from forge.interfaces.model import Named, element_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.interfaces.model import Field, Message, TypeName

MAX_NESTING = 100
"""The maximum nesting of messages; importing a message imports all nested ones recursively."""

_MAX_REPORTED = 20
"""The maximum number of cycles that are reported for a package."""


def nesting_problems(messages: Mapping[TypeName, Message]) -> list[Problem]:
    """Return a problem if messages are nested too deeply for generated code."""
    below = {
        name: {e.name for member in message.fields if isinstance(e := element_of(member.type), Named)}
        for name, message in messages.items()
    }
    depth: dict[TypeName, int] = {}
    for name in TopologicalSorter(below).static_order():
        depth[name] = 1 + max((depth[inner] for inner in below.get(name, ())), default=0)
        if depth[name] > MAX_NESTING:
            message = f"messages in '{name}' are nested more than {MAX_NESTING} levels deep"
            place = next((member.place for member in messages[name].fields), None)
            hint = "reduce the nesting: Python could not import such a message, nor a compiler include it"
            return [Problem(message, place, hint)]
    return []


def cycle_problems(messages: Mapping[TypeName, Message]) -> list[Problem]:
    """Return a problem for each cycle of nested messages."""
    needs: dict[TypeName, dict[TypeName, Field]] = defaultdict(dict)
    for name, message in messages.items():
        for member in message.fields:
            element = element_of(member.type)
            if isinstance(element, Named) and element.name in messages:
                needs[name].setdefault(element.name, member)
    problems: list[Problem] = []
    while len(problems) < _MAX_REPORTED and (cycle := _cycle(needs)):
        path = " -> ".join(f"{name.package}/{name.name}" for name in cycle)
        place = needs[cycle[0]][cycle[1]].place
        problems.append(Problem(f"a message cannot contain itself: {path}", place))
        for container, contained in pairwise(cycle):
            del needs[container][contained]
    return problems


def _cycle(needs: Mapping[TypeName, Mapping[TypeName, Field]]) -> list[TypeName] | None:
    """Return a cycle, with its first member repeated at the end, or None."""
    try:
        TopologicalSorter(needs).prepare()
    except CycleError as error:
        # graphlib follows the edges in the opposite direction of 'contains'.
        return list(reversed(error.args[1]))
    return None
