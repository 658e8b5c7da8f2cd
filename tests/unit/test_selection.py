"""Selection options to names."""

import pytest

from forge.errors import SelectionError
from forge.selection import Query, select

NEEDS = {"a": frozenset[str](), "b": frozenset({"a"}), "c": frozenset({"b"}), "d": frozenset[str]()}
ORDERED = ("a", "d", "b", "c")


@pytest.mark.parametrize(
    ("query", "expected"),
    [
        (Query(), ("a", "d", "b", "c")),
        (Query(select=("c", "a")), ("a", "c")),
        (Query(select=()), ()),
        (Query(skip=("a",)), ("d", "b", "c")),
        (Query(select=("a", "b"), skip=("a",)), ("b",)),
        (Query(up_to=("b",)), ("a", "b")),
        (Query(above=("b",)), ("b", "c")),
        (Query(up_to=("c",), above=("b",)), ("b", "c")),
    ],
)
def test_every_option_only_deselects(query: Query, expected: tuple[str, ...]) -> None:
    selection, warnings = select(query, ORDERED, NEEDS)
    assert selection.names == expected
    assert set(selection.left_out) == set(ORDERED) - set(expected)
    assert not warnings


def test_unknown_names_in_select_and_skip_are_warnings() -> None:
    selection, warnings = select(Query(select=("aa",), skip=("x",)), ORDERED, NEEDS)
    assert selection.names == ()
    assert [(w.message, w.hint) for w in warnings] == [
        ("--packages-select names 'aa', which is not in the workspace", "did you mean 'a'?"),
        ("--packages-skip names 'x', which is not in the workspace", None),
    ]


def test_unknown_names_in_up_to_and_above_stop() -> None:
    with pytest.raises(SelectionError) as error:
        select(Query(up_to=("x",), above=("y",)), ORDERED, NEEDS)
    assert len(error.value.problems) == 2
