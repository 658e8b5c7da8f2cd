"""The target 'typescript': types of messages as JSON, as `rosidl_runtime_py` converts them.

A module contains the parts of one message, service or action, and imports the types that it refers to.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping

from forge.base.templating import render
from forge.interfaces.model import (
    Array,
    Catalog,
    Field,
    File,
    Interface,
    Named,
    Primitive,
    Sequence,
    String,
    Type,
    TypeName,
    Value,
    element_of,
    nested_types,
    sections_of,
)
from forge.interfaces.notation import BIDI_CONTROLS

_SAFE = 2**53 - 1
"""The largest integer up to which numbers of JavaScript represent all integers exactly."""


def files(catalog: Catalog) -> Iterator[File]:
    """Yield 'PACKAGE/KIND/NAME.ts' for each interface."""
    for name, interface in catalog.interfaces.items():
        yield File(f"{name.package}/{name.kind}/{name.name}.ts", _module(interface))


def _module(interface: Interface) -> str:
    messages = sections_of(interface)
    own = {message.name for message in messages}
    others = sorted(nested_types(messages) - own)
    short_names = [name.name for name in (*own, *others)]
    names = {name: name.name for name in own} | {
        name: name.name if short_names.count(name.name) == 1 else f"{name.package}_{name.kind}_{name.name}"
        for name in others
    }
    return render(
        "typescript/templates/module.ts.j2",
        source=str(interface.name),
        imports=[(name, names[name], _path(name, interface.name)) for name in others],
        messages=[
            {
                "name": message.name.name,
                "doc": _comment(message.doc),
                "fields": [
                    (field.name, _type(field.type, names), _comment(_described(field)))
                    for field in message.fields
                ],
                "constants": [
                    (constant.name, _literal(constant.value), _comment(constant.doc))
                    for constant in message.constants
                ],
            }
            for message in messages
        ],
    )


def _path(name: TypeName, user: TypeName) -> str:
    if (name.package, name.kind) == (user.package, user.kind):
        return f"./{name.name}"
    return f"../../{name.package}/{name.kind}/{name.name}"


def _type(type_: Type, names: Mapping[TypeName, str]) -> str:
    match element_of(type_):
        case Named(name):
            word = names[name]
        case String() | Primitive("char" | "wchar"):
            word = "string"
        case Primitive("boolean"):
            word = "boolean"
        case Primitive("octet"):  # rosidl_runtime_py uses a character, others a number
            word = "(number | string)" if isinstance(type_, Array | Sequence) else "number | string"
        case _:
            word = "number"
    return f"{word}[]" if isinstance(type_, Array | Sequence) else word


def _described(field: Field) -> Iterator[str]:
    yield from field.doc
    if field.unit:
        yield f"[{field.unit}]"
    match field.type:
        case Array(_, size):
            yield f"{size} elements"
        case Sequence(_, int(bound)):
            yield f"at most {bound} elements"
        case _:
            pass


def _literal(value: Value) -> str:
    if isinstance(value, bool | str):
        return json.dumps(value)
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    exceeds = isinstance(value, int) and abs(value) > _SAFE
    return f"{value}n" if exceeds else repr(value)


def _comment(lines: Iterable[str]) -> list[str]:
    """Return the lines of a comment, without text that would end the comment."""
    texts = (BIDI_CONTROLS.sub(" ", line).replace("*/", "* /").rstrip() for line in lines)
    comment = ["".join(sign if sign.isprintable() else " " for sign in text) for text in texts]
    return comment if any(comment) else []
