"""rosdep keys: by system, version and package manager; the first source wins."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forge.plugins.system_deps.lookup import Resolved, resolver
from forge.plugins.system_deps.system import System

pytest.importorskip("rosdep2", reason="needs rosdep: pip install rosdep")

JAMMY = System("ubuntu", "jammy", "apt")
EULER = System("openeuler", "24.03", "dnf")


@pytest.mark.parametrize(
    ("rule", "expected"),
    [
        ("a b", Resolved("apt", ("a", "b"))),
        ([], Resolved("apt", ())),
        ({"packages": ["a"]}, None),
        ({"apt": {"packages": "a b"}}, Resolved("apt", ("a", "b"))),
        ({"pip": ["a"], "apt": ["b"]}, Resolved("apt", ("b",))),
        ({"jammy": ["a"], "focal": ["b"]}, Resolved("apt", ("a",))),
        ({"focal": ["b"]}, None),
        ({"focal": ["b"], "*": ["c"]}, Resolved("apt", ("c",))),
        ({"*": ["c"], "jammy": None}, None),
        ({"source": {"uri": "x"}}, Resolved("source", ())),
        (None, None),
        (7, None),
        ({"apt": {"packages": 7}}, None),
    ],
)
def test_rules_are_interpreted_as_rosdep_does(rule: object, expected: Resolved | None) -> None:
    assert resolver([{"k": {"ubuntu": rule}}], JAMMY)("k") == expected


def test_yum_rules_apply_to_dnf() -> None:
    database = {"k": {"openeuler": {"24.03": {"yum": {"packages": ["a"]}}}}}
    assert resolver([database], EULER)("k") == Resolved("dnf", ("a",))


def test_rules_for_all_systems_are_used_last() -> None:
    anywhere = {"k": {"*": {"pip": ["p"]}}}
    assert resolver([anywhere], JAMMY)("k") == Resolved("pip", ("p",))
    assert resolver([anywhere, {"k": {"ubuntu": ["a"]}}], JAMMY)("k") == Resolved("apt", ("a",))


def test_the_first_database_with_an_entry_for_the_system_is_used() -> None:
    first: dict[str, Any] = {"k": {"ubuntu": ["mine"]}, "odd": "no mapping"}
    second: dict[str, Any] = {"k": {"ubuntu": ["theirs"], "fedora": ["f"]}, "l": {"ubuntu": ["l"]}}
    look_up = resolver([first, second], JAMMY)
    assert [look_up(key) for key in ("k", "l")] == [Resolved("apt", ("mine",)), Resolved("apt", ("l",))]
    assert [look_up(key) for key in ("odd", "other")] == [None, None]
    assert resolver([first, second], System("fedora", "40", "dnf"))("k") == Resolved("dnf", ("f",))


def test_unknown_systems_have_no_packages() -> None:
    assert resolver([{"k": {"void": ["v"]}}], System("void", "", ""))("k") is None


def test_any_rule_can_be_parsed() -> None:
    database: dict[str, Any] = {}
    look_up = resolver([database], JAMMY)
    words = st.sampled_from(["apt", "pip", "source", "jammy", "*", "packages", "uri"]) | st.text(max_size=3)
    values = st.recursive(
        st.none() | st.integers() | words, lambda each: st.lists(each) | st.dictionaries(words, each)
    )

    @given(values)
    @settings(max_examples=100)
    def is_read(rule: object) -> None:
        database["k"] = {"ubuntu": rule}
        look_up("k")

    is_read()
