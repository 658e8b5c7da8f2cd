"""Schemas as stored by MCAP and rosbag2."""

import pytest

from forge.base.errors import InterfaceError
from forge.interfaces.model import TypeName
from forge.interfaces.schema import parse_name, read_schema

LINE = "=" * 80


def test_headings_are_parsed_with_or_without_a_namespace() -> None:
    text = f"A a\n{LINE}\nMSG: q/A\nint8 a\n\n{LINE}\nMSG: q/msg/B \n\n{LINE}\nIDL: q/idl/C\nmodule q {{}};"
    sources = read_schema(text, TypeName("p", "msg", "Top"))
    assert [(s.package, s.relative, s.text) for s in sources] == [
        ("p", "msg/Top.msg", "A a\n"),
        ("q", "msg/A.msg", "int8 a\n"),
        ("q", "msg/B.msg", ""),
        ("q", "idl/C.idl", "module q {};\n"),
    ]


@pytest.mark.parametrize(
    ("text", "line"),
    [(f"int8 a\n{LINE}\nint8 b", "p/msg/A:3:1: error:"), (f"int8 a\n{LINE}", "p/msg/A: error:")],
)
def test_a_section_without_a_type_name_is_reported(text: str, line: str) -> None:
    with pytest.raises(InterfaceError, match="expected the name of a type after a line of '='") as caught:
        read_schema(text, TypeName("p", "msg", "A"))
    assert str(caught.value).startswith(line)


def test_the_namespace_of_a_schema_name_is_optional() -> None:
    assert (
        parse_name("std_msgs/String")
        == parse_name("std_msgs/msg/String")
        == TypeName("std_msgs", "msg", "String")
    )
    for text in ("", "String", "a//b", "A/msg/B", "a/b/c/d"):
        with pytest.raises(InterfaceError, match="invalid type name"):
            parse_name(text)
