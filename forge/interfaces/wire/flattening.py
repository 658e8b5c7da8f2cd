"""Compute the layout of messages: inline nested messages and merge fixed-size members into runs."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from forge.base.frozen import frozen
from forge.interfaces.model import Array, Named, Primitive, Sequence, String
from forge.interfaces.wire.layout import (
    SIZES,
    START,
    UNKNOWN,
    InlineArray,
    InlinedMessage,
    Length,
    Loop,
    MessageCall,
    MessageLayout,
    Phase,
    PrimitiveElements,
    Run,
    Scalar,
    StringData,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.interfaces.model import Element, Message, Type, TypeName
    from forge.interfaces.wire.layout import LayoutStep, Member, Path

RUN_ARRAY_LIMIT: Final = 512
"""Larger arrays, in bytes, are moved on their own: a saved copy operation no longer matters."""

INLINE_LIMIT: Final = 64
"""Messages of more steps and members than this are not inlined into others."""


@frozen
class LayoutBuilder:
    """Computes the layouts of messages; `known` contains them and all nested messages."""

    known: Mapping[TypeName, Message]
    _weights: dict[TypeName, int] = field(default_factory=dict)

    def of(self, name: TypeName, start: Phase = START) -> MessageLayout:
        """Return the layout of a message, which is flattened even if it is large."""
        flattening = _Flattening(self, start)
        flattening.add_members((), name)
        return flattening.layout()

    def of_element(self, type_: Type, start: Phase) -> MessageLayout:
        """Return the layout of an element of a collection, or of a single member; its path is ()."""
        flattening = _Flattening(self, start)
        flattening.add((), type_)
        return flattening.layout()

    def is_large(self, name: TypeName) -> bool:
        """Return True if the message is too large to be inlined into others."""
        return self._weight(name) > INLINE_LIMIT

    def _weight(self, name: TypeName) -> int:
        if name not in self._weights:
            members = self.known[name].members
            self._weights[name] = sum(self._weight_of(member.type) for member in members)
        return self._weights[name]

    def _weight_of(self, type_: Type) -> int:
        match type_:
            case Array(of) | Sequence(of):
                return 1 + self._weight_of(of)
            case Named(name):
                return 1 if self.is_large(name) else self._weight(name)
            case _:
                return 1


@dataclass(slots=True)
class _Flattening:
    """Collects the steps of a layout."""

    layouts: LayoutBuilder
    start: Phase
    steps: list[LayoutStep] = field(default_factory=list)
    inlined: list[InlinedMessage] = field(default_factory=list)
    run: list[Member] = field(default_factory=list)
    phase: Phase = UNKNOWN
    """The phase at the start of the current run."""

    def __post_init__(self) -> None:
        self.phase = self.start

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
                self._step(StringData(path, type_, self.phase), Phase(4, 0) if type_.wide else UNKNOWN)
            case Named(name) if self.layouts.is_large(name):
                self._close()
                self._step(MessageCall(path, name, self.phase), UNKNOWN)
            case Named(name):
                self.inlined.append(InlinedMessage(path, name))
                self.add_members(path, name)
            case Array() | Sequence():
                self._add_collection(path, type_)

    def _add_collection(self, path: Path, type_: Array | Sequence) -> None:
        of = type_.of
        if (
            isinstance(type_, Array)
            and isinstance(of, Primitive)
            and type_.size * SIZES[of.name] <= RUN_ARRAY_LIMIT
        ):
            self.run.append(InlineArray(path, type_, of))
            return
        if isinstance(type_, Sequence):
            self.run.append(Length(path, type_))
        self._close()
        start = self.phase
        if isinstance(of, Primitive):
            end = _phase_after(start.aligned(SIZES[of.name]), SIZES[of.name], type_)
            step: LayoutStep = PrimitiveElements(path, type_, of, start)
        else:
            body = self._body(of)
            end = body.end
            step = Loop(path, type_, body, start)
        self._step(step, start.join(end) if isinstance(type_, Sequence) else end)

    def _body(self, of: Element) -> MessageLayout:
        """Return a layout that is valid for the first element and for those after other elements."""
        body = self.layouts.of_element(of, self.phase)
        while (start := body.start.join(body.end)) != body.start:
            body = self.layouts.of_element(of, start)
        return body

    def _step(self, step: LayoutStep, end: Phase) -> None:
        self.steps.append(step)
        self.phase = end

    def _close(self) -> None:
        if self.run:
            run = Run(tuple(self.run), self.phase)
            self._step(run, run.end(self.phase))
            self.run.clear()


def _phase_after(first: Phase, size: int, type_: Array | Sequence) -> Phase:
    """Return the phase after values of the given size, the first of which is at `first`."""
    if isinstance(type_, Array):
        return first.after(type_.size * size)
    return first.join(first.after(size))
