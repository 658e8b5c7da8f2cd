"""What the texts of generated writers and readers are put together from: names, lines, struct codes."""

from __future__ import annotations

import builtins
import keyword
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from forge.base.frozen import frozen
from forge.interfaces.python.types import TYPE_CODES
from forge.interfaces.wire.layout import (
    InlineArray,
    Length,
    Loop,
    MessageCall,
    Phase,
    PrimitiveElements,
    Run,
    Scalar,
    StringData,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from forge.interfaces.wire.layout import LayoutStep, Member, Path

WIDTH: Final = 100
HEADER_SIZE: Final = 4

CODES: Final = {**TYPE_CODES, "boolean": "?", "octet": "c", "char": "B", "wchar": "I"}
"""The struct module's letter for each primitive type."""

_RESERVED: Final = frozenset(
    {
        *keyword.kwlist,
        *dir(builtins),
        *("append", "buffer", "encapsulation", "limit", "nul", "o", "parts", "size", "struct", "view"),
    }
)


@frozen
class PackedGroup:
    """What one Struct moves: a run, or a string with the run before it and the one behind it.

    The run before is missing where the last Packed has moved it already, together with the string's length.
    """

    before: Run | None
    chars: StringData | None
    after: Run | None
    start: Phase

    @property
    def fixed(self) -> bool:
        """Tell if all padding is known once the string's length is."""
        end = self.start if self.before is None else self.before.end(self.start)
        known = self.before is None or self.before.is_fixed(self.start)
        # The length is known when the Struct is chosen, so no more gets lost than the offset lacks.
        return known and (self.after is None or self.after.is_fixed(Phase(end.modulus, 0)))


Group = PackedGroup | StringData | PrimitiveElements | Loop | MessageCall
"""A step, with runs and narrow strings gathered; the Chars that are left are wide."""


def group_steps(steps: Sequence[LayoutStep]) -> tuple[Group, ...]:
    """Gather the steps of a layout into what single statements can move."""
    gathered: list[Group] = []
    position = 0
    while position < len(steps):
        step = steps[position]
        before = step if isinstance(step, Run) else None
        position += before is not None
        chars = steps[position] if position < len(steps) else None
        if isinstance(chars, StringData) and not chars.type.wide:
            position += 1
            after = steps[position] if position < len(steps) else None
            after = after if isinstance(after, Run) else None
            position += after is not None
            gathered.append(PackedGroup(before, chars, after, step.start))
        elif before:
            gathered.append(PackedGroup(before, None, None, before.start))
        elif not isinstance(step, Run):
            gathered.append(step)
            position += 1
    return tuple(gathered)


def struct_format(run: Run | None) -> str:
    """Return a run as the run time spells it: a letter per value, '9d' for a block, 'x' for a hidden byte."""
    return " ".join(map(_code, run.members)) if run else ""


def _code(member: Member) -> str:
    match member:
        case Scalar(hidden=True):
            return "x"
        case Scalar(_, type_):
            return CODES[type_.name]
        case InlineArray(_, type_, of):
            return f"{type_.size}{CODES[of.name]}"
        case Length():
            return "I"


def wrap_arguments(start: str, items: Sequence[str], end: str) -> list[str]:
    """Return 'start item, item end' on one line, or with a line for each item if it is too long."""
    line = f"{start}{', '.join(items)}{end}"
    if len(line) <= WIDTH:
        return [line]
    return [start, *(f"    {item}," for item in items), end]


def assignment(start: str, targets: Sequence[str], end: str) -> list[str]:
    """Return the same for the targets of an assignment, which need parentheses on several lines."""
    line = f"{start}{', '.join(targets)}{end}"
    return [line] if len(line) <= WIDTH else wrap_arguments(f"{start}(", targets, f"){end}")


@dataclass(slots=True)
class Names:
    """The local names of a function: each is used for one thing, and none of `others` at all."""

    taken: set[str] = field(default_factory=set)
    others: Collection[str] = ()
    """Shared by many functions, since there may be thousands of them."""

    def new(self, wish: str) -> str:
        """Return a name like the wish that nothing else has."""
        name, number = wish, 1
        while name in self.taken or name in self.others or name in _RESERVED:
            number += 1
            name = f"{wish}_{number}"
        self.taken.add(name)
        return name

    def of(self, path: Path, root: str) -> str:
        """Return a new name for what lies at a path."""
        return self.new("_".join(path) or root)


@dataclass(slots=True)
class FunctionSource:
    """A function in the making: the tables it looks up, made beforehand, and its lines."""

    names: Names
    tables: list[str] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)
    _depth: int = 0
    _known: dict[str, str] = field(default_factory=dict)

    def add(self, *lines: str) -> None:
        """Add lines at the present depth."""
        self.lines += ["    " * self._depth + line for line in lines]

    def deeper(self) -> None:
        """Begin a block."""
        self._depth += 1

    def back(self) -> None:
        """End a block."""
        self._depth -= 1

    def table(self, wish: str, expression: str) -> str:
        """Return the name of a table made by that expression; one expression makes one table."""
        if expression not in self._known:
            name = self.names.new(wish)
            self._known[expression] = name
            self.tables.append(f"{name} = {expression}")
        return self._known[expression]


def singular(plural: str) -> str:
    """Return a word for one element of a collection."""
    if plural.endswith("ies"):
        return f"{plural[:-3]}y"
    regular = plural.endswith("s") and not plural.endswith(("ss", "us")) and plural != "s"
    return plural[:-1] if regular else f"{plural}_item"
