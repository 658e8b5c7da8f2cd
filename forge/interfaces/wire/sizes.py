"""How many bytes a message takes on the wire (XCDR1), and where in it each member lies.

Offsets count from the first byte after the header, for a message that begins there. Inside another one a
message begins wherever that has got to: only primitives are aligned, so its padding may be different.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.interfaces.model import Array, Named, Primitive, Sequence, String
from forge.interfaces.wire.flattening import LayoutBuilder
from forge.interfaces.wire.layout import MAX_ALIGNMENT, SIZES, START, Phase

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.interfaces.model import Element, Message, Type, TypeName

_LENGTH = SIZES["uint32"]
_CODE_UNIT = SIZES["wchar"]


@frozen
class MemberSize:
    """The bytes of one member: the least offset, whether it is the only one, and how many there are."""

    offset: int
    fixed: bool
    alignment: int
    least: int
    most: int | None
    """None where nothing bounds it."""


@frozen
class MessageSize:
    """The bytes of a message: those of its members in their order, and how many there are in all."""

    spans: tuple[MemberSize, ...]
    least: int
    most: int | None


class SizeCalculator:
    """The extents of messages that refer to each other; `known` has them all."""

    def __init__(self, known: Mapping[TypeName, Message]) -> None:
        """Know the messages."""
        self._known = known
        self._layouts = LayoutBuilder(known)
        self._growths: dict[tuple[TypeName, int, bool], int | None] = {}
        self._behind: dict[tuple[Type, Phase], Phase] = {}

    def of(self, message: Message) -> MessageSize:
        """Return the extent of a message."""
        spans = []
        least, phase = 0, START
        most: int | None = 0
        for member in message.members:
            alignment = self._alignment(member.type)
            least, phase = _rounded(least, alignment), phase.aligned(alignment)
            most = None if most is None else _rounded(most, alignment)
            fewest, widest = self._bytes(member.type, phase)
            spans.append(MemberSize(least, least == most, alignment, fewest, widest))
            phase = self._phase_behind(member.type, phase)
            more = None if most is None else self._growth(member.type, most % MAX_ALIGNMENT, full=True)
            most = None if most is None or more is None else most + more
            least += self._growth(member.type, least % MAX_ALIGNMENT, full=False) or 0
        return MessageSize(tuple(spans), least, most)

    def _bytes(self, type_: Type, phase: Phase) -> tuple[int, int | None]:
        """Return the fewest and the most bytes of a member, wherever such a phase lets it begin."""
        starts = range(phase.remainder, MAX_ALIGNMENT, phase.modulus)
        fewest = min(self._growth(type_, start, full=False) or 0 for start in starts)
        widest = [self._growth(type_, start, full=True) for start in starts]
        return fewest, None if None in widest else max(size for size in widest if size is not None)

    def _phase_behind(self, type_: Type, phase: Phase) -> Phase:
        key = (type_, phase)
        if key not in self._behind:
            self._behind[key] = self._layouts.of_element(type_, phase).end
        return self._behind[key]

    def _alignment(self, type_: Type) -> int:
        """Return what the first byte of a member is a multiple of."""
        match type_:
            case Primitive(name):
                return SIZES[name]
            case Array(of):
                return self._alignment(of)
            case Named(name):
                return self._alignment(self._known[name].members[0].type)
            case String() | Sequence():
                return _LENGTH

    def _growth(self, type_: Type, at: int, *, full: bool) -> int | None:
        """Return how many bytes a member adds that begins at `at`: empty, or else as full as can be."""
        match type_:
            case Primitive(name):
                return _rounded(at, SIZES[name]) + SIZES[name] - at
            case Named(name):
                return self._growth_of_message(name, at, full=full)
            case Array(of, size):
                return self._growth_of_several(of, size, at, full=full)
            case String() | Sequence():
                return self._growth_of_counted(type_, at, full=full)

    def _growth_of_counted(self, type_: String | Sequence, at: int, *, full: bool) -> int | None:
        """Return what a length adds, and what it is the length of."""
        start = _rounded(at, _LENGTH) + _LENGTH - at
        more: int | None
        match type_:
            case String(wide, bound):
                count = bound if full else 0
                more = None if count is None else count * _CODE_UNIT if wide else count + 1
            case Sequence(of, bound):
                count = bound if full else 0
                more = None if count is None else self._growth_of_several(of, count, at + start, full=full)
        return None if more is None else start + more

    def _growth_of_message(self, name: TypeName, at: int, *, full: bool) -> int | None:
        key = (name, at % MAX_ALIGNMENT, full)
        if key not in self._growths:
            end: int | None = at
            for member in self._known[name].members:
                more = None if end is None else self._growth(member.type, end, full=full)
                end = None if end is None or more is None else end + more
            self._growths[key] = None if end is None else end - at
        return self._growths[key]

    def _growth_of_several(self, of: Element, count: int, at: int, *, full: bool) -> int | None:
        """Return what `count` elements add; where their beginnings repeat, so does what they add."""
        end, left = at, count
        seen: dict[int, tuple[int, int]] = {}
        while left:
            if end % MAX_ALIGNMENT in seen:
                before, behind = seen[end % MAX_ALIGNMENT]
                period, gain = before - left, end - behind
                end += left // period * gain
                left %= period
                seen.clear()
                if not left:
                    break
            seen[end % MAX_ALIGNMENT] = (left, end)
            more = self._growth(of, end, full=full)
            if more is None:
                return None
            end += more
            left -= 1
        return end - at


def _rounded(offset: int, alignment: int) -> int:
    return -(-offset // alignment) * alignment
