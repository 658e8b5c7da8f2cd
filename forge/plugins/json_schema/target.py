"""The target 'jsonschema': schemas (draft 2020-12) of messages as JSON, as `rosidl_runtime_py` converts them.

A file contains all definitions that it refers to.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from forge.interfaces.model import (
    Array,
    Catalog,
    Element,
    Field,
    File,
    Message,
    Named,
    Primitive,
    Sequence,
    String,
    Type,
    TypeName,
    Value,
    nested_types,
    sections_of,
)

_DIALECT = "https://json-schema.org/draft/2020-12/schema"
_BITS = {"int8": 8, "int16": 16, "int32": 32, "int64": 64}


def files(catalog: Catalog) -> Iterator[File]:
    """Yield 'PACKAGE/KIND/NAME.schema.json' for each message, and for each part of a service or an action."""
    for interface in catalog.interfaces.values():
        for message in sections_of(interface):
            name = message.name
            below = _below(message, catalog.known)
            schema = {"$schema": _DIALECT, "title": str(name), **_object(message)}
            if below:
                schema["$defs"] = {str(each): _object(catalog.known[each]) for each in sorted(below)}
            text = json.dumps(schema, indent=2, ensure_ascii=False) + "\n"
            yield File(f"{name.package}/{name.kind}/{name.name}.schema.json", text)


def _below(message: Message, messages: Mapping[TypeName, Message]) -> set[TypeName]:
    names: set[TypeName] = set()
    pending = [message]
    while pending:
        new = nested_types([pending.pop()]) - names
        names |= new
        pending += [messages[name] for name in new]
    return names


def _object(message: Message) -> dict[str, Any]:
    schema: dict[str, Any] = {"type": "object"}
    if text := _text(message.doc):
        schema["description"] = text
    schema["properties"] = {field.name: _field(field) for field in message.fields}
    schema["required"] = [field.name for field in message.fields]
    schema["additionalProperties"] = False
    if message.constants:
        schema["x-constants"] = {
            each.name: each.value if _is_json(each.value) else str(each.value) for each in message.constants
        }
    return schema


def _field(field: Field) -> dict[str, Any]:
    schema = _type(field.type)
    if text := _text((*field.doc, f"[{field.unit}]" if field.unit else "")):
        schema["description"] = text
    if field.default is not None and _is_json(field.default):
        schema["default"] = field.default
    return schema


def _is_json(value: Value) -> bool:
    """Return whether JSON can represent a value, unlike infinity and NaN."""
    values = value if isinstance(value, tuple) else (value,)
    return all(not isinstance(each, float) or math.isfinite(each) for each in values)


def _text(doc: Iterable[str]) -> str:
    return " ".join(line.strip() for line in doc if line)


def _type(type_: Type) -> dict[str, Any]:
    match type_:
        case Array(of, size):
            return {"type": "array", "items": _element(of), "minItems": size, "maxItems": size}
        case Sequence(of, bound):
            limit = {} if bound is None else {"maxItems": bound}
            return {"type": "array", "items": _element(of), **limit}
        case _:
            return _element(type_)


def _element(type_: Element) -> dict[str, Any]:
    match type_:
        case Named(name):
            return {"$ref": f"#/$defs/{str(name).replace('/', '~1')}"}
        case String(_, bound):
            return {"type": "string"} if bound is None else {"type": "string", "maxLength": bound}
        case Primitive("boolean"):
            return {"type": "boolean"}
        case Primitive("float" | "double" | "long double"):
            return {"type": "number"}
        case Primitive("char" | "wchar"):
            return {"type": "string", "minLength": 1, "maxLength": 1}
        case Primitive("octet"):  # rosidl_runtime_py uses a character, others a number
            limits = {"minimum": 0, "maximum": 255, "minLength": 1, "maxLength": 1}
            return {"type": ["integer", "string"], **limits}
        case Primitive(name):
            bits = _BITS[name.removeprefix("u")]
            low = 0 if name.startswith("u") else -(2 ** (bits - 1))
            return {"type": "integer", "minimum": low, "maximum": 2**bits - 1 + low}
