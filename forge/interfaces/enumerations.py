"""Enumerations: constants that the comment of a field groups, as in `uint8 status  # enum: STATUS_*`.

On the wire they are the integers: neither the serialized form nor the type hash knows of them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from forge.base.errors import Problem
from forge.base.frozen import frozen
from forge.interfaces.model import Field, Message, Primitive, element_of
from forge.interfaces.read.literals import INTEGER_RANGES

_ANNOTATION = re.compile(r"(?:.*\s)?enum: (?P<prefix>[A-Z][A-Z0-9_]*_)\*\s*")
_TAKEN = frozenset({"Type", "Ptr", "RawPtr", "SharedPtr", "UniquePtr", "WeakPtr"})
"""What structures in C++ call other things."""


@frozen
class Enumeration:
    """Named values of an integer type. The names lack the common prefix of the constants."""

    name: str
    type: Primitive
    members: tuple[tuple[str, int], ...]

    @property
    def distinct(self) -> tuple[tuple[str, int], ...]:
        """The members, of those with one value the first."""
        return tuple((name, value) for value, name in {v: n for n, v in self.members[::-1]}.items())[::-1]


def enumerations(message: Message) -> Mapping[str, Enumeration]:
    """Return the enumerations of a message by the names of its fields; fields may share one."""
    found: dict[str, Enumeration] = {}
    for field in message.fields:
        of, prefix = element_of(field.type), _prefix(field)
        if not prefix or not isinstance(of, Primitive) or of.name not in INTEGER_RANGES or of.name == "octet":
            continue
        low, high = INTEGER_RANGES[of.name]
        values = {c.name: c.value for c in message.constants if c.name.startswith(prefix)}
        members = [
            (_without(prefix, name), value)
            for name, value in values.items()
            if isinstance(value, int) and not isinstance(value, bool) and low <= value <= high
        ]
        if members and len(members) == len(values):
            name = "".join(word.capitalize() for word in prefix.lower().split("_"))
            name += "Enum" * (name in _TAKEN or any(name == constant.name for constant in message.constants))
            found[field.name] = Enumeration(name, of, tuple(members))
    return found


def unused_annotations(message: Message) -> Iterator[Problem]:
    """Yield a problem for each annotation that makes no enumeration."""
    found = enumerations(message)
    for field in message.fields:
        if (prefix := _prefix(field)) and field.name not in found:
            text = f"'enum: {prefix}*' makes no enumeration of '{field.name}'"
            hint = (
                f"the field and all constants '{prefix}*' of the message must be integers, and fit its type"
            )
            yield Problem(text, field.place, hint)


def _prefix(field: Field) -> str:
    matches = filter(None, (_ANNOTATION.fullmatch(line) for line in field.doc if "enum:" in line))
    return next((match["prefix"] for match in matches), "")


def _without(prefix: str, name: str) -> str:
    """Return a name without the prefix, unless that would not be a name."""
    short = name.removeprefix(prefix)
    return short if short[:1].isalpha() else name
