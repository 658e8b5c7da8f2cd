"""Enumerations: constants that the comment of a field groups, as in `uint8 status  # enum: STATUS_*`.

On the wire they are the integers: neither the serialized form nor the type hash depends on them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from forge.base.frozen import frozen
from forge.interfaces.model import Field, Message, Primitive, element_of
from forge.interfaces.read.literals import INTEGER_RANGES

_ANNOTATION = re.compile(r"(?:.*\s)?enum: (?P<prefix>[A-Z][A-Z0-9_]*_)\*\s*")
_TAKEN = frozenset(
    {
        *("False", "None", "True"),
        *("ContainerAllocator", "Type", "UniquePtrWithDeleter", "ConstUniquePtrWithDeleter"),
        *(f"{const}{kind}Ptr" for const in ("", "Const") for kind in ("", "Raw", "Shared", "Unique", "Weak")),
    }
)
"""Keywords of Python, and names that the structures of C++ use for other members."""
_MACROS = frozenset({"EOF", "INFINITY", "NAN", "NULL"})


@frozen
class Enumeration:
    """Named values of an integer type. The names lack the common prefix of the constants."""

    name: str
    type: Primitive
    members: tuple[tuple[str, int], ...]

    @property
    def distinct(self) -> tuple[tuple[str, int], ...]:
        """The members; of several with the same value, the first one."""
        return tuple((name, value) for value, name in {v: n for n, v in self.members[::-1]}.items())[::-1]


def enumerations(message: Message) -> Mapping[str, Enumeration]:
    """Return the enumerations of a message by the names of its fields; fields may share one."""
    by_field: dict[str, Enumeration] = {}
    for field in message.fields:
        of, prefix = element_of(field.type), annotated_prefix(field)
        if not prefix or not isinstance(of, Primitive) or of.name not in INTEGER_RANGES or of.name == "octet":
            continue
        low, high = INTEGER_RANGES[of.name]
        constants = [each for each in message.constants if each.name.startswith(prefix)]
        values = [
            each.value
            for each in constants
            if isinstance(each.value, int) and each.type != Primitive("boolean") and low <= each.value <= high
        ]
        if constants and len(values) == len(constants):
            names = [_without(prefix, each.name) for each in constants]
            if len({*names}) < len(names):
                names = [each.name for each in constants]
            name = "".join(word.capitalize() for word in prefix.lower().split("_"))
            name += "Enum" * (name in _TAKEN or any(name == constant.name for constant in message.constants))
            by_field[field.name] = Enumeration(name, of, tuple(zip(names, values, strict=True)))
    return by_field


def annotated_prefix(field: Field) -> str:
    """Return the prefix of the constants that the comment of a field names, or an empty string."""
    matches = filter(None, (_ANNOTATION.fullmatch(line) for line in field.doc if "enum:" in line))
    return next((match["prefix"] for match in matches), "")


def _without(prefix: str, name: str) -> str:
    """Return a name without the prefix, or the whole name if the rest is not a name or is a macro of C."""
    short = name.removeprefix(prefix)
    return short if short[:1].isalpha() and short not in _MACROS else name
