"""How a message lies on the wire (XCDR1): runs of fixed-size members, and what stands between them.

A layout is a message flattened into steps, in the order of the bytes. `forge.interfaces.wire.flattening`
makes layouts; every target reads them:

    Run       fixed-size members side by side; one check and one copy move them all
    Chars     the text whose length stands last in the run before
    Numbers   values of one primitive type: those counted in the run before, or a large array
    Loop      strings or messages: as many as an array has, or as the run before counts
    Shared    a message too large to be unfolded once more: the code for it starts at any offset

Offsets count from the first byte after the header. Often only a part of one is known beforehand, and
that part is its Phase: after an aligned double all that matters is known, after a string nothing.
Where a phase says too little, the padding can only be worked out when the message is at hand.
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
"""The bytes of each primitive type, which are also its alignment."""

MAX_ALIGNMENT: Final = 8
"""No type is aligned to more."""

Path = tuple[str, ...]
"""Member names, from the message that a layout is of, or from a loop's element: () is that itself."""


@frozen
class Phase:
    """Partial knowledge about an offset: its remainder on division by `modulus`, which is 1, 2, 4 or 8."""

    modulus: int
    remainder: int

    def padding(self, alignment: int) -> int | None:
        """Return the bytes to the next multiple of `alignment`, or None when that is not known."""
        return -self.remainder % alignment if alignment <= self.modulus else None

    def aligned(self, alignment: int) -> Phase:
        """Return what is known once the padding has been passed."""
        padding = self.padding(alignment)
        return Phase(alignment, 0) if padding is None else self.after(padding)

    def after(self, count: int) -> Phase:
        """Return what is known `count` bytes further on."""
        return Phase(self.modulus, (self.remainder + count) % self.modulus)

    def either(self, other: Phase) -> Phase:
        """Return what is known where both this and the other may have led."""
        modulus = gcd(self.modulus, other.modulus, self.remainder - other.remainder)
        return Phase(modulus, self.remainder % modulus)


START: Final = Phase(MAX_ALIGNMENT, 0)
UNKNOWN: Final = Phase(1, 0)


@frozen
class Scalar:
    """One primitive. A hidden one stands for an empty message: written as 0, read past."""

    path: Path
    type: Primitive
    hidden: bool = False

    @property
    def size(self) -> int:
        """Its bytes."""
        return SIZES[self.type.name]

    @property
    def alignment(self) -> int:
        """The alignment of its offset."""
        return SIZES[self.type.name]


@frozen
class InlineArray:
    """A small array of primitives."""

    path: Path
    type: Array
    of: Primitive

    @property
    def size(self) -> int:
        """The bytes of all elements."""
        return self.type.size * SIZES[self.of.name]

    @property
    def alignment(self) -> int:
        """The alignment of the first element."""
        return SIZES[self.of.name]


@frozen
class Length:
    """The uint32 before what has no fixed size.

    For a string these are the bytes, the NUL at the end included; for a wstring its UTF-16 code
    units, without any NUL; for a sequence its elements.
    """

    path: Path
    type: String | Sequence

    @property
    def size(self) -> int:
        """Its bytes."""
        return 4

    @property
    def alignment(self) -> int:
        """The alignment of its offset."""
        return 4


Member = Scalar | InlineArray | Length


@frozen
class Segment:
    """A part of a run whose inner padding is known: `paddings[i]` bytes come before `members[i]`.

    Where `alignment` is more than 1, the offset has first to be rounded up to a multiple of it.
    """

    alignment: int
    members: tuple[Member, ...]
    paddings: tuple[int, ...]

    @property
    def size(self) -> int:
        """The bytes after that rounding, padding included."""
        return sum(self.paddings) + sum(member.size for member in self.members)


@frozen
class Run:
    """Fixed-size members side by side, as many as there are."""

    members: tuple[Member, ...]
    start: Phase

    @property
    def alignment(self) -> int:
        """The largest alignment of a member."""
        return max(member.alignment for member in self.members)

    @property
    def count(self) -> Length | None:
        """The count at the run's end, if it has one: only what follows the run tells what it counts."""
        last = self.members[-1]
        return last if isinstance(last, Length) else None

    @property
    def pieces(self) -> tuple[Segment, ...]:
        """The run, cut where padding depends on what comes before: one piece if none does."""
        pieces: list[tuple[int, list[Member], list[int]]] = []
        phase = self.start
        for member in self.members:
            padding = phase.padding(member.alignment)
            if padding is None or not pieces:
                pieces.append((1 if padding is not None else member.alignment, [], []))
            pieces[-1][1].append(member)
            pieces[-1][2].append(padding or 0)
            phase = phase.aligned(member.alignment).after(member.size)
        return tuple(
            Segment(alignment, tuple(members), tuple(paddings)) for alignment, members, paddings in pieces
        )

    def end(self, start: Phase) -> Phase:
        """Return the phase behind the run when it begins at `start`."""
        for member in self.members:
            start = start.aligned(member.alignment).after(member.size)
        return start

    def is_fixed(self, start: Phase) -> bool:
        """Tell if all padding is known when the run begins at `start`."""
        for member in self.members:
            if start.padding(member.alignment) is None:
                return False
            start = start.aligned(member.alignment).after(member.size)
        return True


@frozen
class StringData:
    """The characters of a string with a NUL at their end, or the code units of a wstring, 4 bytes each."""

    path: Path
    type: String
    start: Phase


@frozen
class PrimitiveElements:
    """Primitives side by side. Where there are none, there is no padding either."""

    path: Path
    type: Array | Sequence
    of: Primitive
    start: Phase

    @property
    def padding(self) -> int | None:
        """The bytes before the first value, or None when only the message tells."""
        return self.start.padding(SIZES[self.of.name])


@frozen
class Loop:
    """Strings or messages one after the other; `body` holds for each, the paths in it begin there."""

    path: Path
    type: Array | Sequence
    body: MessageLayout
    start: Phase


@frozen
class MessageCall:
    """A whole message whose layout stands elsewhere and begins with any phase."""

    path: Path
    name: TypeName
    start: Phase


LayoutStep = Run | StringData | PrimitiveElements | Loop | MessageCall


@frozen
class InlinedMessage:
    """A message unfolded into a layout: languages that build objects need to know."""

    path: Path
    name: TypeName


@frozen
class MessageLayout:
    """The steps of a message that begins with the phase `start`, and the phase behind it."""

    steps: tuple[LayoutStep, ...]
    inner: tuple[InlinedMessage, ...]
    start: Phase
    end: Phase

    @property
    def least(self) -> int:
        """The fewest bytes that such a message can take, padding left out; at least 1."""
        return sum(_least(step) for step in self.steps)


def _least(step: LayoutStep) -> int:
    match step:
        case Run(members):
            return sum(member.size for member in members)
        case PrimitiveElements(_, Array(_, count), of):
            return count * SIZES[of.name]
        case Loop(_, Array(_, count), body):
            return count * body.least
        case MessageCall():
            return 1
        case _:
            return 0
