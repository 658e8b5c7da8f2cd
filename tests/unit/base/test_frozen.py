"""Frozen values behave like frozen dataclasses."""

import copy
import pickle
from dataclasses import FrozenInstanceError, asdict, dataclass, field, fields, replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.base.frozen import frozen


@frozen
class Ours:
    name: str
    count: int = 3
    words: dict[str, int] = field(default_factory=dict, hash=False)
    remark: str = field(default="", compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Theirs:
    name: str
    count: int = 3
    words: dict[str, int] = field(default_factory=dict, hash=False)
    remark: str = field(default="", compare=False, repr=False)


@frozen
class Empty:
    """No field at all."""


@frozen
class Checked:
    size: int

    def __post_init__(self) -> None:
        if self.size < 0:
            raise ValueError("negative")


VALUES = st.fixed_dictionaries(
    {"name": st.sampled_from("ab")},
    optional={
        "count": st.integers(0, 2),
        "words": st.dictionaries(st.sampled_from("xy"), st.integers(0, 1)),
        "remark": st.sampled_from("rs"),
    },
)


@given(VALUES, VALUES)
def test_frozen_classes_behave_like_dataclasses(one: dict[str, Any], other: dict[str, Any]) -> None:
    ours, theirs = (Ours(**one), Ours(**other)), (Theirs(**one), Theirs(**other))
    assert (ours[0] == ours[1]) == (theirs[0] == theirs[1])
    assert (hash(ours[0]) == hash(ours[1])) == (hash(theirs[0]) == hash(theirs[1]))
    assert repr(ours[0]) == repr(theirs[0]).replace("Theirs", "Ours")
    assert asdict(ours[0]) == asdict(theirs[0])
    assert asdict(replace(ours[0], count=9)) == asdict(replace(theirs[0], count=9))
    for copied in (pickle.loads(pickle.dumps(ours[0])), copy.deepcopy(ours[0]), copy.copy(ours[0])):
        assert copied == ours[0]
        assert copied.remark == ours[0].remark


def test_attributes_cannot_be_set_or_added() -> None:
    value = Ours("a")
    with pytest.raises(FrozenInstanceError):
        value.name = "b"  # type: ignore[misc]
    with pytest.raises(FrozenInstanceError):
        del value.name
    with pytest.raises(AttributeError):
        value.other = 1  # type: ignore[attr-defined]
    assert not hasattr(value, "__dict__")


def test_invalid_arguments_of_constructors_are_reported() -> None:
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'name'"):
        Ours()  # type: ignore[call-arg]
    with pytest.raises(ValueError, match="negative"):
        Checked(-1)
    assert Checked(1).size == 1


def test_defaults_patterns_and_empty_classes_behave_like_dataclasses() -> None:
    assert Ours("a").words is not Ours("a").words
    match Ours("a", 5):
        case Ours(name, count):
            assert (name, count) == ("a", 5)
    assert Empty() == Empty()
    assert repr(Empty()) == "Empty()"
    assert [f.name for f in fields(Ours)] == ["name", "count", "words", "remark"]
