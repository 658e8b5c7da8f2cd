"""The layout of a serialized message (XCDR1, DDS-XTypes 1.3).

Runs of fixed-size members and the data between them. A layout is a message flattened into steps in
serialization order: nested messages are inlined, and fixed-size members are merged into runs. The serializers
of all languages are generated from layouts:

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

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import gcd
from typing import Final

from forge.base.frozen import frozen
from forge.interfaces.model import Array, Message, Named, Primitive, Sequence, String, Type, TypeName

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
        padding = self.padding(alignment)
        return Phase(alignment, 0) if padding is None else self.after(padding)

    def after(self, count: int) -> Phase:
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

    alignment = size


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

    size = alignment = 4


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
        return all(segment.alignment == 1 for segment in Run(self.members, start).segments)


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
    """A message with a separate layout, which starts at an unknown phase."""

    path: Path
    name: TypeName
    start: Phase


LayoutStep = Run | StringData | PrimitiveElements | Loop | MessageCall


@frozen
class MessageLayout:
    """The steps of a message that starts at the phase `start`, and the phase `end` after it."""

    steps: tuple[LayoutStep, ...]
    inlined: tuple[tuple[Path, TypeName], ...]
    """The nested messages that are part of the steps; languages that create objects need to create them."""
    start: Phase
    end: Phase

    @property
    def min_size(self) -> int:
        """The minimum size of the message in bytes without padding; at least 1."""
        size = 0
        for step in self.steps:
            match step:
                case Run(members):
                    size += sum(member.size for member in members)
                case PrimitiveElements(_, Array(_, count), of):
                    size += count * SIZES[of.name]
                case Loop(_, Array(_, count), body):
                    size += count * body.min_size
                case MessageCall():
                    size += 1
        return size


RUN_ARRAY_LIMIT: Final = 512
"""Arrays of more bytes are copied separately: for these, one more copy operation does not matter."""

INLINE_LIMIT: Final = 64
"""Messages of more steps and members than this are not inlined into others."""


@frozen
class LayoutBuilder:
    """Computes the layouts of messages; `known` contains them and all nested messages."""

    known: Mapping[TypeName, Message]
    _weights: dict[TypeName, int] = field(default_factory=dict)

    def of(self, name: TypeName, start: Phase = START) -> MessageLayout:
        """Return the layout of a message, which is flattened even if it is large."""
        flattening = _Flattening(self, start, start)
        flattening.add_members((), name)
        return flattening.layout()

    def of_element(self, type_: Type, start: Phase) -> MessageLayout:
        """Return the layout of an element of a collection, or of a single member; its path is ()."""
        flattening = _Flattening(self, start, start)
        flattening.add((), type_)
        return flattening.layout()

    def is_large(self, name: TypeName) -> bool:
        """Return True if the message is too large to be inlined into others."""
        if name not in self._weights:
            members = self.known[name].members
            self._weights[name] = sum(self._weight_of(member.type) for member in members)
        return self._weights[name] > INLINE_LIMIT

    def _weight_of(self, type_: Type) -> int:
        match type_:
            case Array(of) | Sequence(of):
                return 1 + self._weight_of(of)
            case Named(name):
                return 1 if self.is_large(name) else self._weights[name]
            case _:
                return 1


@dataclass(slots=True)
class _Flattening:
    """Collects the steps of a layout."""

    layouts: LayoutBuilder
    start: Phase
    phase: Phase
    """The phase at the start of the current run."""
    steps: list[LayoutStep] = field(default_factory=list)
    inlined: list[tuple[Path, TypeName]] = field(default_factory=list)
    run: list[Member] = field(default_factory=list)

    def layout(self) -> MessageLayout:
        self._close()
        return MessageLayout(tuple(self.steps), tuple(self.inlined), self.start, self.phase)

    def add_members(self, path: Path, name: TypeName) -> None:
        message = self.layouts.known[name]
        for member in message.members:
            inside = (*path, member.name)
            if message.fields:
                self.add(inside, member.type)
            else:
                self.run.append(Scalar(inside, Primitive("uint8"), hidden=True))

    def add(self, path: Path, type_: Type) -> None:
        match type_:
            case Primitive():
                self.run.append(Scalar(path, type_))
            case String():
                self.run.append(Length(path, type_))
                self._close()
                self.steps.append(StringData(path, type_, self.phase))
                self.phase = Phase(4, 0) if type_.wide else UNKNOWN
            case Named(name) if self.layouts.is_large(name):
                self._close()
                self.steps.append(MessageCall(path, name, self.phase))
                self.phase = UNKNOWN
            case Named(name):
                self.inlined.append((path, name))
                self.add_members(path, name)
            case Array() | Sequence():
                self._add_collection(path, type_)

    def _add_collection(self, path: Path, type_: Array | Sequence) -> None:
        of = type_.of
        count = type_.size if isinstance(type_, Array) else None
        if isinstance(type_, Array) and isinstance(of, Primitive):
            array = InlineArray(path, type_, of)
            if array.size <= RUN_ARRAY_LIMIT:
                self.run.append(array)
                return
        if isinstance(type_, Sequence):
            self.run.append(Length(path, type_))
        self._close()
        start = self.phase
        if isinstance(of, Primitive):
            size = SIZES[of.name]
            first = start.aligned(size)
            end = first.after(count * size) if count else first.join(first.after(size))
            self.steps.append(PrimitiveElements(path, type_, of, start))
        else:
            # The layout must be valid for the first element and for those after other elements.
            body = self.layouts.of_element(of, start)
            while (joined := body.start.join(body.end)) != body.start:
                body = self.layouts.of_element(of, joined)
            end = body.end
            self.steps.append(Loop(path, type_, body, start))
        self.phase = end if count else start.join(end)

    def _close(self) -> None:
        if self.run:
            run = Run(tuple(self.run), self.phase)
            self.steps.append(run)
            self.phase = run.end(self.phase)
            self.run.clear()
