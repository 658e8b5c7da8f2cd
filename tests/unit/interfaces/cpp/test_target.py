"""C++ headers as text: names, includes, values and comments."""

import math
import struct
from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.interfaces.cpp import target as cpp
from forge.interfaces.cpp.text import comment, literal
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

POINT = Named(TypeName("geometry_msgs", "msg", "Point"))


def texts(*messages: Message, others: Iterable[Named] = (POINT,)) -> dict[str, str]:
    """Return the headers of a package 'demo' by path; other packages' messages have one member."""
    elsewhere = (Message(other.name, (Field("x", Primitive("double")),)) for other in others)
    known = {message.name: message for message in (*messages, *elsewhere)}
    catalog = Catalog("demo", {message.name: message for message in messages}, known, {})
    return {file.path: file.text for file in cpp.files(catalog)}


def message(*fields: Field, constants: tuple[Constant, ...] = (), name: str = "Thing") -> Message:
    return Message(TypeName("demo", "msg", name), fields, constants)


def test_the_headers_of_a_package_match_the_reviewed_text(golden: Golden) -> None:
    """The golden files are all headers of a message, a service and an action."""
    case = GOLDEN / "interfaces" / "cpp" / "robot"
    catalog = resolve("robot", parse_all(read_folder("robot", case)), Library())
    golden(case, {file.path: file.text for file in cpp.files(catalog)})


@pytest.mark.parametrize("name", ["DELETE", "ERROR", "NAN", "NO_ERROR"])
def test_a_constant_may_have_the_name_of_a_macro(name: str) -> None:
    """The macro is undefined while the struct is defined."""
    constant = Constant(name, Primitive("int8"), 1)
    header = texts(message(constants=(constant,)))["demo/msg/detail/thing__struct.hpp"]
    before, _, after = header.partition(f"static constexpr std::int8_t {name} = 1;")
    assert f'#pragma push_macro("{name}")\n#undef {name}\n' in before
    assert f'#pragma pop_macro("{name}")\n' in after


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
def test_literals_are_exact(value: Value, type_: Type, text: str) -> None:
    """They cause no warnings and do not depend on the source encoding."""
    assert literal(value, type_) == text


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_a_float_literal_has_the_same_value_in_single_precision(value: float) -> None:
    text = literal(value, Primitive("float")).removesuffix("f")
    assert struct.pack("<f", float(text)) == struct.pack("<f", value)


@given(st.lists(st.text(max_size=12), max_size=4), st.none() | st.text("[m]/\\?", min_size=1, max_size=3))
def test_comments_cannot_continue_on_the_next_line(lines: list[str], unit: str | None) -> None:
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
    assert comment(doc, unit) == lines
