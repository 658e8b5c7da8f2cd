"""Type descriptions are values."""

import sys
from collections.abc import Iterator
from importlib import import_module
from types import ModuleType

import pytest

from tests.generated import RUNTIME


@pytest.fixture(scope="module")
def definition() -> Iterator[ModuleType]:
    sys.path.insert(0, str(RUNTIME))
    yield import_module("rosidl_parser.definition")
    sys.path.remove(str(RUNTIME))


EXPRESSIONS = [
    "BasicType('int8')",
    "NamedType('x')",
    "NamespacedType(['std_msgs', 'msg'], 'Header')",
    "BoundedString(3)",
    "UnboundedString()",
    "BoundedWString(3)",
    "UnboundedWString()",
    "Array(BasicType('double'), 9)",
    "BoundedSequence(UnboundedString(), 3)",
    "UnboundedSequence(NamespacedType(['std_msgs', 'msg'], 'Header'))",
]


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_equal_descriptions_compare_equal(definition: ModuleType, expression: str) -> None:
    one, other = (eval(expression, vars(definition)) for _ in range(2))
    assert one == other
    assert hash(one) == hash(other)
    assert repr(one) == expression
    others = [eval(each, vars(definition)) for each in EXPRESSIONS if each != expression]
    assert one not in others


def test_descriptions_report_bounded_sizes(definition: ModuleType) -> None:
    text, element = definition.UnboundedString(), definition.BasicType("int8")
    assert not text.has_maximum_size()
    assert definition.BoundedString(3).has_maximum_size()
    assert not definition.UnboundedWString().has_maximum_size()
    assert definition.BoundedWString(3).maximum_size == 3
    assert definition.Array(element, 3).has_maximum_size()
    assert definition.BoundedSequence(element, 3).has_maximum_size()
    assert not definition.UnboundedSequence(element).has_maximum_size()


def test_abstract_base_classes_match_rosidl_parser(definition: ModuleType) -> None:
    element = definition.BasicType("int8")
    assert isinstance(element, definition.AbstractNestableType)
    assert isinstance(
        definition.BoundedString(1), definition.AbstractString | definition.AbstractGenericString
    )
    assert isinstance(definition.BoundedWString(1), definition.AbstractWString)
    assert isinstance(definition.Array(element, 1), definition.AbstractNestedType)
    assert isinstance(definition.BoundedSequence(element, 1), definition.AbstractSequence)
    assert not isinstance(definition.Array(element, 1), definition.AbstractSequence)
    assert definition.NamespacedType(("a", "msg"), "B").namespaced_name() == ("a", "msg", "B")
    assert definition.NamespacedType(("a", "msg"), "B").namespaces == ["a", "msg"]


def test_type_names_are_found_in_the_table_of_their_kind(definition: ModuleType) -> None:
    assert (definition.BOOLEAN_TYPE, definition.OCTET_TYPE) == ("boolean", "octet")
    assert {"boolean", "octet", "char", "double", "uint64"} <= set(definition.BASIC_TYPES)
