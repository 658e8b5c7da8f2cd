"""Convert messages to Protocol Buffers and back, with the classes that protoc generates; part of forge.

`protoc --python_out` writes these classes into the folder of the message classes: `robot/msg/Pose2D_pb2.py`
for `robot.msg.Pose2D`.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from typing import Any, TypeVar

_M = TypeVar("_M")


def to_proto(message: Any) -> Any:
    """Return a message as an instance of the class that protoc generated for its type."""
    class_ = type(message)
    package, kind = class_.__module__.split(".")[-3:-1]
    module = import_module(f"{package}.{kind}.{class_.__name__}_pb2")
    proto = getattr(module, class_.__name__)()
    _fill(proto, message)
    return proto


def from_proto(proto: Any, class_: type[_M]) -> _M:
    """Return the message of a class for an instance of the class that protoc generated for its type.

    Raises ValueError for a fixed array of another size. The class checks all other values.
    """
    values = {}
    for field, slot, type_ in _fields(proto, class_):
        value = getattr(proto, field)
        element = getattr(type_, "value_type", type_)
        word = getattr(element, "typename", "")
        if type_ is not element:
            size = getattr(type_, "size", len(value))
            if len(value) != size:
                name = f"{proto.DESCRIPTOR.full_name}.{field}"
                raise ValueError(f"'{name}' has {len(value)} elements instead of {size}")
        if hasattr(element, "namespaces"):
            module = ".".join((*class_.__module__.split(".")[:-3], *element.namespaces))
            nested = getattr(import_module(module), element.name)
            many = type_ is not element
            value = [from_proto(each, nested) for each in value] if many else from_proto(value, nested)
        elif word == "octet":
            value = bytes([value]) if type_ is element else [bytes([each]) for each in value]
        elif word in {"char", "wchar"}:
            value = chr(value) if type_ is element else [*map(chr, value)]
        elif type_ is not element:
            value = bytearray(value) if word == "uint8" else [*value]
        values[slot] = value
    return class_(**values)


def _fill(proto: Any, message: Any) -> None:
    for field, slot, type_ in _fields(proto, type(message)):
        value = getattr(message, slot)
        element = getattr(type_, "value_type", type_)
        word = getattr(element, "typename", "")
        if hasattr(element, "namespaces"):
            if type_ is element:
                getattr(proto, field).SetInParent()
                _fill(getattr(proto, field), value)
            else:
                for each in value:
                    _fill(getattr(proto, field).add(), each)
        elif type_ is element:
            setattr(proto, field, ord(value) if word in {"octet", "char", "wchar"} else value)
        elif word in {"octet", "uint8"}:
            setattr(proto, field, b"".join(value) if word == "octet" else bytes(value))
        else:
            getattr(proto, field).extend(map(ord, value) if word in {"char", "wchar"} else value)


def _fields(proto: Any, class_: Any) -> Iterator[tuple[str, str, Any]]:
    """Yield the name of each field in proto and in the message, and its type."""
    for number, (slot, type_) in enumerate(zip(class_.__slots__, class_.SLOT_TYPES, strict=True), start=1):
        yield proto.DESCRIPTOR.fields_by_number[number].name, slot[1:], type_
