"""The serialized size of a message (XCDR1) and the offset of each member.

Offsets count from the first byte after the encapsulation header, for a top-level message. The padding of a
nested message depends on its start offset, because XCDR1 aligns primitives only.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from math import inf

from forge.base.frozen import frozen
from forge.interfaces.model import Array, Message, Named, Primitive, Sequence, String, Type, TypeName
from forge.interfaces.wire.layout import MAX_ALIGNMENT, SIZES, START, LayoutBuilder

_LENGTH = SIZES["uint32"]
_CODE_UNIT = SIZES["wchar"]


@frozen
class MemberSize:
    """The minimum offset of a member, whether it is the only possible one, and the member's size in bytes."""

    offset: int
    fixed: bool
    alignment: int
    min_size: int
    max_size: int | None
    """None if unbounded."""


@frozen
class MessageSize:
    """The sizes of the members of a message, in their order, and its total size in bytes."""

    members: tuple[MemberSize, ...]
    min_size: int
    max_size: int | None


class SizeCalculator:
    """Computes the sizes of messages; `known` contains them and all nested messages."""

    def __init__(self, known: Mapping[TypeName, Message]) -> None:
        self._known = known
        layouts = LayoutBuilder(known)
        self._size = cache(self._computed_size)
        self._end = cache(lambda type_, phase: layouts.of_element(type_, phase).end)

    def of(self, message: Message) -> MessageSize:
        members = []
        low, high, phase = 0.0, 0.0, START
        for member in message.members:
            alignment = self._alignment(member.type)
            low, high, phase = _rounded(low, alignment), _rounded(high, alignment), phase.aligned(alignment)
            # The minimum and maximum size over all start offsets of the phase.
            starts = range(phase.remainder, MAX_ALIGNMENT, phase.modulus)
            smallest = min(self._size_at(member.type, start, full=False) for start in starts)
            largest = max(self._size_at(member.type, start, full=True) for start in starts)
            members.append(MemberSize(int(low), low == high, alignment, int(smallest), _limit(largest)))
            phase = self._end(member.type, phase)
            low += self._size_at(member.type, low, full=False)
            high += self._size_at(member.type, high, full=True)
        return MessageSize(tuple(members), int(low), _limit(high))

    def _alignment(self, type_: Type) -> int:
        match type_:
            case Primitive(name):
                return SIZES[name]
            case Array(of):
                return self._alignment(of)
            case Named(name):
                return self._alignment(self._known[name].members[0].type)
            case String() | Sequence():
                return _LENGTH

    def _size_at(self, type_: Type, start: float, *, full: bool) -> float:
        """Return the size of a member at offset `start`, including padding, in whole bytes or infinite.

        Strings and sequences are empty, or filled up to their bounds if `full` is True.
        """
        return inf if start == inf else self._size(type_, int(start) % MAX_ALIGNMENT, full)

    def _computed_size(self, type_: Type, start: int, full: bool) -> float:
        match type_:
            case Primitive(name):
                return _rounded(start, SIZES[name]) + SIZES[name] - start
            case Named(name):
                end: float = start
                for member in self._known[name].members:
                    end += self._size_at(member.type, end, full=full)
                return end - start
            case Array(of, 0 | 1 as count):
                return self._size_at(of, start, full=full) if count else 0
            case Array(of, count):  # by halves, which are often equal and then cached
                half = self._size_at(Array(of, count // 2), start, full=full)
                return half + self._size_at(Array(of, count - count // 2), start + half, full=full)
            case String(_, bound) | Sequence(_, bound):
                prefix = _rounded(start, _LENGTH) + _LENGTH - start
                filled = 0 if not full else bound
                if filled is None:
                    return inf
                if isinstance(type_, String):
                    return prefix + (filled * _CODE_UNIT if type_.wide else filled + 1)
                return prefix + self._size_at(Array(type_.of, filled), start + prefix, full=full)


def _limit(size: float) -> int | None:
    return None if size == inf else int(size)


def _rounded(offset: float, alignment: int) -> float:
    return offset if offset == inf else -(-offset // alignment) * alignment
