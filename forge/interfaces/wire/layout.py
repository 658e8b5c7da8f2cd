"""The layout of a serialized message (XCDR1, DDS-XTypes 1.3): runs of fixed-size members and what is between.

A layout is a message flattened into steps in serialization order. `forge.interfaces.wire.flattening`
computes layouts; the serializers of all languages are generated from them:

    Run                 adjacent fixed-size members, moved with one bounds check and one copy
    StringData          the characters of a string; its length is the last member of the previous run
    PrimitiveElements   values of one primitive type: a sequence with its length in the previous run, or a
                        large array
    Loop                strings or messages in an array, or in a sequence with its length in the previous run
    MessageCall         a message too large to inline again; the code for it accepts any start offset

Offsets count from the first byte after the encapsulation header. Often an offset is only partly known at
generation time; a Phase is the known part. After an aligned double the alignment is fully known, after a
string not at all. Where the phase is insufficient, the padding is computed at run time.
"""

from __future__ import annotations

from math import gcd
from typing import TYPE_CHECKING, Final

from forge.base.frozen import frozen
from forge.interfaces.model import Array, Primitive, Sequence, String

if TYPE_CHECKING:
    from forge.interfaces.model import TypeName

SIZES: Final = {
    **dict.fromkeys(("boolean", "octet", "char", "int8", "uint8"), 1),
    **dict.fromkeys(("int16", "uint16"), 2),
    **dict.fromkeys(("int32", "uint32", "float", "wchar"), 4),
    **dict.fromkeys(("int64", "uint64", "double"), 8),
}
"""The size of each primitive type in bytes, which is also its alignment."""

MAX_ALIGNMENT: Final = 8
"""The largest alignment of any type."""

Path = tuple[str, ...]
"""Member names, starting at the message of the layout or at the element of a loop; () is the start itself."""


@frozen
class Phase:
    """The known part of an offset: its remainder modulo `modulus`, which is 1, 2, 4 or 8."""

    modulus: int
    remainder: int

    def padding(self, alignment: int) -> int | None:
        """Return the number of bytes to the next multiple of `alignment`, or None if unknown."""
        return -self.remainder % alignment if alignment <= self.modulus else None

    def aligned(self, alignment: int) -> Phase:
        """Return the phase after padding to `alignment`."""
        padding = self.padding(alignment)
        return Phase(alignment, 0) if padding is None else self.after(padding)

    def after(self, count: int) -> Phase:
        """Return the phase `count` bytes later."""
        return Phase(self.modulus, (self.remainder + count) % self.modulus)

    def join(self, other: Phase) -> Phase:
        """Return the phase of an offset that has either this or the other phase."""
        modulus = gcd(self.modulus, other.modulus, self.remainder - other.remainder)
        return Phase(modulus, self.remainder % modulus)


START: Final = Phase(MAX_ALIGNMENT, 0)
UNKNOWN: Final = Phase(1, 0)


@frozen
class Scalar:
    """One primitive. A hidden one stands for an empty message: written as 0, skipped on reading."""

    path: Path
    type: Primitive
    hidden: bool = False

    @property
    def size(self) -> int:
        return SIZES[self.type.name]

    @property
    def alignment(self) -> int:
        return SIZES[self.type.name]


@frozen
class InlineArray:
    """A small array of primitives, part of a run."""

    path: Path
    type: Array
    of: Primitive

    @property
    def size(self) -> int:
        return self.type.size * SIZES[self.of.name]

    @property
    def alignment(self) -> int:
        return SIZES[self.of.name]


@frozen
class Length:
    """The uint32 length before variable-size data.

    For a string it counts bytes, including the terminating NUL; for a wstring UTF-16 code units, without a
    NUL; for a sequence elements.
    """

    path: Path
    type: String | Sequence

    @property
    def size(self) -> int:
        return 4

    @property
    def alignment(self) -> int:
        return 4


Member = Scalar | InlineArray | Length


@frozen
class Segment:
    """A part of a run with known padding: `paddings[i]` bytes precede `members[i]`.

    If `alignment` is greater than 1, the offset must first be rounded up to a multiple of it.
    """

    alignment: int
    members: tuple[Member, ...]
    paddings: tuple[int, ...]

    @property
    def size(self) -> int:
        """The size in bytes after that rounding, including padding."""
        return sum(self.paddings) + sum(member.size for member in self.members)


@frozen
class Run:
    """Adjacent fixed-size members, as many as possible."""

    members: tuple[Member, ...]
    start: Phase

    @property
    def alignment(self) -> int:
        return max(member.alignment for member in self.members)

    @property
    def length(self) -> Length | None:
        """The length at the end of the run, if any; it belongs to the step after the run."""
        last = self.members[-1]
        return last if isinstance(last, Length) else None

    @property
    def segments(self) -> tuple[Segment, ...]:
        """The run, split where padding is unknown; one segment if all padding is known."""
        segments: list[tuple[int, list[Member], list[int]]] = []
        phase = self.start
        for member in self.members:
            padding = phase.padding(member.alignment)
            if padding is None or not segments:
                segments.append((1 if padding is not None else member.alignment, [], []))
            segments[-1][1].append(member)
            segments[-1][2].append(padding or 0)
            phase = phase.aligned(member.alignment).after(member.size)
        return tuple(
            Segment(alignment, tuple(members), tuple(paddings)) for alignment, members, paddings in segments
        )

    def end(self, start: Phase) -> Phase:
        """Return the phase after the run if it starts at `start`."""
        for member in self.members:
            start = start.aligned(member.alignment).after(member.size)
        return start

    def is_fixed(self, start: Phase) -> bool:
        """Return True if all padding is known when the run starts at `start`."""
        for member in self.members:
            if start.padding(member.alignment) is None:
                return False
            start = start.aligned(member.alignment).after(member.size)
        return True


@frozen
class StringData:
    """The characters of a string and a NUL, or the code units of a wstring with 4 bytes each."""

    path: Path
    type: String
    start: Phase


@frozen
class PrimitiveElements:
    """Adjacent primitives; an empty sequence has no padding either."""

    path: Path
    type: Array | Sequence
    of: Primitive
    start: Phase

    @property
    def padding(self) -> int | None:
        """The padding before the first value, or None if it depends on the message."""
        return self.start.padding(SIZES[self.of.name])


@frozen
class Loop:
    """Consecutive strings or messages; `body` is the layout of each, with paths relative to the element."""

    path: Path
    type: Array | Sequence
    body: MessageLayout
    start: Phase


@frozen
class MessageCall:
    """A message with a layout of its own, which starts at an unknown phase."""

    path: Path
    name: TypeName
    start: Phase


LayoutStep = Run | StringData | PrimitiveElements | Loop | MessageCall


@frozen
class InlinedMessage:
    """A nested message inlined into a layout; languages that create objects need to create it."""

    path: Path
    name: TypeName


@frozen
class MessageLayout:
    """The steps of a message that starts at the phase `start`, and the phase `end` after it."""

    steps: tuple[LayoutStep, ...]
    inlined: tuple[InlinedMessage, ...]
    start: Phase
    end: Phase

    @property
    def min_size(self) -> int:
        """The minimum size of the message in bytes without padding; at least 1."""
        return sum(_min_size(step) for step in self.steps)


def _min_size(step: LayoutStep) -> int:
    match step:
        case Run(members):
            return sum(member.size for member in members)
        case PrimitiveElements(_, Array(_, count), of):
            return count * SIZES[of.name]
        case Loop(_, Array(_, count), body):
            return count * body.min_size
        case MessageCall():
            return 1
        case _:
            return 0
