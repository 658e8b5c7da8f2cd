"""Names that are keywords of target languages."""

from __future__ import annotations

from pathlib import Path

import pytest

from forge.interfaces.model import Source
from forge.interfaces.read.declarations import check_keyword
from forge.interfaces.read.errors import ParseError
from forge.interfaces.read.lint import python_keywords
from forge.interfaces.read.parsing import parse_all


@pytest.mark.parametrize("name", ["class", "new", "restrict", "while"])
def test_no_field_has_the_name_of_a_keyword_of_c_or_cpp(name: str) -> None:
    with pytest.raises(ParseError, match=f"field name '{name}' is a keyword of"):
        check_keyword(name, 0, "field")


@pytest.mark.parametrize("what", ["module", "struct", "constant"])
def test_only_fields_are_named_like_keywords_of_python(what: str) -> None:
    check_keyword("lambda", 0, "field")
    with pytest.raises(ParseError, match=f"{what} name 'lambda' is a keyword of Python"):
        check_keyword("lambda", 0, what)


def test_each_field_named_like_a_keyword_is_a_warning_with_its_place() -> None:
    text = "---\nint8 x\nint8[<=9] in  # in\n"
    parsed = parse_all([Source("p", "srv/A.srv", Path("srv/A.srv"), text)])
    (warning,) = python_keywords(each.interface for each in parsed)
    assert warning.location is not None
    assert (warning.location.line, warning.location.column) == (3, 11)
    assert warning.message == "field name 'in' is a keyword of Python, where it becomes 'in_'"
    assert warning.hint == "rename it, for example to 'in_value'"


def test_no_other_name_of_a_field_is_a_warning() -> None:
    text = "int8 match\nint8 type\nint8 names\n"
    parsed = parse_all([Source("p", "msg/A.msg", Path("msg/A.msg"), text)])
    assert not list(python_keywords(each.interface for each in parsed))
