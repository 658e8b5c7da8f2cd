"""A tuple that is made when somebody looks into it.

Most tasks of a plan may never run: what they need comes out as before, or their result is in the cache.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeVar, overload

if TYPE_CHECKING:
    from collections.abc import Callable

_Item_co = TypeVar("_Item_co", covariant=True)


class Deferred(Sequence[_Item_co]):
    """Stands for the tuple that `make`, which is pure, returns; equal to it, and pickled as it."""

    __slots__ = ("_made", "_make")

    def __init__(self, make: Callable[[], tuple[_Item_co, ...]]) -> None:
        """Remember how; nothing is made yet."""
        self._make = make
        self._made: tuple[_Item_co, ...] | None = None

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._all())

    @overload
    def __getitem__(self, index: int) -> _Item_co: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[_Item_co, ...]: ...
    def __getitem__(self, index: int | slice) -> _Item_co | tuple[_Item_co, ...]:
        """Return one of them, or some."""
        return self._all()[index]

    def __eq__(self, other: object) -> bool:
        """Tell if both come to the same."""
        return isinstance(other, tuple | Deferred) and self._all() == tuple(other)

    def __hash__(self) -> int:
        """Return the hash of the tuple."""
        return hash(self._all())

    def __reduce__(self) -> tuple[type[tuple[_Item_co, ...]], tuple[tuple[_Item_co, ...]]]:
        """Be pickled as the tuple: how it is made is nobody else's."""
        return (tuple, (self._all(),))

    def __repr__(self) -> str:
        """Return how the tuple is shown."""
        return repr(self._all())

    def _all(self) -> tuple[_Item_co, ...]:
        if self._made is None:
            self._made = self._make()
        return self._made
