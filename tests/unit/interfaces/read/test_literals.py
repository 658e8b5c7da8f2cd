"""Literals of each type and their values."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.interfaces.model import Array, Named, Primitive, Sequence, String, Type, TypeName, Value
from forge.interfaces.read.literals import INTEGER_RANGES, ParseError, read_value

INT8 = Primitive("int8")
INT32 = Primitive("int32")
BOOL = Primitive("boolean")
DOUBLE = Primitive("double")
TEXT = String()


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("017", 17),
        ("0x1F", 31),
        ("0X1f", 31),
        ("0b11", 3),
        ("0o17", 15),
        ("+5", 5),
        ("-0", 0),
        ("1_000", 1000),
        ("-0x10", -16),
    ],
)
def test_integers_are_parsed_as_in_python(text: str, value: int) -> None:
    assert read_value(text, INT32) == value


@given(st.sampled_from(sorted(INTEGER_RANGES)), st.integers(-(1 << 65), 1 << 65))
def test_integers_are_accepted_exactly_within_their_range(name: str, number: int) -> None:
    low, high = INTEGER_RANGES[name]
    if low <= number <= high:
        assert read_value(str(number), Primitive(name)) == number
    else:
        with pytest.raises(ParseError, match="out of range"):
            read_value(str(number), Primitive(name))


@pytest.mark.parametrize("text", ["true", "TRUE", "tRuE", "1"])
def test_booleans_are_case_insensitive(text: str) -> None:
    assert read_value(text, BOOL) is True
    assert read_value({"1": "0"}.get(text, "False"), BOOL) is False


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1", 1.0),
        ("1.", 1.0),
        (".5", 0.5),
        ("1e3", 1000.0),
        ("1_0.5", 10.5),
        ("-Infinity", -math.inf),
        ("1e400", math.inf),
    ],
)
def test_floats_are_parsed_as_in_python(text: str, value: float) -> None:
    read = read_value(text, DOUBLE)
    assert (read, type(read)) == (value, float)


def test_floats_have_no_range() -> None:
    assert math.isnan(float(str(read_value("nan", Primitive("float")))))
    assert read_value("1e39", Primitive("float")) == 1e39
    assert read_value("inf", Primitive("float")) == math.inf


@pytest.mark.parametrize(
    ("text", "type_", "value"),
    [
        ("[]", Sequence(INT8), ()),
        ("[1, 2,3 ]", Sequence(INT8), (1, 2, 3)),
        ("[1, 2]", Array(DOUBLE, 2), (1.0, 2.0)),
        ("[true, 0]", Sequence(BOOL, 2), (True, False)),
        ("[]", Sequence(TEXT), ()),
        ("[\"a\", 'b', c d ]", Sequence(TEXT), ("a", "b", "c d")),
        ("""["H\\"el'lo", 'Wo\\'r"ld']""", Sequence(TEXT), ("H\"el'lo", "Wo'r\"ld")),
        ("""["Hel,lo", ',World', abcd , "!,",]""", Sequence(TEXT), ("Hel,lo", ",World", "abcd", "!,")),
        ('["a" "b"]', Sequence(TEXT), ("a", "b")),
        ('["a\\tb"]', Sequence(TEXT), ("a\\tb",)),
        ('["\\"a\\" \\"b\\"", "é"]', Sequence(TEXT), ('"a" "b"', "é")),
        ('["abc"]', Sequence(String(bound=3), 1), ("abc",)),
    ],
)
def test_collections_are_parsed(text: str, type_: Type, value: Value) -> None:
    assert read_value(text, type_) == value


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("a b c", "a b c"),
        ("", ""),
        ('""', ""),
        ('"', ""),
        ('"abc', '"abc'),
        ("[1,2]", "[1,2]"),
        ('"it\'s"', "it's"),
        ("'it\\'s'", "it's"),
        ('"say \\"yes\\""', 'say "yes"'),
        ("'say \"yes\"'", 'say "yes"'),
        ('"a\\tb\\n\\r\\v\\b\\f\\a\\?"', "a\tb\n\r\v\b\f\a?"),
        ('"a\\x41b oct\\101 \\0"', "aAb octA \0"),
        ('"\\u0041\\u00e9\\u65e5"', "Aé日"),
        ("C:\\Users", "C:\\Users"),
        ('"a\\\\b"', "a\\b"),
        ('"\\\\"', "\\"),
        ("日本", "日本"),
    ],
)
def test_quotes_and_escapes_are_resolved_once(text: str, value: str) -> None:
    assert read_value(text, TEXT) == value
    assert read_value(text, String(wide=True)) == value


def test_string_bounds_count_unescaped_characters() -> None:
    assert read_value("'it\\'s'", String(bound=4)) == "it's"
    with pytest.raises(ParseError, match="5 characters exceeds the bound 4"):
        read_value('"it\'ss"', String(bound=4))


@given(st.text(st.characters(exclude_categories=["Cs"])))
def test_any_string_can_be_quoted(text: str) -> None:
    written = text.replace("\\", "\\\\").replace('"', '\\"')
    assert read_value(f'"{written}"', TEXT) == text


@pytest.mark.parametrize(
    "type_", [Named(TypeName("a", "msg", "B")), Sequence(Named(TypeName("a", "msg", "B")))]
)
def test_message_types_have_no_literals(type_: Type) -> None:
    with pytest.raises(ParseError, match="message type"):
        read_value("[]", type_)


def test_errors_point_at_the_element() -> None:
    with pytest.raises(ParseError) as caught:
        read_value("[1, 2,  x]", Sequence(INT8))
    assert caught.value.offset == 8
