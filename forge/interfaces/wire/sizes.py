"""The serialized size of a message (XCDR1) and the offset of each member.

Offsets count from the first byte after the encapsulation header, for a top-level message. The padding of a
nested message depends on its start offset, because XCDR1 aligns primitives only.
"""

from __future__ import annotations

from collections.abc import Mapping

from forge.base.frozen import frozen
from forge.interfaces.model import Array, Element, Message, Named, Primitive, Sequence, String, Type, TypeName
from forge.interfaces.wire.layout import MAX_ALIGNMENT, SIZES, START, LayoutBuilder, Phase

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
        self._layouts = LayoutBuilder(known)
        self._message_sizes: dict[tuple[TypeName, int, bool], int | None] = {}
        self._end_phases: dict[tuple[Type, Phase], Phase] = {}

    def of(self, message: Message) -> MessageSize:
        members = []
        low, phase = 0, START
        high: int | None = 0
        for member in message.members:
            alignment = self._alignment(member.type)
            low, phase = _rounded(low, alignment), phase.aligned(alignment)
            high = None if high is None else _rounded(high, alignment)
            # The minimum and maximum size over all start offsets of the phase.
            starts = range(phase.remainder, MAX_ALIGNMENT, phase.modulus)
            smallest = min(self._size_at(member.type, start, full=False) or 0 for start in starts)
            sizes = [self._size_at(member.type, start, full=True) for start in starts]
            largest = None if None in sizes else max(size for size in sizes if size is not None)
            members.append(MemberSize(low, low == high, alignment, smallest, largest))
            key = (member.type, phase)
            if key not in self._end_phases:
                self._end_phases[key] = self._layouts.of_element(member.type, phase).end
            phase = self._end_phases[key]
            more = None if high is None else self._size_at(member.type, high % MAX_ALIGNMENT, full=True)
            high = None if high is None or more is None else high + more
            low += self._size_at(member.type, low % MAX_ALIGNMENT, full=False) or 0
        return MessageSize(tuple(members), low, high)

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

    def _size_at(self, type_: Type, start: int, *, full: bool) -> int | None:
        """Return the size of a member at offset `start`, including padding; None if unbounded.

        Strings and sequences are empty, or filled up to their bounds if `full` is True.
        """
        match type_:
            case Primitive(name):
                return _rounded(start, SIZES[name]) + SIZES[name] - start
            case Named(name):
                return self._message_size(name, start, full=full)
            case Array(of, size):
                return self._elements_size(of, size, start, full=full)
            case String() | Sequence():
                return self._variable_size(type_, start, full=full)

    def _variable_size(self, type_: String | Sequence, start: int, *, full: bool) -> int | None:
        prefix = _rounded(start, _LENGTH) + _LENGTH - start
        size: int | None
        match type_:
            case String(wide, bound):
                count = bound if full else 0
                size = None if count is None else count * _CODE_UNIT if wide else count + 1
            case Sequence(of, bound):
                count = bound if full else 0
                size = None if count is None else self._elements_size(of, count, start + prefix, full=full)
        return None if size is None else prefix + size

    def _message_size(self, name: TypeName, start: int, *, full: bool) -> int | None:
        key = (name, start % MAX_ALIGNMENT, full)
        if key not in self._message_sizes:
            end: int | None = start
            for member in self._known[name].members:
                size = None if end is None else self._size_at(member.type, end, full=full)
                end = None if end is None or size is None else end + size
            self._message_sizes[key] = None if end is None else end - start
        return self._message_sizes[key]

    def _elements_size(self, of: Element, count: int, start: int, *, full: bool) -> int | None:
        """Return the size of `count` elements; once start phases repeat, the sizes repeat as well."""
        end, remaining = start, count
        visited: dict[int, tuple[int, int]] = {}
        while remaining:
            if end % MAX_ALIGNMENT in visited:
                left_before, end_before = visited[end % MAX_ALIGNMENT]
                period, size_of_period = left_before - remaining, end - end_before
                end += remaining // period * size_of_period
                remaining %= period
                visited.clear()
                if not remaining:
                    break
            visited[end % MAX_ALIGNMENT] = (remaining, end)
            size = self._size_at(of, end, full=full)
            if size is None:
                return None
            end += size
            remaining -= 1
        return end - start


def _rounded(offset: int, alignment: int) -> int:
    return -(-offset // alignment) * alignment
