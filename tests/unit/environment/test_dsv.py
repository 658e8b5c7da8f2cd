from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.base.errors import WorkspaceError
from forge.environment.dsv import DsvChange, Edit, Script, apply, order, parse_dsv, resolve_hooks
from tests.strategies import graphs


def prepend(value: str, variable: str = "X") -> Edit:
    return Edit("prepend", variable, value, below=True)


def after(held: dict[str, str], edits: Iterable[Edit], *, first: bool = False) -> dict[str, str]:
    """Return the variables after the edits of a package in /p."""
    return apply(held, [("/p", edit) for edit in edits], first=first)


@pytest.mark.parametrize(
    "line", ["prepend-non-duplicate", "set;A", "source", "prepend;A;b", "set;A B;c", "set;;c", "set;A$(x);c"]
)
def test_invalid_lines_are_reported_with_their_line(line: str) -> None:
    with pytest.raises(WorkspaceError) as caught:
        parse_dsv(f"set;GOOD;1\n{line}\n", "share/p/x.dsv")
    assert str(caught.value) == (
        "share/p/x.dsv:2: error: invalid environment hook\n"
        f"    {line}\n"
        "hint: the format is 'OPERATION;VARIABLE;VALUE' or 'source;PATH'"
    )


def test_resolving_hooks_checks_which_files_exist() -> None:
    hooks: list[DsvChange | Script] = [
        DsvChange("prepend-non-duplicate-if-exists", "PATH", "bin"),
        DsvChange("prepend-non-duplicate-if-exists", "PATH", "sbin"),
        DsvChange("prepend-non-duplicate", "PATH", "/opt"),
        DsvChange("append-non-duplicate", "PATH", ""),
        DsvChange("set", "HERE", "bin"),
        DsvChange("set", "WORD", "humble"),
        DsvChange("set-if-unset", "PREFIX", ""),
        DsvChange("set-if-unset", "ABSOLUTE", "/bin"),
        Script(("x.sh",)),
    ]
    assert resolve_hooks(hooks, {"bin", "/bin"}.__contains__) == (
        Edit("prepend", "PATH", "bin", below=True),
        Edit("prepend", "PATH", "/opt", below=False),
        Edit("append", "PATH", "", below=True),
        Edit("set", "HERE", "bin", below=True),
        Edit("set", "WORD", "humble", below=False),
        Edit("default", "PREFIX", "", below=True),
        Edit("default", "ABSOLUTE", "/bin", below=False),
        Script(("x.sh",)),
    )


@pytest.mark.parametrize(
    ("held", "first", "expected"),
    [
        (None, False, "/p/b:/p/a"),
        ("", False, "/p/b:/p/a"),
        ("/x", False, "/p/b:/p/a:/x"),
        ("/x:/p/a", False, "/p/b:/x:/p/a"),
        (":/x:", False, "/p/b:/p/a::/x:"),
        ("/x:/p/a", True, "/p/b:/p/a:/x"),
        (":/x:", True, "/p/b:/p/a:/x"),
    ],
)
def test_prepending_keeps_the_order_of_existing_entries(held: str | None, first: bool, expected: str) -> None:
    variables = {} if held is None else {"X": held}
    assert after(variables, [prepend("a"), prepend("b"), prepend("a")][: 2 if first else 3], first=first) == {
        "X": expected
    }


def test_append_set_and_default_operations_work() -> None:
    edits = [
        Edit("append", "X", "a", below=True),
        Edit("append", "X", "a", below=True),
        Edit("default", "X", "no", below=False),
        Edit("default", "Y", "y", below=False),
        Edit("set", "Z", "z", below=False),
        Edit("prepend", "Z", "", below=True),
        Edit("default", "E", "e", below=False),
    ]
    assert after({"X": "/x", "E": ""}, edits) == {"X": "/x:/p/a", "Y": "y", "Z": "/p:z", "E": "e"}
    assert after({}, [prepend("a"), Edit("set", "X", "s", below=False)]) == {"X": "s"}


_EDITS = st.lists(
    st.builds(
        Edit,
        st.sampled_from(["prepend", "append"]),
        st.sampled_from("XY"),
        st.sampled_from("abcd"),
        st.booleans(),
    )
)
_HELD = st.dictionaries(st.sampled_from("XY"), st.sampled_from(["", "/p/a", "b:/x", ":c:/p/d"]))


@given(_EDITS, _HELD)
def test_existing_entries_keep_their_order(edits: list[Edit], held: dict[str, str]) -> None:
    result = after(held, edits)
    for name, text in held.items():
        mine = (
            [entry for entry in result[name].split(":") if entry in text.split(":")] if name in result else []
        )
        assert not text or mine == text.split(":")


@given(graphs(acyclic=False))
def test_order_handles_dependency_cycles(needs: dict[str, frozenset[str]]) -> None:
    assert sorted(order(needs)) == sorted(needs)


def test_independent_packages_are_in_alphabetical_order() -> None:
    """The smallest ready name comes next, as in colcon, not layer by layer; unknown names are ignored."""
    needs = {"a": frozenset({"c"}), "b": frozenset({"stranger"}), "c": frozenset(), "d": frozenset({"a"})}
    assert order(needs) == ("b", "c", "a", "d")
