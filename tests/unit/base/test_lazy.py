"""A tuple that is computed on first access."""

from __future__ import annotations

import pickle

from forge.base.lazy import LazyTuple


def test_it_is_made_once_and_only_when_looked_into() -> None:
    made = []

    def make() -> tuple[int, ...]:
        made.append(True)
        return (1, 2, 3)

    lazy = LazyTuple(make)
    assert made == []
    assert [*lazy] == [1, 2, 3]
    assert (len(lazy), lazy[0], lazy[1:], lazy[-1]) == (3, 1, (2, 3), 3)
    assert made == [True]


def test_it_is_equal_to_the_tuple_and_pickled_as_it() -> None:
    lazy = LazyTuple(lambda: (1, 2))
    assert lazy == (1, 2)
    assert lazy == LazyTuple(lambda: (1, 2))
    assert lazy != (1, 3)
    assert lazy != [1, 2]
    assert hash(lazy) == hash((1, 2))
    assert repr(lazy) == "(1, 2)"
    assert type(pickle.loads(pickle.dumps(lazy))) is tuple
