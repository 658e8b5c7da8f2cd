"""Building blocks of generated readers and writers: local names, lines, formats of the struct module."""

from __future__ import annotations

import builtins
import keyword
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from forge.base.frozen import frozen
from forge.interfaces.model import TypeName
from forge.interfaces.python.types import TYPE_CODES, module_name
from forge.interfaces.wire.layout import (
    InlineArray,
    LayoutStep,
    Length,
    Loop,
    Member,
    MessageCall,
    Phase,
    PrimitiveElements,
    Run,
    Scalar,
    StringData,
)

WIDTH: Final = 100
HEADER_SIZE: Final = 4

CODES: Final = {**TYPE_CODES, "boolean": "?", "octet": "c", "char": "B", "wchar": "I"}
"""The format character of the struct module for each primitive type."""

CONVERTED: Final = {"boolean": "flags", "octet": "octets", "char": "chars", "wchar": "wchars"}
"""The types whose collections are neither numpy arrays nor arrays, and the suffix of run-time functions."""

_RESERVED: Final = frozenset(
    {
        *keyword.kwlist,
        *dir(builtins),
        *("append", "buffer", "encapsulation", "limit", "nul", "o", "parts", "size", "struct", "view"),
    }
)


@frozen
class PackedGroup:
    """Data that one Struct packs: a run, or a string with the runs before and after it.

    The run before is None if the previous group contains it, together with the length of the string.
    """

    before: Run | None
    chars: StringData | None
    after: Run | None
    start: Phase

    @property
    def fixed(self) -> bool:
        """Return True if all padding is known once the length of the string is."""
        end = self.start if self.before is None else self.before.end(self.start)
        is_known = self.before is None or self.before.is_fixed(self.start)
        # The Struct is chosen by the length, so padding after the string is unknown only if the padding
        # before it is.
        return is_known and (self.after is None or self.after.is_fixed(Phase(end.modulus, 0)))


Group = PackedGroup | StringData | PrimitiveElements | Loop | MessageCall
"""A step, or several in a PackedGroup; the remaining StringData are wide strings."""


def group_steps(steps: Sequence[LayoutStep]) -> tuple[Group, ...]:
    """Group the steps of a layout so that a single statement can move each group."""
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
    """Return the format of a run, such as 'I 9d x': '9d' is an array, 'x' a hidden byte."""
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
    """Return 'start item, item end' on one line, or on one line per item if it is too long."""
    line = f"{start}{', '.join(items)}{end}"
    if len(line) <= WIDTH:
        return [line]
    return [start, *(f"    {item}," for item in items), end]


def assignment(start: str, targets: Sequence[str], end: str) -> list[str]:
    """Return an assignment to `targets`; over several lines, they need parentheses."""
    line = f"{start}{', '.join(targets)}{end}"
    return [line] if len(line) <= WIDTH else wrap_arguments(f"{start}(", targets, f"){end}")


@dataclass(slots=True)
class Module:
    """Collects the classes and modules that a generated module refers to."""

    own: frozenset[TypeName]
    all_classes: frozenset[str]
    """The names of all classes of the catalog, one set for all modules."""
    classes: dict[TypeName, str] = field(default_factory=dict)
    modules: dict[str, str] = field(default_factory=dict)

    def class_of(self, name: TypeName) -> str:
        """Return the local name of a class."""
        if name not in self.classes:
            taken = name.name in self.classes.values()
            self.classes[name] = f"_{name.package}_{name.kind}_{name.name}" if taken else name.name
        return self.classes[name]

    def factory_call(self, prefix: str, name: TypeName) -> str:
        """Return the call that creates the reader or writer of a large message."""
        if name in self.own:
            return f"{prefix}_{name.name}()"
        path = f"{module_name(name)}__cdr"
        alias = self.modules.setdefault(path, f"_{path.replace('.', '_')}")
        return f"{alias}.{prefix}_{name.name}()"


@dataclass(slots=True)
class FunctionSource:
    """The source of a generated function: its lines, and the tables that it looks up."""

    module: Module
    tables: list[str] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)
    _depth: int = 0
    _known: dict[str, str] = field(default_factory=dict)
    _names: set[str] = field(default_factory=lambda: {"message", "read", "write"})

    def name(self, preferred: str) -> str:
        """Return an unused local name: the preferred one, if possible with no number appended."""
        name, number = preferred, 1
        while name in self._names or name in self.module.all_classes or name in _RESERVED:
            number += 1
            name = f"{preferred}_{number}"
        self._names.add(name)
        return name

    def add(self, *lines: str) -> None:
        self.lines += ["    " * self._depth + line for line in lines]

    def reject_if(self, condition: str) -> None:
        """Emit the lines that leave data to the generic codec, which reports errors."""
        self.add(f"if {condition}:", "    raise _pieces.Refused")

    def indent(self) -> None:
        self._depth += 1

    def dedent(self) -> None:
        self._depth -= 1

    def table(self, preferred: str, expression: str) -> str:
        """Return the name of the table that the expression creates, once for each expression."""
        if expression not in self._known:
            name = self.name(preferred)
            self._known[expression] = name
            self.tables.append(f"{name} = {expression}")
        return self._known[expression]


def singular(plural: str) -> str:
    """Return a name for one element of a collection."""
    if plural.endswith("ies"):
        return f"{plural[:-3]}y"
    regular = plural.endswith("s") and not plural.endswith(("ss", "us")) and plural != "s"
    return plural[:-1] if regular else f"{plural}_item"
