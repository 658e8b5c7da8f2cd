"""Computed sizes and offsets agree with serialized messages."""

import struct
from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forge.interfaces.model import Message, Primitive, TypeName
from forge.interfaces.wire.sizes import MemberSize, MessageSize, SizeCalculator
from tests.generated import catalog_of, generate, importable
from tests.messages import messages

DEFINITIONS = {
    "msg/Fixed.msg": "uint8 a\nfloat64 b\nint16[3] c\nuint32 d\nint8 e",
    "msg/Inner.msg": "uint8 a\nint64 b\nuint8 c",
    "msg/Twice.msg": "uint16 a\nInner b\nInner[5] c\nuint32 d",
    "msg/Texts.msg": "string a\nint32 b\nInner c\nwstring d\nuint8 e\nfloat64 f",
    "msg/Bounded.msg": "uint8 a\nstring<=5 b\nfloat64[<=3] c\nwstring<=3 d\nInner[<=4] e\nuint16 f",
    "msg/Deep.msg": "int8 a\nBounded[<=2] b\nstring<=3[2] c\nint64 d",
    "msg/Lists.msg": "float64[] a\nuint8 b\nInner[] c\nstring[2] d\nint64 e",
    "msg/Nothing.msg": "",
    "msg/Hollow.msg": "uint32 a\nNothing b\nNothing[3] c\nuint16 d",
}
FORMATS = dict(
    zip(("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64"), "bBhHiIqQ", strict=True)
)
CATALOG = catalog_of("spans", DEFINITIONS)
NAMES = sorted(CATALOG.interfaces)


@pytest.fixture(scope="module")
def classes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Mapping[str, Any]]:
    folder = tmp_path_factory.mktemp("spans")
    generate(folder, CATALOG)
    with importable(folder):
        module = import_module("spans.msg")
        yield {str(name): getattr(module, name.name) for name in NAMES}


def size_of(name: TypeName) -> tuple[Message, MessageSize]:
    message = CATALOG.interfaces[name]
    assert isinstance(message, Message)
    return message, SizeCalculator(CATALOG.known).of(message)


def content_of(message: Any) -> bytes:
    """Return the serialized message without its header."""
    content: bytes = import_module("forge_cdr").serialize(message)
    return content[4:]


def size(message: Any) -> int:
    return len(content_of(message))


@pytest.mark.parametrize("name", NAMES, ids=str)
def test_an_empty_message_has_the_minimum_size(classes: Mapping[str, Any], name: TypeName) -> None:
    assert size(classes[str(name)]()) == size_of(name)[1].min_size


@pytest.mark.parametrize("name", NAMES, ids=str)
@settings(max_examples=30)
@given(data=st.data())
def test_serialized_messages_are_within_the_computed_limits(
    classes: Mapping[str, Any], name: TypeName, data: st.DataObject
) -> None:
    message = data.draw(messages(classes[str(name)]))
    found = size_of(name)[1]
    assert found.min_size <= size(message)
    assert found.max_size is None or size(message) <= found.max_size


@pytest.mark.parametrize("name", NAMES, ids=str)
@settings(max_examples=30)
@given(data=st.data())
def test_numbers_are_at_their_computed_offsets(
    classes: Mapping[str, Any], name: TypeName, data: st.DataObject
) -> None:
    definition, found = size_of(name)
    message = data.draw(messages(classes[str(name)]))
    content = content_of(message)
    for member, expected in zip(definition.fields, found.members, strict=False):
        if expected.fixed and isinstance(member.type, Primitive) and member.type.name in FORMATS:
            (value,) = struct.unpack_from(f"<{FORMATS[member.type.name]}", content, expected.offset)
            assert value == getattr(message, member.name)


def test_full_messages_have_the_maximum_size(classes: Mapping[str, Any]) -> None:
    inner, bounded = classes["spans/msg/Inner"], classes["spans/msg/Bounded"]
    full = [bounded(b="12345", c=[1.0] * 3, d="123", e=[inner() for _ in range(4)]) for _ in range(2)]
    assert size(full[0]) == size_of(TypeName("spans", "msg", "Bounded"))[1].max_size
    deep = classes["spans/msg/Deep"](b=full, c=["123", "123"])
    assert size(deep) == size_of(TypeName("spans", "msg", "Deep"))[1].max_size


def test_the_size_of_a_nested_message_depends_on_its_offset() -> None:
    assert size_of(TypeName("spans", "msg", "Texts"))[1].members == (
        MemberSize(0, fixed=True, alignment=4, min_size=5, max_size=None),
        MemberSize(8, fixed=False, alignment=4, min_size=4, max_size=4),
        MemberSize(12, fixed=False, alignment=1, min_size=13, max_size=17),
        MemberSize(28, fixed=False, alignment=4, min_size=4, max_size=None),
        MemberSize(32, fixed=False, alignment=1, min_size=1, max_size=1),
        MemberSize(40, fixed=False, alignment=8, min_size=8, max_size=8),
    )
