"""Convert lists of messages to record batches of Apache Arrow and back; part of forge."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

import pyarrow as pa

_M = TypeVar("_M")
_INTEGERS = ("int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64")
_SCALARS = {
    **{name: getattr(pa, name)() for name in _INTEGERS},
    "boolean": pa.bool_(),
    "octet": pa.uint8(),
    "char": pa.uint8(),
    "wchar": pa.uint16(),
    "float": pa.float32(),
    "double": pa.float64(),
}
_BYTES = ("octet", "uint8")


@cache
def schema(class_: Any) -> pa.Schema:
    """Return the schema of a message class; the metadata contain the type's name, comments and units."""
    metadata = {"name": _name(class_), **_comments(class_).get("", {})}
    return pa.schema(_fields(class_), metadata=metadata)


def to_arrow(messages: Iterable[Any], class_: Any) -> pa.RecordBatch:
    """Return messages of a class as the rows of a record batch."""
    wanted = schema(class_)
    rows = pa.array([_row(message) for message in messages], pa.struct(wanted))
    return pa.RecordBatch.from_struct_array(rows).replace_schema_metadata(wanted.metadata)


def from_arrow(batch: pa.RecordBatch, class_: type[_M]) -> list[_M]:
    """Return the rows of a record batch as messages of a class, which checks the values.

    Columns are found by their names. Raises KeyError if one is missing.
    """
    return [_message(row, class_) for row in batch.to_struct_array().to_pylist()]


def _fields(class_: Any) -> list[pa.Field]:
    comments = _comments(class_)
    return [
        pa.field(name, _type(type_, class_), nullable=False, metadata=comments.get(name))
        for name, type_ in _slots(class_)
    ]


def _type(type_: Any, class_: Any) -> pa.DataType:
    element = getattr(type_, "value_type", type_)
    size = getattr(type_, "size", -1)
    word = getattr(element, "typename", "")
    if type_ is not element:
        if word in _BYTES:
            return pa.binary(size)
        return pa.list_(pa.field("item", _type(element, class_), nullable=False), size)
    if hasattr(type_, "namespaces"):
        return pa.struct(_fields(_class_of(type_, class_)))
    return _SCALARS[word] if word else pa.string()


def _row(message: Any) -> dict[str, Any]:
    row = {}
    for name, type_ in _slots(type(message)):
        value = getattr(message, name)
        element = getattr(type_, "value_type", type_)
        word = getattr(element, "typename", "")
        many = type_ is not element
        if hasattr(element, "namespaces"):
            value = [_row(each) for each in value] if many else _row(value)
        elif many and word in _BYTES:
            value = b"".join(value) if word == "octet" else bytes(value)
        elif word in {"octet", "char", "wchar"}:
            value = [*map(ord, value)] if many else ord(value)
        elif many:
            value = value.tolist() if hasattr(value, "tolist") else [*value]
        row[name] = value
    return row


def _message(row: dict[str, Any], class_: type[_M]) -> _M:
    values = {}
    for name, type_ in _slots(class_):
        value = row[name]
        element = getattr(type_, "value_type", type_)
        word = getattr(element, "typename", "")
        many = type_ is not element
        if hasattr(element, "namespaces"):
            nested = _class_of(element, class_)
            value = [_message(each, nested) for each in value] if many else _message(value, nested)
        elif word == "octet":
            value = [bytes([each]) for each in value] if many else bytes([value])
        elif word in {"char", "wchar"}:
            value = [*map(chr, value)] if many else chr(value)
        elif many and word == "uint8":
            value = bytearray(value)
        values[name] = value
    return class_(**values)


def _slots(class_: Any) -> Iterator[tuple[str, Any]]:
    """Yield the name and the type of each field."""
    for slot, type_ in zip(class_.__slots__, class_.SLOT_TYPES, strict=True):
        yield slot[1:], type_


def _class_of(type_: Any, owner: Any) -> Any:
    module = ".".join((*owner.__module__.split(".")[:-3], *type_.namespaces))
    return getattr(import_module(module), type_.name)


def _name(class_: Any) -> str:
    return "/".join((*class_.__module__.split(".")[-3:-1], class_.__name__))


def _comments(class_: Any) -> Any:
    """Return the metadata of the fields of a class by name; the empty name has those of the class."""
    name = _name(class_)
    return _package_comments(name.partition("/")[0]).get(name, {})


@cache
def _package_comments(package: str) -> Any:
    path = Path(__file__).with_name(f"{package}.json")
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
