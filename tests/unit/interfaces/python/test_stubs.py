"""Stubs of generated Python (PEP 561)."""

import ast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.interfaces.model import Catalog, Constant, Field, Message, Primitive, TypeName
from forge.interfaces.python import target as python
from forge.interfaces.python.target import docstring


@given(st.lists(st.text(), min_size=1, max_size=4))
def test_docstrings_are_escaped(lines: list[str]) -> None:
    stripped = [line.rstrip() for line in lines]
    text = "\n".join(docstring(lines))
    if not any(stripped):
        assert not text
    else:
        end = "\n" if len(lines) > 1 else ""
        assert ast.literal_eval(text) == "\n".join(stripped) + end


@pytest.mark.parametrize(
    ("field", "argument"),
    [
        ("value", "check_fields: object"),
        ("object", "check_fields: _object"),
        ("check_fields", "check_fields: float"),
    ],
)
def test_constructors_accept_check_fields_unless_a_field_has_this_name(field: str, argument: str) -> None:
    name = TypeName("checked", "msg", "Speed")
    message = Message(name, (Field(field, Primitive("double"), None, (), None),), (), ())
    files = {
        file.path: file.text
        for file in python.files(Catalog("checked", {name: message}, {name: message}, {}))
    }
    stub = files["checked/msg/_speed.pyi"]
    assert f"        {argument} = ...,\n    ) -> None: ..." in stub
    assert stub.count("check_fields: ") == 1


def test_comments_and_units_document_fields_and_constants() -> None:
    name = TypeName("documented", "msg", "Speed")
    message = Message(
        name,
        (Field("value", Primitive("double"), None, ("how", "", "fast"), "m/s"),),
        (Constant("TOP", Primitive("int8"), 9, ("no more",)),),
        ("A speed.", "", "Of anything."),
    )
    files = {
        file.path: file.text
        for file in python.files(Catalog("documented", {name: message}, {name: message}, {}))
    }
    class_ = ast.parse(files["documented/msg/_speed.pyi"]).body[-1]
    assert isinstance(class_, ast.ClassDef)
    assert ast.get_docstring(class_) == "A speed.\n\nOf anything."
    strings = [
        node.value.value
        for node in class_.body
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    ]
    assert strings[1:] == ["no more"]
    (value, _) = [node for node in class_.body if isinstance(node, ast.FunctionDef) and node.name == "value"]
    assert ast.get_docstring(value) == "how\n\nfast\n[m/s]"
