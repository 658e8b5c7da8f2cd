"""C++ headers as text: names, includes, values and comments."""

from __future__ import annotations

import math
import re
import struct
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.interfaces.cpp import target as cpp
from forge.interfaces.cpp.text import comment, literal, spell
from forge.interfaces.model import (
    Array,
    Catalog,
    Constant,
    Field,
    Message,
    Named,
    Primitive,
    Sequence,
    String,
    Type,
    TypeName,
    Value,
)
from forge.interfaces.read.parsing import parse_all
from forge.interfaces.read.sources import Library, read_folder
from forge.interfaces.resolve.resolution import resolve
from tests.conftest import GOLDEN, Golden

if TYPE_CHECKING:
    from collections.abc import Iterable

ESCAPE = re.compile(r'\\([0-7]{3}|u[0-9a-f]{4}|U[0-9a-f]{8}|x[0-9a-f]{4}" u"|.)')
ESCAPED = {"n": "\n", "r": "\r", "t": "\t", '"': '"', "\\": "\\", "?": "?"}
POINT = Named(TypeName("geometry_msgs", "msg", "Point"))


def texts(*messages: Message, others: Iterable[Named] = (POINT,)) -> dict[str, str]:
    """Return the headers of a package 'demo' by path; other packages' messages have one member."""
    elsewhere = (Message(other.name, (Field("x", Primitive("double")),)) for other in others)
    known = {message.name: message for message in (*messages, *elsewhere)}
    catalog = Catalog("demo", {message.name: message for message in messages}, known, {})
    return {file.path: file.text for file in cpp.files(catalog)}


def message(*fields: Field, constants: tuple[Constant, ...] = (), name: str = "Thing") -> Message:
    """Return a message of the package 'demo'."""
    return Message(TypeName("demo", "msg", name), fields, constants)


def understood(text: str) -> str:
    """Return what C++ makes of the inside of a string literal."""

    def character(match: re.Match[str]) -> str:
        code = match.group(1)
        if code[0] in "uUx":
            return chr(int(code[1:].removesuffix('" u"'), 16))
        return ESCAPED[code] if code in ESCAPED else chr(int(code, 8))

    return ESCAPE.sub(character, text)


def test_a_package_reads_as_if_written_by_hand(golden: Golden) -> None:
    """A message, a service and an action give these headers and no others."""
    case = GOLDEN / "interfaces" / "cpp" / "robot"
    catalog = resolve("robot", parse_all(read_folder("robot", case)), Library())
    golden(case, {file.path: file.text for file in cpp.files(catalog)})


def test_every_interface_has_rosidls_headers() -> None:
    """Names are in snake case; the visibility header lies in msg."""
    assert sorted(texts(message(name="UInt8"))) == [
        "demo/msg/detail/u_int8__builder.hpp",
        "demo/msg/detail/u_int8__cdr.hpp",
        "demo/msg/detail/u_int8__struct.hpp",
        "demo/msg/detail/u_int8__traits.hpp",
        "demo/msg/detail/u_int8__type_support.hpp",
        "demo/msg/rosidl_generator_cpp__visibility_control.hpp",
        "demo/msg/u_int8.hpp",
    ]


def test_a_package_without_interfaces_has_its_visibility_header() -> None:
    """It is there even if nothing else is."""
    assert list(texts()) == ["demo/msg/rosidl_generator_cpp__visibility_control.hpp"]


def test_guards_follow_the_path() -> None:
    """Two underscores stand between folders."""
    header = texts(message())["demo/msg/detail/thing__struct.hpp"]
    assert (
        "#ifndef DEMO__MSG__DETAIL__THING__STRUCT_HPP_\n#define DEMO__MSG__DETAIL__THING__STRUCT_HPP_"
        in header
    )


def test_a_header_includes_what_its_members_need_once() -> None:
    """Members of one type share an include; the headers of services' and actions' parts are known."""
    parts = [
        Named(TypeName("other", "srv", "AskMe_Request")),
        Named(TypeName("other", "action", "GoOn_SendGoal_Request")),
    ]
    types: list[Type] = [POINT, Array(POINT, 2), Sequence(POINT), *parts]
    fields = [Field(f"f{position}", type_) for position, type_ in enumerate(types)]
    headers = texts(message(*fields), others=[POINT, *parts])
    assert re.findall(r'#include "([^"]*)"', headers["demo/msg/detail/thing__struct.hpp"]) == [
        "geometry_msgs/msg/detail/point__struct.hpp",
        "other/action/detail/go_on__struct.hpp",
        "other/srv/detail/ask_me__struct.hpp",
        "rosidl_runtime_cpp/member_types.hpp",
        "rosidl_runtime_cpp/message_initialization.hpp",
    ]


@pytest.mark.parametrize("name", ["DELETE", "ERROR", "NAN", "NO_ERROR"])
def test_a_constant_may_be_called_like_a_macro(name: str) -> None:
    """The macro steps aside while the struct is defined."""
    constant = Constant(name, Primitive("int8"), 1)
    header = texts(message(constants=(constant,)))["demo/msg/detail/thing__struct.hpp"]
    before, _, after = header.partition(f"static constexpr std::int8_t {name} = 1;")
    assert f'#pragma push_macro("{name}")\n#undef {name}\n' in before
    assert f'#pragma pop_macro("{name}")\n' in after


@pytest.mark.parametrize(
    ("type_", "text"),
    [
        (Primitive("octet"), "unsigned char"),
        (Primitive("char"), "unsigned char"),
        (Primitive("wchar"), "char16_t"),
        (Primitive("long double"), "long double"),
        (Primitive("uint16"), "std::uint16_t"),
        (String(bound=5), "::rosidl_runtime_cpp::String<ContainerAllocator>"),
        (String(wide=True), "::rosidl_runtime_cpp::U16String<ContainerAllocator>"),
        (Array(POINT, 3), "std::array<::geometry_msgs::msg::Point_<ContainerAllocator>, 3>"),
        (Sequence(Primitive("boolean")), "::rosidl_runtime_cpp::Sequence<bool, ContainerAllocator>"),
        (
            Sequence(Primitive("double"), 4),
            "::rosidl_runtime_cpp::BoundedSequence<double, 4, ContainerAllocator>",
        ),
    ],
)
def test_a_type_is_spelled_as_the_specification_says(type_: Type, text: str) -> None:
    """Bounds of texts are no part of the C++ type."""
    assert spell(type_) == text


@pytest.mark.parametrize(
    ("value", "type_", "text"),
    [
        (True, Primitive("boolean"), "true"),
        (-(2**63), Primitive("int64"), "(-9223372036854775807ll - 1)"),
        (2**64 - 1, Primitive("uint64"), "18446744073709551615ull"),
        (-(2**31), Primitive("int32"), "(-2147483647 - 1)"),
        (-128, Primitive("int8"), "-128"),
        ("a", Primitive("wchar"), "97"),
        (1, Primitive("float"), "1.0f"),
        (1e300, Primitive("double"), "1e+300"),
        (1e300, Primitive("float"), "std::numeric_limits<float>::infinity()"),
        (-1e-300, Primitive("float"), "-0.0f"),
        (-math.inf, Primitive("double"), "-std::numeric_limits<double>::infinity()"),
        (math.nan, Primitive("float"), "std::numeric_limits<float>::quiet_NaN()"),
        (0.5, Primitive("long double"), "0.5l"),
        ((1, 2), Array(Primitive("uint8"), 2), "{{1u, 2u}}"),
        (("a", "b"), Sequence(String()), '{"a", "b"}'),
        ("é??/\\x", String(), '"\\303\\251\\?\\?/\\\\x"'),
        ("é日😀\x85", String(wide=True), 'u"\\u00e9\\u65e5\\U0001f600\\205"'),
        ("a\0", String(), '::rosidl_runtime_cpp::String<ContainerAllocator>("a\\000", 2)'),
        ("\ud800a", String(wide=True), 'u"\\xd800" u"a"'),
    ],
)
def test_a_literal_has_exactly_the_value(value: Value, type_: Type, text: str) -> None:
    """No compiler warns of it, and no character of it depends on the source's encoding."""
    assert literal(value, type_) == text


@pytest.mark.parametrize("type_", [POINT, Primitive("int8")])
def test_what_has_no_literal_is_our_mistake(type_: Type) -> None:
    """A message, or a number that is several, never gets this far."""
    with pytest.raises(TypeError):
        literal((1, 2), type_)


@given(st.text(st.characters(exclude_characters="\0"), max_size=20), st.booleans())
def test_a_text_is_understood_as_it_was_meant(value: str, wide: bool) -> None:
    """A literal is printable ASCII without trigraphs, and C++ reads the value back from it."""
    text = literal(value, String(wide=wide))
    assert text.isascii()
    assert text.isprintable()
    assert "??" not in text
    plain = understood(text.removeprefix("u")[1:-1])
    meant = value if wide else value.encode("utf-8", "surrogatepass").decode("latin-1")
    assert plain == meant


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_a_float_is_read_back_the_same(value: float) -> None:
    """Single precision loses nothing."""
    text = literal(value, Primitive("float")).removesuffix("f")
    assert struct.pack("<f", float(text)) == struct.pack("<f", value)


@given(st.lists(st.text(max_size=12), max_size=4), st.none() | st.text("[m]/\\?", min_size=1, max_size=3))
def test_a_comment_ends_where_it_seems_to(lines: list[str], unit: str | None) -> None:
    """One line stays one line of comment, whatever is in it."""
    written = comment(lines, unit)
    assert len(written) == max(len(lines), unit is not None)
    for line in written:
        assert line.startswith("///")
        assert not line.endswith(("\\", "??/", " "))
        assert len(line.splitlines()) == 1
        assert line.encode()


@pytest.mark.parametrize(
    ("doc", "unit", "lines"),
    [
        ((), None, ()),
        ((), "m", ("/// [m]",)),
        (("speed",), "m/s", ("/// speed [m/s]",)),
        (("first", "", "last"), None, ("/// first", "///", "/// last")),
        (("C:\\",), None, ("/// C:\\ .",)),
        (("a\u202eb",), None, ("/// a b",)),
    ],
)
def test_documentation_becomes_comments(
    doc: tuple[str, ...], unit: str | None, lines: tuple[str, ...]
) -> None:
    """Units return to where the definition had them."""
    assert comment(doc, unit) == lines


def test_a_hidden_member_has_no_setter_and_no_text() -> None:
    """It is there in the struct, and nowhere else; declared beside others it is like them."""
    empty = texts(message())
    assert "structure_needs_at_least_one_member = 0u;" in empty["demo/msg/detail/thing__struct.hpp"]
    assert "set__" not in empty["demo/msg/detail/thing__struct.hpp"]
    assert "structure_needs" not in empty["demo/msg/detail/thing__traits.hpp"]
    assert "structure_needs" not in empty["demo/msg/detail/thing__builder.hpp"]
    hidden = Field("structure_needs_at_least_one_member", Primitive("uint8"))
    shown = texts(message(hidden, Field("other", Primitive("uint8"))))
    assert "set__structure_needs_at_least_one_member" in shown["demo/msg/detail/thing__struct.hpp"]


def test_generating_twice_gives_the_same() -> None:
    """Nothing depends on the order of a set."""
    thing = message(Field("a", POINT), Field("b", String()))
    assert texts(thing) == texts(thing)
