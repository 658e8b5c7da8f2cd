"""Selection options to names."""

import pytest

from forge.base.errors import SelectionError
from forge.workspace.selection import Query, duplicate_node, ignored, select

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
        (Query(select_regex=("[ab]",)), ("a", "b")),
        (Query(select=("c",), select_regex=("a",)), ("a", "c")),
        (Query(select_regex=()), ()),
        (Query(skip_regex=("[ab]",)), ("d", "c")),
        (Query(up_to_regex=("b",)), ("a", "b")),
        (Query(above_and_dependencies=("b",)), ("a", "b", "c")),
        (Query(above_depth=(0, ("a",))), ("a",)),
        (Query(above_depth=(1, ("a",))), ("a", "b")),
        (Query(above_depth=(9, ("a",))), ("a", "b", "c")),
        (Query(above_depth=(2, ())), ("a", "d", "b", "c")),
        (Query(select_by_dep=("a",)), ("b", "c")),
        (Query(skip_by_dep=("a",)), ("a", "d")),
        (Query(skip_up_to=("b",)), ("d", "c")),
        (Query(start="d"), ("d", "b", "c")),
        (Query(end="d"), ("a", "d")),
        (Query(start="d", end="b"), ("d", "b")),
    ],
)
def test_selection_options_narrow_the_selection(query: Query, expected: tuple[str, ...]) -> None:
    selection, warnings = select(query, ORDERED, NEEDS)
    assert selection.names == expected
    assert set(selection.left_out) == set(ORDERED) - set(expected)
    assert not warnings


def test_unknown_names_to_skip_and_patterns_without_a_match_give_warnings() -> None:
    selection, warnings = select(Query(select_regex=("x",), skip=("aa",)), ORDERED, NEEDS)
    assert selection.names == ()
    assert [(w.message, w.hint) for w in warnings] == [
        ("--packages-skip: no package named 'aa' in the workspace", "did you mean 'a'?"),
        (
            "--packages-select-regex 'x' matches no package",
            "patterns match from the beginning of a name; to match anywhere use '.*x'",
        ),
    ]


def test_unknown_names_of_packages_to_select_are_errors() -> None:
    query = Query(select=("a", "aa"), up_to=("x",), above=("y",), select_by_dep=("z",))
    with pytest.raises(SelectionError) as error:
        select(query, ORDERED, NEEDS)
    assert [(each.message, each.hint) for each in error.value.problems] == [
        ("no package named 'aa' in the workspace", "did you mean 'a'?"),
        ("--packages-up-to: no package named 'x' in the workspace", None),
        ("--packages-above: no package named 'y' in the workspace", None),
        ("--packages-select-by-dep: no package named 'z' in the workspace", None),
    ]


def test_limits_apply_in_addition_to_selection_options() -> None:
    selection, _ = select(Query(skip=("a",)), ORDERED, NEEDS, [("not changed", frozenset({"a", "b"}))])
    assert selection.names == ("b",)
    assert selection.left_out == {"a": "named by --packages-skip", "c": "not changed", "d": "not changed"}


@pytest.mark.parametrize(
    "query",
    [
        Query(up_to_regex=("x",)),
        Query(above_and_dependencies=("x",)),
        Query(above_depth=(1, ("x",))),
        Query(start="x"),
        Query(end="x"),
        Query(start="c", end="a"),
        Query(select=("x",)),
        Query(skip=("x",), strict=True),
        Query(skip_by_dep=("x",), strict=True),
    ],
)
def test_a_query_that_cannot_select_anything_is_an_error(query: Query) -> None:
    with pytest.raises(SelectionError):
        select(query, ORDERED, NEEDS)


def test_ignored_packages_are_not_unknown_names() -> None:
    query = Query(up_to=("gone",), ignore=("gone", "x"), ignore_regex=("g", "y"))
    selection, warnings = select(query, ORDERED, NEEDS, known=(*ORDERED, "gone"))
    assert selection.names == ()
    assert [warning.message for warning in warnings] == [
        "--packages-ignore: no package named 'x' in the workspace",
        "--packages-ignore-regex 'y' matches no package",
    ]
    assert ignored(query, ["gone", "good", "a"]) == {"gone", "good"}


def test_packages_with_the_same_name_are_selected_together() -> None:
    other = duplicate_node("a", "again")
    needs = {
        "a": frozenset[str](),
        other: frozenset({"d"}),
        "b": frozenset({"a", other}),
        "d": frozenset[str](),
    }
    ordered = ("a", "d", other, "b")
    assert select(Query(select=("a",)), ordered, needs)[0].names == ("a", other)
    assert select(Query(up_to=("b",)), ordered, needs)[0].names == ordered
    assert select(Query(skip_by_dep=("d",)), ordered, needs)[0].names == ("a", "d")
