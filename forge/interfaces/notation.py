"""Types, values and kinds of interfaces as text, in the notation of definitions."""

from __future__ import annotations

import json
import re

from forge.base.frozen import frozen
from forge.interfaces.model import (
    Array,
    Named,
    Primitive,
    Sequence,
    String,
    Type,
    TypeName,
    Value,
    element_of,
)

KINDS = {"msg": ("message", "messages"), "srv": ("service", "services"), "action": ("action", "actions")}
"""The singular and plural name of each kind of interface."""

_IN_FILES = {"boolean": "bool", "octet": "byte", "float": "float32", "double": "float64"}
_REPLACEMENTS = {
    **{code: chr(0x2400 + code) for code in range(0x20) if chr(code) not in "\n\t"},
    **dict.fromkeys(
        (*range(0x7F, 0xA0), 0x61C, 0x200E, 0x200F, *range(0x2028, 0x202F), *range(0x2066, 0x206A)),
        "\N{REPLACEMENT CHARACTER}",
    ),
}
"""Visible symbols for control characters, including line separators and bidirectional ones."""


BIDI_CONTROLS = re.compile("[\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]")
"""Bidirectional control characters, which make code look different from what it does (CVE-2021-42574)."""


@frozen
class TypeText:
    """A type as written in definitions: its name, the interface it refers to, if any, and suffix."""

    word: str
    name: TypeName | None = None
    suffix: str = ""


def kind_of(name: TypeName) -> str:
    """Return the kind of an interface in words; an .idl file in a folder of another name is a message."""
    return KINDS.get(name.kind, KINDS["msg"])[0]


def type_text(type_: Type, package: str) -> TypeText:
    """Return a type as written in a definition of `package`."""
    suffix = ""
    match type_:
        case Array(_, size):
            suffix = f"[{size}]"
        case Sequence(_, bound):
            suffix = "[]" if bound is None else f"[<={bound}]"
    match element_of(type_):
        case Primitive(name):
            return TypeText(_IN_FILES.get(name, name), None, suffix)
        case String(wide, bound):
            limit = "" if bound is None else f"<={bound}"
            return TypeText(("wstring" if wide else "string") + limit, None, suffix)
        case Named(name):
            word = name.name if name.package == package else f"{name.package}/{name.name}"
            return TypeText(word, name, suffix)


def value_text(value: Value | None) -> str:
    """Return a value as JSON, which is close to its form in definitions; an empty text for None."""
    return "" if value is None else visible(json.dumps(value, ensure_ascii=False))


def visible(text: str) -> str:
    """Replace control characters by visible symbols, so that they cannot hide or reorder text."""
    return text if text.isascii() and text.isprintable() else text.translate(_REPLACEMENTS)
