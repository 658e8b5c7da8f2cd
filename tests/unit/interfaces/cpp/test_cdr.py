"""Generated serialization in C++: statements, packed messages and includes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from forge.interfaces.cpp import target as cpp
from forge.interfaces.cpp.cdr import MembersView, MembersViews
from forge.interfaces.model import TypeName
from forge.interfaces.wire.flattening import INLINE_LIMIT, LayoutBuilder
from tests.generated import catalog_of

if TYPE_CHECKING:
    from collections.abc import Iterable

MANY = "\n".join(
    f"string s{number}\nint8 n{number}\nfloat64[] d{number}" for number in range(INLINE_LIMIT // 2)
)


def view(text: str, **others: str) -> MembersView:
    """Return what is said about a message of this definition."""
    catalog = catalog_of("demo", {f"msg/{name}.msg": each for name, each in {**others, "X": text}.items()})
    return MembersViews(LayoutBuilder(catalog.known)).of(TypeName("demo", "msg", "X"))


def statements(text: str, **others: str) -> list[str]:
    """Return the statements in the definition's words, without what they all have."""
    return [each.replace("message.", "").removeprefix("cdr.") for each in view(text, **others).statements]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("int32 a\nint16 b\nint8 c", ["fixed(a, b, c);"]),
        ("int8 a\nint64 b\nint8 c\nint32 d", ["fixed(a);", "fixed(b, c, d);"]),
        ("int32 a\nstring b\nint32 c", ["fixed(a);", "text(b);", "fixed(c);"]),
        ("float64[3] a\nfloat64[1000] b", ["fixed(a);", "fixed(b);"]),
        ("string[2] a\nstring[] b\nbool[<=3] c", ["array(a);", "sequence(b);", "sequence(c);"]),
        ("Inner a\nInner[2] b\nInner[] c", ["fixed(a);", "array(b);", "sequence(c);"]),
        ("", ["fixed(structure_needs_at_least_one_member);"]),
        ("Large a\nint8 b", ["message(a);", "fixed(b);"]),
        ("Pair a\nint8 b\nPair[2] c", ["fixed(a.inner, a.other, b);", "array(c);"]),
    ],
)
def test_neighbours_of_fixed_size_are_moved_together(text: str, expected: list[str]) -> None:
    """A run ends where padding would depend on what comes before it."""
    pair = "Inner inner\nint8 other"
    assert statements(text, Inner="float64 x", Large=MANY, Pair=pair) == expected


def test_a_long_statement_has_several_lines() -> None:
    text = "\n".join(f"float64 some_member_with_a_name_{number}" for number in range(5))
    (statement,) = view(text).statements
    first, *lines = statement.splitlines()
    assert first == "cdr.fixed("
    assert all(line.startswith("      message.") and len(line) <= 100 for line in lines)
    assert statement.endswith("_4);")


@pytest.mark.parametrize(
    ("text", "size", "alignment"),
    [
        ("float64 x\nfloat64 y", 16, 8),
        ("int32 sec\nuint32 nanosec", 8, 4),
        ("uint8[16] uuid", 16, 1),
        ("float64 a\nint32 b\nint16[2] c", 16, 8),
        ("Inner a\nInner b", 16, 8),
        ("int32 a\nint32 b\nfloat64 c", 0, 0),
        ("float64 a\nint8 b", 0, 0),
        ("int8 a\nint16 b", 0, 0),
        ("uint8 a\nbool b", 0, 0),
        ("bool[2] a", 0, 0),
        ("float64[1000] a", 0, 0),
        ("float64 a\nfloat64[] b", 0, 0),
        ("string a", 0, 0),
        ("Inner[2] a", 0, 0),
    ],
)
def test_only_messages_without_padding_are_packed(text: str, size: int, alignment: int) -> None:
    """What is called packed has the same bytes wherever it lies; no bool is, as not every byte is one."""
    expected = (f"packed = {size};", *([f"alignment = {alignment};"] if size else []))
    assert view(text, Inner="float64 x").constants[1:] == expected


@pytest.mark.parametrize(
    ("text", "least"),
    [
        ("string a\nint8 b", 5),
        ("float64[2] a\nint8[] b", 20),
        ("Inner[3] a\nInner[] b", 16),
        ("Large a\nint8 b", INLINE_LIMIT // 2 * 9 + 1),
        ("Large[2] a\nLarge[] b", INLINE_LIMIT // 2 * 18 + 4),
        ("", 1),
    ],
)
def test_the_least_size_counts_no_padding(text: str, least: int) -> None:
    assert view(text, Inner="string x", Large=MANY).constants[0] == f"least = {least};"


def _headers(names: Iterable[str]) -> list[str]:
    return [f"demo/msg/detail/{name}__cdr.hpp" for name in names]


def test_a_header_includes_those_of_messages_that_stay_whole() -> None:
    """Those that are unfolded need no header, but what is whole inside them does."""
    definitions = {
        "msg/A.msg": "Flat flat\nElement[] elements\nOuter outer\nLoose loose",
        "msg/Flat.msg": "int8 x",
        "msg/Loose.msg": "bool x",
        "msg/Element.msg": "string x",
        "msg/Outer.msg": "Inner[2] inner",
        "msg/Inner.msg": "string x",
    }
    catalog = catalog_of("demo", definitions)
    text = next(file.text for file in cpp.files(catalog) if file.path.endswith("/a__cdr.hpp"))
    included = [line.split('"')[1] for line in text.splitlines() if line.startswith('#include "')]
    assert included == ["demo/msg/detail/a__struct.hpp", *_headers(["element", "flat", "inner"])]
