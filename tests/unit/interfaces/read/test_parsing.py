"""Text to interfaces: declarations, comments, sections."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.base.errors import InterfaceError
from forge.interfaces.model import (
    Action,
    Array,
    Constant,
    Field,
    Message,
    Named,
    Primitive,
    Sequence,
    Service,
    Source,
    String,
    Type,
    TypeName,
)
from forge.interfaces.read.declarations import PRIMITIVES
from forge.interfaces.read.parsing import parse, parse_all

INT8 = Primitive("int8")


def message(text: str) -> Message:
    interface = parse(Source("tour", "msg/Walk.msg", Path("Walk.msg"), text))
    assert isinstance(interface, Message)
    return interface


def problems(text: str, relative: str = "msg/Walk.msg") -> list[str]:
    """Return location and message of each problem in a file."""
    with pytest.raises(InterfaceError) as caught:
        parse(Source("tour", relative, Path(relative), text))
    return [f"{problem.location}: {problem.message}" for problem in caught.value.problems]


def test_a_byte_order_mark_is_rejected_as_in_rosidl_adapter() -> None:
    """rosidl_adapter reads it as part of the first type. The rest of the file is parsed."""
    assert problems("\ufeff# A walk.\nint8 A\n") == [
        "msg/Walk.msg:1: the file starts with a byte-order mark, which ROS's own generators reject",
        "msg/Walk.msg:2:6: invalid field name 'A'",
    ]


@pytest.mark.parametrize(
    ("text", "type_"),
    [
        *((written, Primitive(name)) for written, name in PRIMITIVES.items()),
        ("string", String()),
        ("wstring", String(wide=True)),
        ("string<=5", String(bound=5)),
        ("wstring<=1_0", String(wide=True, bound=10)),
        ("Pose", Named(TypeName("tour", "msg", "Pose"))),
        ("Pose_Request", Named(TypeName("tour", "msg", "Pose_Request"))),
        ("geometry_msgs/Pose", Named(TypeName("geometry_msgs", "msg", "Pose"))),
        ("boolean_msgs/Bool", Named(TypeName("boolean_msgs", "msg", "Bool"))),
        ("int8[]", Sequence(INT8)),
        ("int8[3]", Array(INT8, 3)),
        ("int8[+3]", Array(INT8, 3)),
        ("int8[<=3]", Sequence(INT8, 3)),
        ("string<=5[<=10]", Sequence(String(bound=5), 10)),
        ("string<=5[3]", Array(String(bound=5), 3)),
        ("a/B[]", Sequence(Named(TypeName("a", "msg", "B")))),
    ],
)
def test_types_are_parsed(text: str, type_: Type) -> None:
    assert message(f"{text} x").fields == (Field("x", type_),)


@pytest.mark.parametrize(
    "line", ["int8 a", "int8   a", "int8 a   ", "int8\ta", "int8 a # note", "int8 a#note"]
)
def test_whitespace_and_comments_do_not_change_fields(line: str) -> None:
    assert [(f.name, f.type, f.default) for f in message(line).fields] == [("a", INT8, None)]


@pytest.mark.parametrize("line", ["int8 A=-1", "int8 A = -1", "int8  A  =  -1   # why", "int8\tA\t=\t-1"])
def test_whitespace_and_comments_do_not_change_constants(line: str) -> None:
    assert [(c.name, c.type, c.value) for c in message(line).constants] == [("A", INT8, -1)]


@pytest.mark.parametrize("line", ["int8 \xa0a \xa05", "int8 A\xa0=\xa05", "int8  \u3000A=5\xa0"])
def test_other_whitespace_around_names_and_values_is_ignored(line: str) -> None:
    parsed = message(line)
    values = [(f.name.upper(), f.default) for f in parsed.fields] + [
        (c.name, c.value) for c in parsed.constants
    ]
    assert values == [("A", 5)]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", "\v", "\f", "\x1c", "\x85", "\u2028"])
def test_all_line_endings_are_supported(end: str) -> None:
    assert [f.name for f in message(f"int8 a{end}int8 b{end}").fields] == ["a", "b"]


def test_a_value_ends_at_the_first_hash() -> None:
    parsed = message('string a "a#b"\nstring A="a#b"\nstring B=x=y\nstring C=\n')
    assert parsed.fields[0].default == '"a'
    assert [c.value for c in parsed.constants] == ['"a', "x=y", ""]


def test_tabs_inside_quotes_become_spaces() -> None:
    assert message('string a "a\tb"').fields[0].default == "a b"


def test_a_field_and_a_constant_may_differ_only_in_case() -> None:
    parsed = message("int8 a\nint8 A=1")
    assert (parsed.fields, parsed.constants) == ((Field("a", INT8),), (Constant("A", INT8, 1),))


def test_the_placeholder_member_is_hidden_only_if_it_is_the_only_one() -> None:
    hidden = "uint8 structure_needs_at_least_one_member"
    assert message(hidden).fields == ()
    assert message("").members == message(hidden).members
    assert len(message(f"{hidden}\nint8 a").fields) == 2


@pytest.mark.parametrize(
    ("text", "file", "docs"),
    [
        ("# f1\n# f2\n\nint8 a\n", ("f1", "f2"), {"a": ()}),
        ("\n# c1\n# c2\nint8 a # t1\n  # ind1\n", (), {"a": ("c1", "c2", "t1", "ind1")}),
        ("\nint8 a\n# next\n\n# next2\nint8 b\n", (), {"a": (), "b": ("next", "next2")}),
        ("int8 a\n# dangling\n", (), {"a": ()}),
        ("# top\nint8 a\n", ("top",), {"a": ()}),
        ("\n# top\nint8 a\n", (), {"a": ("top",)}),
        ("\n### x ###\nint8 a\n", (), {"a": ("x ###",)}),
        ("\n  # nobody's\nint8 a\n", (), {"a": ()}),
        ("#\n# text\n#\n#\n#   deeper\n##\n\nint8 a\n", ("text", "", "  deeper"), {"a": ()}),
        ("\n# one\n# C:\\Users \\\nint8 a\n", (), {"a": ("one", "C:\\Users \\")}),
    ],
)
def test_comments_are_attached_to_the_file_or_the_adjacent_declaration(
    text: str, file: tuple[str, ...], docs: dict[str, tuple[str, ...]]
) -> None:
    parsed = message(text)
    assert parsed.doc == file
    assert {f.name: f.doc for f in parsed.fields} == docs


@pytest.mark.parametrize(
    ("comment", "doc", "unit"),
    [
        ("range [0, 1] in [m]", ("range [0, 1] in",), "m"),
        ("pos [m] and [s]", ("pos [m] and [s]",), None),
        ("[rad/s]", (), "rad/s"),
        ("speed [m/s] of it", ("speed of it",), "m/s"),
        ("no unit", ("no unit",), None),
        ("empty []", ("empty []",), None),
    ],
)
def test_a_single_text_in_brackets_is_the_unit(comment: str, doc: tuple[str, ...], unit: str | None) -> None:
    field = message(f"int8 a # {comment}").fields[0]
    assert (field.doc, field.unit) == (doc, unit)


def test_services_and_actions_are_split_into_sections() -> None:
    service = parse(
        Source("tour", "srv/Go.srv", Path("Go.srv"), "# ask\nint8 a\n---\n# tell\nint8 a\nint8 A=1\n")
    )
    assert isinstance(service, Service)
    assert (service.request.name.name, service.response.name.name) == ("Go_Request", "Go_Response")
    assert (service.request.doc, service.response.doc) == (("ask",), ("tell",))
    assert [c.name for c in service.response.constants] == ["A"]
    action = parse(Source("tour", "action/Go.action", Path("Go.action"), "int8 a\n---\n---\nint8 c"))
    assert isinstance(action, Action)
    assert [len(part.fields) for part in (action.goal, action.result, action.feedback)] == [1, 0, 1]
    assert str(action.feedback.name) == "tour/action/Go_Feedback"


def test_problems_are_sorted_by_line() -> None:
    assert problems("int8 a 300\nfoo b\nint8 a\n") == [
        "msg/Walk.msg:1:8: '300' is out of range for int8",
        "msg/Walk.msg:2:1: unknown type 'foo'",
    ]


def test_problems_in_all_files_are_raised_together() -> None:
    sources = [Source("tour", f"msg/{name}.msg", Path(f"{name}.msg"), "foo a") for name in ("One", "Two")]
    with pytest.raises(InterfaceError) as caught:
        parse_all(sources)
    assert [str(problem.location) for problem in caught.value.problems] == ["One.msg:1:1", "Two.msg:1:1"]


def test_comments_of_an_invalid_declaration_are_dropped() -> None:
    text = "int8 a\nfoo b\n   # about b\nint8 c"
    assert problems(text) == ["msg/Walk.msg:2:1: unknown type 'foo'"]


ELEMENTS = st.one_of(
    st.sampled_from(sorted(PRIMITIVES)),
    st.builds("{}<={}".format, st.sampled_from(["string", "wstring"]), st.integers(1, 99)),
    st.sampled_from(["string", "wstring", "Pose", "geometry_msgs/Pose"]),
)
# An unbounded sequence of bounded wide strings is rejected: rosidl reads it as something else.
TYPES = st.builds(
    "{}{}".format,
    ELEMENTS,
    st.one_of(st.just(""), st.just("[]"), st.builds("[{}]".format, st.integers(1, 99)), st.just("[<=7]")),
).filter(lambda written: not (written.startswith("wstring<=") and written.endswith("[]")))


@given(st.lists(TYPES, max_size=6), st.sampled_from(["\n", "\n\n", "  # note\n", "\n# note\n"]))
def test_every_well_formed_declaration_becomes_a_field(types: list[str], between: str) -> None:
    text = "".join(f"{type_} f{number}{between}" for number, type_ in enumerate(types))
    assert [f.name for f in message(text).fields] == [f"f{number}" for number in range(len(types))]


def test_constant_names_are_checked() -> None:
    good = ["A", "A1", "A_B", "A_1", "AB_C2"]
    assert [c.name for c in message("\n".join(f"int8 {n}=1" for n in good)).constants] == good
    for bad in ("A__B", "A_", "_A", "aA", "1A"):
        assert "invalid constant name" in problems(f"int8 {bad}=1")[0]
