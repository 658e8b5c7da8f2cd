"""The target 'protobuf': proto3 definitions of messages, and the module forge_protobuf that converts values.

The number of a field is its position in the definition. C++ code can include the headers of protoc and of
ROS together, because the names of proto packages end with '.pb'.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from forge.base.errors import InterfaceError, Problem, raise_if_any
from forge.base.templating import render
from forge.interfaces.model import (
    Array,
    Catalog,
    Constant,
    Element,
    Field,
    File,
    Named,
    Primitive,
    Sequence,
    String,
    Type,
    element_of,
    nested_types,
    sections_of,
)
from forge.interfaces.notation import type_text, value_text, visible

_SCALARS = {
    "boolean": "bool",
    "float": "float",
    "double": "double",
    **dict.fromkeys(("octet", "char", "wchar", "uint8", "uint16", "uint32"), "uint32"),
    **dict.fromkeys(("int8", "int16", "int32"), "sint32"),
    "int64": "sint64",
    "uint64": "uint64",
}
_BYTES = (Primitive("octet"), Primitive("uint8"))


def files(catalog: Catalog) -> Iterator[File]:
    """Yield 'PACKAGE/KIND/NAME.proto' for each message, and for each part of a service or an action.

    Raises InterfaceError for fields without a type in proto3.
    """
    messages = [part for interface in catalog.interfaces.values() for part in sections_of(interface)]
    raise_if_any(
        (
            Problem(
                f"Protocol Buffers have no type for the long double '{field.name}'", field.place, "use double"
            )
            for message in messages
            for field in message.fields
            if element_of(field.type) == Primitive("long double")
        ),
        InterfaceError,
    )
    yield File("forge_protobuf.py", Path(__file__).with_name("forge_protobuf.py").read_text(encoding="utf-8"))
    for message in messages:
        name = message.name
        text = render(
            "protobuf/templates/message.proto.j2",
            title=name,
            doc=_comments(message.doc),
            imports=sorted(f"{each}.proto" for each in nested_types([message])),
            constants=[(_comments(each.doc), _declaration(each, name.package)) for each in message.constants],
            fields=[
                (
                    _comments(field.doc, field.unit),
                    f"{_type(field.type)} {proto_name} = {number}",
                    _declaration(field, name.package),
                )
                for number, (field, proto_name) in enumerate(
                    zip(message.fields, _names(message.fields), strict=True), start=1
                )
            ],
        )
        yield File(f"{name}.proto", text)


def _names(fields: Iterable[Field]) -> Iterator[str]:
    """Yield the names of fields.

    A field whose JSON name equals that of an earlier field gets its number as suffix.
    """
    json_names = set()
    for number, field in enumerate(fields, start=1):
        name = field.name
        # Until version 22, protoc compared these names, since then those in camel case.
        while (key := name.replace("_", "").lower()) in json_names:
            name = f"{name}_field{number}"
        json_names.add(key)
        yield name


def _comments(doc: Iterable[str], unit: str | None = None) -> list[str]:
    text = "\n".join(doc) + (f" [{unit}]" if unit else "")
    return [f"// {visible(line.strip())}" for line in text.splitlines() if line.strip()]


def _declaration(member: Field | Constant, package: str) -> str:
    """Return a member as in a .msg file, without its comment."""
    text = type_text(member.type, package)
    type_ = text.word + text.suffix
    if isinstance(member, Constant):
        return f"{type_} {member.name}={value_text(member.value)}"
    return f"{type_} {member.name} {value_text(member.default)}".rstrip()


def _type(type_: Type) -> str:
    match type_:
        case Array(of) | Sequence(of) if of in _BYTES:
            return "bytes"
        case Array(of) | Sequence(of):
            return f"repeated {_element(of)}"
        case _:
            return _element(type_)


def _element(type_: Element) -> str:
    match type_:
        case Named(name):
            return f".{name.package}.{name.kind}.pb.{name.name}"
        case String():
            return "string"
        case Primitive(name):
            return _SCALARS[name]
