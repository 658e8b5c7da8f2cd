"""A tuple that is computed on first access.

Most tasks of a plan may never run, because their dependencies are unchanged or their results are cached.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeVar, overload

if TYPE_CHECKING:
    from collections.abc import Callable

_Item_co = TypeVar("_Item_co", covariant=True)


class LazyTuple(Sequence[_Item_co]):
    """Stands for the tuple returned by the pure function `make`; equals it, and is pickled as it."""

    __slots__ = ("_made", "_make")

    def __init__(self, make: Callable[[], tuple[_Item_co, ...]]) -> None:
        self._make = make
        self._made: tuple[_Item_co, ...] | None = None

    def __len__(self) -> int:
        return len(self._all())

    @overload
    def __getitem__(self, index: int) -> _Item_co: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[_Item_co, ...]: ...
    def __getitem__(self, index: int | slice) -> _Item_co | tuple[_Item_co, ...]:
        return self._all()[index]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, tuple | LazyTuple) and self._all() == tuple(other)

    def __hash__(self) -> int:
        return hash(self._all())

    def __reduce__(self) -> tuple[type[tuple[_Item_co, ...]], tuple[tuple[_Item_co, ...]]]:
        return (tuple, (self._all(),))

    def __repr__(self) -> str:
        return repr(self._all())

    def _all(self) -> tuple[_Item_co, ...]:
        if self._made is None:
            self._made = self._make()
        return self._made
